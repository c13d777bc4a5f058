"""Equations of motion of a scene with inputs as functions of CasADi, in shares of the units of the scene.

x = (q, v) holds all coordinates and rates, those of loops included: ẋ = f(t, x, u) with the accelerations of Gauss's
principle, and F(t, x) = 0, the residuals of positions and rates. Of redundant rows those are kept that are independent in
one state.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import qr

from gauss.analysis.export.casadi_function import casadi_function
from gauss.analysis.export.exported_function import ExportedFunction, Shape, without_calls
from gauss.analysis.tangents import constraint_residuals
from gauss.analysis.user_functions import numbers_of
from gauss.codegen import write
from gauss.dynamics import compile_scene
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.null_space import RANK_TOLERANCE
from gauss.dynamics.plan import EXPORTS
from gauss.dynamics.rules import Question
from gauss.errors import SimulationError, extra
from gauss.system import BoundLoad, State, System, coordinate_rates

Casadi = Any  # functions and expressions of CasADi, which has no types


class OptimalEquations:
    """Functions of one system, on which collocation is written.

    SimulationError if the scene has no inputs, or elements that no smooth function describes, by their names.

    Attributes
    ----------
    units : ndarray, shape (n_q + n_v,)
        Units of coordinates and rates.
    lowest, highest : ndarray, shape (n_u,)
        Limits of the inputs; the traced inputs have none.
    """

    def __init__(self, system: System):
        inputs = system.scene.inputs
        if not inputs:
            raise SimulationError(
                f"optimal motion: scene {system.scene.name!r} has no inputs; scene.input(name, joint) adds one."
            )
        self.lowest, self.highest = np.array([given.bounds for given in inputs.values()]).T
        self.system, self.names = unlimited(system), tuple(inputs)
        self.laws = Laws(self.system)
        EXPORTS.plan(Question(self.system, self.laws))
        self.n_x, self.n_u = system.n_q + system.n_v, len(inputs)
        self.units = np.concatenate([coordinate_units(system), system.scale.rates])

    def loads(self, u) -> list[BoundLoad]:
        """Loads of the scene, with values of the inputs, or laws of them."""
        given = self.system.scene.inputs.values()
        return [*self.laws.traced, *(BoundLoad(one, (_law(value),)) for one, value in zip(given, u, strict=True))]

    @cached_property
    def input_units(self) -> np.ndarray:
        """Sizes (n_u,) of the inputs: their limits, or the effort that the weights of the scene ask for."""
        largest = np.maximum(np.abs(self.lowest), np.abs(self.highest))
        return np.where(np.isfinite(largest), largest, max(self.system.scale.energy, np.finfo(float).tiny))

    @cached_property
    def rates(self) -> Casadi:
        """(t, x, u) → dx/dt [1/s]."""
        system = self.system

        def values(t, q, v, u):
            mechanism = LoadedMechanism(system, self.loads(u), t[0], q, v, np.zeros(system.n_v))
            return coordinate_rates(system, q, v), mechanism.accelerations()

        return self.in_units(values, "rates", self.units)

    @cached_property
    def residuals(self) -> Casadi:
        """(t, x) → residuals of positions, unit quaternions included, then of rates; all rows."""
        system = self.system

        def values(t, q, v, _):
            positions, rates = constraint_residuals(system, t[0], q, v) if system.has_closures else ((), ())
            lengths = [q[place] @ q[place] - 1.0 for place in system.quaternions.values()]
            self.n_positions = len(positions) + len(lengths)
            return np.array([*positions, *lengths, *rates], dtype=object)

        return self.in_units(values, "residuals")

    def independent_rows(self, t: float, x: np.ndarray) -> list[int]:
        """Rows of the residuals that are independent in a state, in shares of the units."""
        import casadi

        time, at = casadi.MX.sym("t"), casadi.MX.sym("x", self.n_x)
        slope = casadi.jacobian(self.residuals(time, at, casadi.DM.zeros(self.n_u)), at)
        J = np.array(casadi.Function("slope", [time, at], [slope])(t, x))
        n_q, m = self.system.n_q, self.n_positions
        return _independent(J[:m, :n_q]) + [m + row for row in _independent(J[m:, n_q:])]

    def running_cost(self, cost: Callable) -> Casadi:
        """(t, x, u) → cost per time, of a function of (t, q, v, u)."""

        def values(t, q, v, u):
            return numbers_of(cost, (t[0], q, v, u), "optimal motion: cost", 1)

        return self.in_units(values, "cost")

    def at_end(self, function: Callable, what: str, units=1.0, size: int | None = None) -> Casadi:
        """(t, x, u) → values of a function of (q, v), in shares of the units.

        Parameters
        ----------
        function : callable
            (q, v) → numbers, or several vectors of them.
        what : str
            Name of the argument, for messages.
        size : int, optional
            Number of the values; any when not given.
        """

        def values(t, q, v, u):
            return numbers_of(function, (q, v), f"optimal motion: {what}", size)

        return self.in_units(values, what, units)

    def in_units(self, values: Callable, name: str, units=1.0) -> Casadi:
        """Function of CasADi of (t, x, u), shares of their units, of a traced function of (t, q, v, u); t is an array."""
        with extra("export"):
            import casadi
        system = self.system
        function = without_calls(write(values, 1, system.n_q, system.n_v, self.n_u, name=name))
        size = len(function.outputs)
        inputs: dict[str, Shape] = {"t": (1,), "q": (system.n_q,), "v": (system.n_v,), "u": (self.n_u,)}
        plain = casadi_function(ExportedFunction(name, function, inputs, {"result": (size,)}))
        t, x, u = casadi.SX.sym("t"), casadi.SX.sym("x", self.n_x), casadi.SX.sym("u", self.n_u)
        state = x * self.units
        found = plain(t, state[: system.n_q], state[system.n_q :], u * self.input_units) / units
        return casadi.Function(name, [t, x, u], [found])

    def shares(self, state: State) -> np.ndarray:
        """X of a state, in shares of the units."""
        return np.concatenate([state.q, state.v]) / self.units


def unlimited(system: System) -> System:
    """The same system, whose inputs have no limits: where they are cut off there is no gradient."""
    inputs = system.scene.inputs
    if all(given.limits is None for given in inputs.values()):
        return system
    free = {name: replace(given, limits=None) for name, given in inputs.items()}
    return compile_scene(replace(system.scene, inputs=free))


def coordinate_units(system: System) -> np.ndarray:
    """Units (n_q,) of the coordinates; 1 for entries of quaternions."""
    found = np.ones(system.n_q)
    for joint in system.joints:
        plain = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
        found[joint.q.start : joint.q.start + plain] = system.scale.coordinates[joint.v.start : joint.v.start + plain]
    return found


def _law(value) -> Callable:
    """Law of an input: a function of time, or a value."""
    return (lambda t, _: value(t)) if callable(value) else (lambda *_: value)


def _independent(rows: np.ndarray) -> list[int]:
    """Places of independent rows, by pivoting."""
    if not rows.size:
        return []
    _, R, order = qr(rows.T, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(R))
    return sorted(int(place) for place in order[: int((sizes > RANK_TOLERANCE * sizes.max(initial=1.0)).sum())])
