"""Compiled forward dynamics called from Python: with opaque callbacks, and for systems too large for a compiled step."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE, project
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, relative_error
from gauss.dynamics.gear_trains import on_trains
from gauss.dynamics.load_forces import LoadForces
from gauss.integrators import Point, Rates
from gauss.system import State, System


def projected(system: System, kernel: Callable[[np.ndarray], np.ndarray], state: State) -> State:
    """State projected onto the constraints by machine code, see :class:`StateKernels`; by numpy where a residual is left."""
    found, n_q = kernel(np.concatenate([[state.t], state.q, state.v])), system.n_q
    if found[-1] <= RESIDUAL_TOLERANCE:
        return on_trains(system, State(state.t, found[:n_q], found[n_q : n_q + system.n_v]))
    return project(system, state)


class StateKernels(Protocol):
    """Functions of single states in machine code, as those of :class:`gauss.dynamics.traced_system.Kernels`."""

    @property
    def forward(self) -> Callable[[np.ndarray], np.ndarray]:
        """(t, q, v, generalised forces added) → (q̈, power of the loads)."""

    @property
    def check(self) -> Callable[[np.ndarray], np.ndarray]:
        """(point, generalised forces added) → error of its accelerations, …."""

    @property
    def project(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """(t, q, v) → (q and v on the constraints, …, position residual); None where nothing is projected."""


class CompiledEngine(Engine):
    """Accelerations by the compiled articulated-body recursion until a check fails, then by the certified engine.

    ``system``: a smooth system (see :func:`gauss.dynamics.conditions.obstacles`). ``loads``: loads beside the machine code;
    none when not given. ``slow``: names of the loads with opaque callbacks. ``gains``: Baumgarte gains of the certified
    engine; those of the machine code are compiled in.
    """

    evaluations = 0

    def __init__(self, system: System, kernels: StateKernels, loads: LoadForces | None = None, slow=(), gains=None):
        self.system, self.kernels, self.slow = system, kernels, slow
        self.loads = LoadForces(system) if loads is None else loads
        self.certified = CertifiedEngine("auto", gains)
        self.worst = 0.0

    @property
    def name(self) -> str:
        """Method, in words."""
        if self.handed_over is None:
            called = f"; called in every evaluation, which costs time: {', '.join(self.slow)}"
            how = "compiled recursion, each step checked by inverse dynamics, the last by the certified recursion"
            return how + (called if self.slow else "")
        return f"certified recursion from t = {self.handed_over:.6g} s on: the compiled one is too inaccurate there"

    @property
    def error(self) -> float:
        """Largest relative error of accelerations found by a check."""
        return max(self.worst, self.certified.error)

    @property
    def rescued(self) -> int:
        """Solutions that another backend found."""
        return self.certified.rescued

    def rates(self, system: System, state: State, load=0.0) -> Rates:
        """Accelerations, and the power of all loads; ``load`` (n_v,) is added."""
        if self.handed_over is not None:
            return self.certified.rates(system, state, load if np.ndim(load) else None)
        effort, power = self.loads(state)
        self.evaluations += 1
        result = self.kernels.forward(np.concatenate([[state.t], state.q, state.v, effort + load]))
        return Rates(result[: system.n_v], power + result[system.n_v :])

    def accelerations(self, state: State, loads: np.ndarray) -> np.ndarray:
        """Accelerations (k, n_v) under generalised forces (k, n_v) added to the loads, one by one."""
        if self.handed_over is not None:
            return np.array([self.certified.rates(self.system, state, load).acceleration for load in loads])
        inputs = np.empty((1 + state.q.size + 2 * self.system.n_v, len(loads)))
        inputs[: -self.system.n_v] = np.concatenate([[state.t], state.q, state.v])[:, None]
        inputs[-self.system.n_v :] = (self.loads(state)[0] + loads).T
        return self.kernels.forward(inputs)[: self.system.n_v].T

    def project(self, system: System, state: State) -> State:
        """State after a step, projected onto the constraints."""
        if self.handed_over is None and self.kernels.project is not None:
            return projected(system, self.kernels.project, state)
        return self.certified.project(system, state)

    def hand_over(self, t: float) -> bool:
        """Switch to the certified engine; False if that is in use already."""
        if self.handed_over is not None:
            return False
        self.handed_over = t
        return True

    def check(self, point: Point, last: bool = False, load=0.0):
        """Check the accelerations of a point by inverse dynamics; at the last point by the certified engine, too.

        ``load`` (n_v,) are generalised forces under which the accelerations were found, besides the loads.

        DistrustError if the residual is too large, as with masses of very different order; from then on the certified engine
        answers.
        """
        if self.handed_over is not None:
            return
        state, found = point.state, point.rates.acceleration
        tau = self.loads(state)[0] + load
        unused = np.zeros(6)  # work and power
        error = self.kernels.check(np.concatenate([[state.t], state.q, state.v, unused[:3], found, unused[3:], tau]))[0]
        if last:
            exact = self.certified.rates(self.system, state, load if np.ndim(load) else None).acceleration
            error = max(error, relative_error(self.system, found, exact, state.v))
        if not error <= ACCELERATION_TOLERANCE:
            self.handed_over = state.t
            raise DistrustError(f"t = {state.t:.6g} s: compiled accelerations are off by {error:.1e}, relative.")
        self.worst = max(self.worst, error)
