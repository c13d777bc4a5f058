"""Compiled forward dynamics, stepped by Python: where laws are Python functions, and where a step is too long to compile."""

import numpy as np

from gauss.assembly import Applied, Motion
from gauss.dynamics.consistent import ACCEPTED, project
from gauss.dynamics.engines.certified import Certified
from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.program import Kernels
from gauss.dynamics.rounding import TRUST, floor, spin
from gauss.integrators import Point, Rates
from gauss.system import State, System
from gauss.tracing import Kernel


def settled(system: System, kernel: Kernel, state: State) -> State:
    """State brought back to the constraints by machine code, see :class:`Kernels`; by numpy where a gap is left."""
    found, n_q = kernel(np.concatenate([[state.t], state.q, state.v])), system.n_q
    if found[-1] <= ACCEPTED:
        return State(state.t, found[:n_q], found[n_q : n_q + system.n_v])
    return project(system, state)


class Compiled(Engine):
    """Accelerations by the compiled articulated-body recursion, until it fails a check; then by the certified one.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.dynamics.conditions.obstacles`).
    kernels : Kernels
        Its machine code.
    loads : sequence of BoundLoad
        Loads that the machine code does not know; they act on coordinates.
    slow : sequence of str
        Names of loads that cost time.
    gains : tuple of float or None
        As for :class:`gauss.dynamics.engines.certified.Certified`; the machine code has its own.
    """

    def __init__(self, system: System, kernels: Kernels, loads, slow=(), gains=None):
        self.system, self.kernels, self.loads, self.slow = system, kernels, loads, slow
        self.certified = Certified("auto", gains)
        self.worst = 0.0

    @property
    def name(self) -> str:
        """What was used, in words."""
        if self.handed_over is None:
            called = f"; called in every evaluation, which costs time: {', '.join(self.slow)}"
            how = "compiled recursion, each step checked by inverse dynamics, the last by the certified recursion"
            return how + (called if self.slow else "")
        return f"certified recursion from t = {self.handed_over:.6g} s on: the compiled one lost too many digits there"

    @property
    def error(self) -> float:
        """Largest relative error of accelerations that was found."""
        return max(self.worst, self.certified.error)

    @property
    def rescued(self) -> int:
        """Solutions for which another method stepped in."""
        return self.certified.rescued

    def rates(self, system: System, state: State, load=0.0) -> Rates:
        """Accelerations, and the power of all loads; ``load`` (n_v,) is added."""
        if self.handed_over is not None:
            return self.certified.rates(system, state, load if np.ndim(load) else None)
        applied = Applied(Motion(system, state), self.loads)
        self.evaluations += 1
        result = self.kernels.forward(np.concatenate([[state.t], state.q, state.v, applied.P + load]))
        power = np.array([applied.driven, applied.loaded, applied.dissipated]) + result[system.n_v :]
        return Rates(result[: system.n_v], power)

    def project(self, system: System, state: State) -> State:
        """State after a step, brought back to the constraints."""
        if self.handed_over is None and self.kernels.settle is not None:
            return settled(system, self.kernels.settle, state)
        return self.certified.project(system, state)

    def hand_over(self, t: float) -> bool:
        """Let the certified recursion go on from here; False if it does already."""
        if self.handed_over is not None:
            return False
        self.handed_over = t
        return True

    def check(self, point: Point, last: bool = False, load=0.0):
        """Check the accelerations of a point by inverse dynamics; at the last point by the certified recursion, too.

        They are those under the further generalised forces ``load`` (n_v,).

        Raises
        ------
        DistrustError
            If they are off, as happens when masses differ by many orders; from then on the certified recursion is used.
        """
        if self.handed_over is not None:
            return
        state, found = point.state, point.rates.acceleration
        called = Applied(Motion(self.system, state), self.loads).P + load
        unused = np.zeros(6)  # work and power
        error = self.kernels.check(np.concatenate([[state.t], state.q, state.v, unused[:3], found, unused[3:], called]))[0]
        if last:
            exact = self.certified.rates(self.system, state, load if np.ndim(load) else None).acceleration
            off, size = (np.abs(part / self.system.scale.coordinates).max(initial=0.0) for part in (exact - found, exact))
            error = max(error, off / max(size, floor(self.system) + spin(self.system, state.v)))
        if not error <= TRUST:
            self.handed_over = state.t
            raise DistrustError(f"t = {state.t:.6g} s: compiled accelerations are off by {error:.1e}.")
        self.worst = max(self.worst, error)
