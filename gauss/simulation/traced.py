"""Forward dynamics of one system as machine code, confirmed by the certified recursion."""

import numpy as np

from gauss.assembly import Applied, Motion, forward_dynamics
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.simulation.solver import Solver
from gauss.system import State, System
from gauss.tracing import Kernel, trace

AGREEMENT = 1e-9  # of the kernel with the certified recursion; masses that differ by ten orders miss it


def forward_kernel(system: System) -> Kernel:
    """Machine code of q, q̇, generalised forces → q̈."""
    sizes = system.n_q, system.n_v, system.n_v
    return trace(lambda q, v, effort: forward_dynamics(system, q, v, effort), *sizes, batch=False)


class Traced:
    """Accelerations by the compiled articulated-body recursion.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.system.obstacles`).
    kernel : Kernel
        Its machine code, see :func:`forward_kernel`.
    """

    def __init__(self, system: System, kernel: Kernel):
        self.system, self.kernel, self.certified = system, kernel, Solver()
        self.evaluations = 0

    @property
    def worst_error(self) -> float:
        """Largest estimated relative error of the steps that were confirmed."""
        return self.certified.worst_error

    def rates(self, system: System, state: State) -> Rates:
        """Accelerations, and the power of all loads."""
        applied = Applied(Motion(system, state))  # the loads of such a system ask for coordinates and rates only
        self.evaluations += 1
        qdd = self.kernel(np.concatenate([state.q, state.v, applied.P]))
        return Rates(qdd, np.array([applied.driven, applied.loaded, applied.dissipated]))

    def confirm(self, point: Point):
        """Compare with the certified recursion.

        Raises
        ------
        SimulationError
            If the two differ; the message says what to do.
        """
        exact, found = self.certified.rates(self.system, point.state).acceleration, point.rates.acceleration
        error = np.abs(exact - found).max(initial=0.0)
        if not error <= AGREEMENT * np.abs(exact).max(initial=0.0):
            raise SimulationError(
                f"t = {point.state.t:.6g} s: compiled accelerations are off by {error:.1e}, as happens when masses differ "
                "by many orders; use backend='recursion'."
            )
        self.certified.worst_error = max(self.certified.worst_error, error / max(np.abs(exact).max(initial=0.0), 1e-300))
