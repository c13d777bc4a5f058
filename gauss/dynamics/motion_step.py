"""One step of a motion of fixed steps with its exact derivatives: x₁ = F(x₀, u, p), F′ dx and F′ᵀ λ in machine code.

F is a step of an explicit Runge–Kutta method and a projection onto the constraints, traced as a whole; its derivatives are
those of the traced graph, forward and reverse (Griewank and Walther, Evaluating Derivatives, 2nd ed., ch. 3): derivatives of
the computed motion, exact to round-off. At a limit of an input they are one-sided, into the allowed values; beyond it zero.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from gauss.arguments import name_list
from gauss.codegen import Kernel, forward, reverse, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.constraint_leak import with_alike_bodies
from gauss.dynamics.inputs import InputForces, input_loads
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import Mechanism, loop_residual
from gauss.dynamics.parameter_terms import accelerations_by_parameter, size_of
from gauss.dynamics.plan import DERIVATIVES
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.errors import ArgumentError, did_you_mean
from gauss.integrators import Point, Rates
from gauss.integrators.step import Chart, stages
from gauss.integrators.tableaus import DOP853, DOPRI5, RK4, Tableau
from gauss.system import State, System, coordinate_rates

TABLEAUS: dict[str, Tableau] = {"rk4": RK4, "dopri5": DOPRI5, "dop853": DOP853}
PROJECTIONS = 2  # Newton steps in position after a step


class MotionStep:
    """Step of one system.

    ArgumentError if there is no such method or parameter.
    SimulationError if the system has no smooth dynamics in machine code, with the reasons.

    Parameters
    ----------
    integrator : str
        Explicit Runge–Kutta method: "rk4", "dopri5" or "dop853", with fixed steps.
    parameters : sequence of str
        Parameters of :meth:`gauss.System.parameter_derivatives`.
    absent : sequence of str
        Those of one value that do not act in its accelerations, as the limit of friction in one that sticks.
    moved_loops : ndarray, shape (m, n_p), optional
        Derivatives of the position residual by the parameters, as by the place of a stop that bears; zero when not given.
    """

    moved_loops: np.ndarray | None = None
    pattern: System | None = None  # system of numbers, where those of the system are symbols

    def __init__(
        self,
        system: System,
        integrator: str,
        parameters: Sequence[str] = (),
        absent: Sequence[str] = (),
        moved_loops: np.ndarray | None = None,
    ):
        if not isinstance(integrator, str) or integrator not in TABLEAUS:
            raise ArgumentError(f"sensitivities: no integrator {integrator!r}. {did_you_mean(str(integrator), TABLEAUS)}")
        self.system, self.parameters = system, name_list(parameters, "sensitivities: parameters")
        self.tableau, self.laws = TABLEAUS[integrator], Laws(system)
        DERIVATIVES.plan(Question(system, self.laws))
        self.absent = tuple(absent)
        self.sizes = {name: 1 if name in self.absent else size_of(system, name) for name in self.parameters}
        self.inputs, self.given = tuple(system.scene.inputs), InputForces(system)
        self.n_x, self.n_p = system.n_q + system.n_v, sum(self.sizes.values())
        self.moved_loops = moved_loops
        moved = b"" if moved_loops is None else moved_loops.tobytes()
        self.key: tuple = (MotionStep, integrator, self.parameters, self.absent, moved, self.laws.key)

    @cached_property
    def loads(self) -> list:
        """Its loads, inputs as parameters of traced functions."""
        return [*self.laws.traced, *input_loads(self.system)]

    @property
    def n_given(self) -> int:
        """Numbers of (q, v, u, δ), by which it is differentiated."""
        return self.n_x + len(self.inputs) + self.n_p

    def evaluate(self, state: State, delta) -> Rates:
        """Rates of a state, with the change of the accelerations for small changes δ of the parameters."""
        none = np.zeros(self.system.n_v)
        found, place = LoadedMechanism(self.system, self.loads, state.t, state.q, state.v, none).accelerations(), 0
        for name, size in self.sizes.items():
            still = np.zeros(self.system.n_v)
            if name not in self.absent:
                slopes = accelerations_by_parameter(self.system, self.loads, state.t, state.q, state.v, still, name)
                found = found + slopes @ delta[place : place + size]
            place += size
        return Rates(found, np.zeros(3))

    def moved(self, time, q, v, delta) -> np.ndarray:
        """Coordinates and rates (n_q + n_v,) after a step (t, h)."""
        t, h = time
        equations = _Equations(self, delta)
        state = State(t, q, v)
        chart, point = Chart(equations, state), Point(state, np.zeros(3), equations.evaluate(state))
        y = chart.start(point)
        K = stages(self.tableau, chart, y, chart.rate(y, point.rates), h)
        end = chart.state(t + h, y + h * (self.tableau.b @ K))
        return np.concatenate(self.projected(end, delta) if self.system.closes else [end.q, end.v])

    def projected(self, state: State, delta=()) -> list[np.ndarray]:
        """Coordinates and rates on the constraints, which small changes δ of the parameters may move."""
        q, v, t = state.q, state.v, state.t
        metric = with_alike_bodies(self.system, self.pattern)
        shift = 0.0 if self.moved_loops is None else self.moved_loops @ delta
        for _ in range(PROJECTIONS):
            phi, slack = loop_residual(self.system, q, t)
            step = Mechanism(self.system, q, v, t, metric).position_correction(phi + shift, slack)
            q = Chart(_Equations(self, ()), State(t, q, v)).state(t, np.concatenate([step, v])).q
        mechanism = Mechanism(self.system, q, v, t, metric)
        return [q, mechanism.nearest(v, mechanism.velocity_rhs)]

    def _kernel(self, name: str, function: Callable, *sizes: int) -> Kernel:
        """Machine code of a function of ((t, h), q, v, δ, …, u), kept with the system."""

        def traced(time, *given):
            inputs = [time[0].graph.parameter(one) for one in self.inputs]  # in the order of the scene
            return function(time, inputs, *given)

        sizes = 2, self.system.n_q, self.system.n_v, self.n_p, *sizes
        make = lambda: Kernel(write(traced, *sizes, name=name), batch=name in ("tangent", "curvature"))  # noqa: E731
        return cached_on_disk(self.system, (*self.key, name), make)

    @cached_property
    def move(self) -> Kernel:
        """((t, h), q, v, δ, u) → (q, v) after the step."""
        return self._kernel("move", lambda time, _, *given: self.moved(time, *given))

    @cached_property
    def tangent(self) -> Kernel:
        """((t, h), q, v, δ, direction, u) → change of (q, v) after the step."""

        def change(time, inputs, q, v, delta, direction):
            return forward(self.moved(time, q, v, delta), [*q, *v, *inputs, *delta], direction)

        return self._kernel("tangent", change, self.n_given)

    @cached_property
    def adjoint(self) -> Kernel:
        """((t, h), q, v, δ, weights, u) → gradient (n_given,) of weights · (q, v) after the step."""

        def gradient(time, inputs, q, v, delta, weights):
            return reverse(weights @ self.moved(time, q, v, delta), [*q, *v, *inputs, *delta])

        return self._kernel("adjoint", gradient, self.n_x)

    @cached_property
    def rates(self) -> Kernel:
        """((t, h), q, v, δ, u) → rates (n_q + n_v,) of the coordinates and accelerations."""

        def rates(time, _, q, v, delta):
            found = self.evaluate(State(time[0], q, v), delta).acceleration
            return np.concatenate([coordinate_rates(self.system, q, v), found])

        return self._kernel("rates", rates)

    def rate(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rates (n_q + n_v,) in a state under inputs u."""
        return self.rates(np.concatenate([[t, 0.0], x, np.zeros(self.n_p), u]))

    def after(self, t: float, h: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(q, v) after a step under inputs u."""
        return self.move(np.concatenate([[t, h], x, np.zeros(self.n_p), u]))

    def change(self, t: float, h: float, x: np.ndarray, u: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Changes (n_x, k) of (q, v) after a step along directions (n_given, k)."""
        start = np.concatenate([[t, h], x, np.zeros(self.n_p)])
        count = directions.shape[1]
        given = [np.tile(part[:, None], count) for part in (start, self.given.inside(u))]
        return self.tangent(np.concatenate([given[0], directions, given[1]]))

    def gradient(self, t: float, h: float, x: np.ndarray, u: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Gradient (n_given,) of weights · (q, v) after a step."""
        return self.adjoint(np.concatenate([[t, h], x, np.zeros(self.n_p), weights, self.given.inside(u)]))


class _Equations:
    """Equations of motion of a step, for a chart."""

    def __init__(self, step: MotionStep, delta):
        self.step, self.delta, self.system = step, delta, step.system

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        return self.step.evaluate(state, self.delta)
