"""Forward dynamics of one system as machine code, confirmed by the certified recursion."""

import numpy as np

from gauss.assembly import Applied, Motion, forward_dynamics
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.simulation.solver import Solver
from gauss.system import State, System
from gauss.tracing import Kernel, trace

AGREEMENT = 1e-9  # of the kernel with the certified recursion, relative to the largest acceleration


def forward_kernel(system: System) -> Kernel:
    """Machine code of q, q̇, generalised forces → q̈."""
    sizes = system.n_q, system.n_v, system.n_v
    return trace(lambda q, v, effort: forward_dynamics(system, q, v, effort), *sizes, batch=False)


class DistrustError(SimulationError):
    """A step was made with compiled accelerations that the certified recursion does not confirm; make it again."""


class Traced:
    """Accelerations by the compiled articulated-body recursion, until it fails a check; then by the certified one.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.system.obstacles`).
    kernel : Kernel
        Its machine code, see :func:`forward_kernel`.
    """

    def __init__(self, system: System, kernel: Kernel):
        self.system, self.kernel, self.certified = system, kernel, Solver("recursion")
        self.evaluations = 0
        self.failed_at: float | None = None

    @property
    def method(self) -> str:
        """What was used, in words."""
        if self.failed_at is None:
            return "compiled articulated-body recursion, each step confirmed by the certified recursion"
        return f"certified recursion from t = {self.failed_at:.6g} s on: the compiled one lost too many digits there"

    @property
    def worst_error(self) -> float:
        """Largest estimated relative error of the steps that were confirmed."""
        return self.certified.worst_error

    def rates(self, system: System, state: State) -> Rates:
        """Accelerations, and the power of all loads."""
        if self.failed_at is not None:
            return self.certified.rates(system, state)
        applied = Applied(Motion(system, state))  # the loads of such a system ask for coordinates and rates only
        self.evaluations += 1
        qdd = self.kernel(np.concatenate([state.q, state.v, applied.P]))
        return Rates(qdd, np.array([applied.driven, applied.loaded, applied.dissipated]))

    def confirm(self, point: Point):
        """Compare with the certified recursion.

        Raises
        ------
        DistrustError
            If the two differ, as happens when masses differ by many orders; from then on the certified one is used.
        """
        if self.failed_at is not None:
            return
        exact, found = self.certified.rates(self.system, point.state).acceleration, point.rates.acceleration
        error = np.abs(exact - found).max(initial=0.0)
        if not error <= AGREEMENT * np.abs(exact).max(initial=0.0):
            self.failed_at = point.state.t
            raise DistrustError(f"t = {point.state.t:.6g} s: compiled accelerations are off by {error:.1e}.")
        self.certified.worst_error = max(self.certified.worst_error, error / max(np.abs(exact).max(initial=0.0), 1e-300))
