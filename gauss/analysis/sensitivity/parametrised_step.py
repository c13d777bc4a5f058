"""Steps of a motion as a function of numbers of the system: masses, places of joints, constants of loads.

The numbers are parameters of the machine code, so that one compilation serves all of their values; the derivatives by them
are those of the traced graph, with loops and places of joints included.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.inputs import input_loads
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.motion_step import TABLEAUS, MotionStep
from gauss.dynamics.parameters import ParametrisedSystem
from gauss.dynamics.plan import DERIVATIVES
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached
from gauss.errors import ArgumentError, did_you_mean
from gauss.integrators import Rates
from gauss.system import State


class ParametrisedStep(MotionStep):
    """Step of the systems of one kind.

    ArgumentError if there is no such method.
    SimulationError if the system has no smooth dynamics in machine code, with the reasons.

    Parameters
    ----------
    integrator : str
        Explicit Runge–Kutta method: "rk4", "dopri5" or "dop853", with fixed steps.
    """

    def __init__(self, family: ParametrisedSystem, integrator: str):
        if not isinstance(integrator, str) or integrator not in TABLEAUS:
            raise ArgumentError(f"fit_motion: no integrator {integrator!r}. {did_you_mean(str(integrator), TABLEAUS)}")
        self.family, self.system, self.laws = family, family.system, Laws(family.pattern)
        self.pattern = family.pattern
        DERIVATIVES.plan(Question(family.pattern, self.laws))
        self.tableau, self.inputs = TABLEAUS[integrator], tuple(self.system.scene.inputs)
        self.n_x, self.n_p = self.system.n_q + self.system.n_v, len(family.varied)
        self.key = (ParametrisedStep, integrator, family.varied.tobytes(), self.laws.key)

    @cached_property
    def loads(self) -> list:
        """Its loads, inputs as parameters of traced functions."""
        return [*self.system.loads, *input_loads(self.system)]

    def evaluate(self, state: State, delta) -> Rates:
        """Rates of a state; the numbers are parameters of the graph."""
        still = np.zeros(self.system.n_v)
        found = LoadedMechanism(self.system, self.loads, state.t, state.q, state.v, still).accelerations(self.family.pattern)
        return Rates(found, np.zeros(3))

    def _kernel(self, name: str, function: Callable, *sizes: int) -> Kernel:
        """Machine code of a function of ((t, h), q, v, …, u, numbers), kept with the system."""

        def traced(time, q, v, *given):
            graph = time[0].graph
            inputs = [graph.parameter(one) for one in self.inputs]  # in the order of the scene
            numbers = [graph.parameter(one) for one in self.family.parameters]
            return function(time, inputs, q, v, numbers, *given)

        sizes = 2, self.system.n_q, self.system.n_v, *sizes
        make = lambda: Kernel(write(traced, *sizes, name=name), batch=name == "tangent")  # noqa: E731
        return cached(self.family.pattern, (*self.key, name), make)

    def moved_to(self, t: float, h: float, x: np.ndarray, u: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """(q, v) after a step under inputs u, of a system with these numbers."""
        return self.move(np.concatenate([[t, h], x, u, numbers]))

    def changes(self, t: float, h: float, x: np.ndarray, u: np.ndarray, numbers: np.ndarray, directions) -> np.ndarray:
        """Changes (n_x, k) of (q, v) after a step along directions (n_given, k)."""
        given = (np.tile(part[:, None], directions.shape[1]) for part in (np.concatenate([[t, h], x]), u, numbers))
        start, inputs, fixed = given
        return self.tangent(np.concatenate([start, directions, inputs, fixed]))
