"""Forward dynamics of one system as machine code, confirmed by the certified recursion."""

import numpy as np

from gauss.assembly import Applied, Motion, forward_dynamics, kinematics
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.simulation.solver import Solver
from gauss.system import State, System
from gauss.tracing import Kernel, trace

AGREEMENT = 1e-9  # of the kernel with the certified recursion, relative to the largest acceleration


def forward_kernel(system: System) -> Kernel:
    """Machine code of q, q̇, generalised forces of the loads on coordinates → q̈ and power of the loads on bodies."""
    return trace(lambda q, v, effort: loaded_dynamics(system, q, v, effort), system.n_q, system.n_v, system.n_v, batch=False)


def loaded_dynamics(system: System, q, v, effort):
    """Accelerations (n_v,) with the loads on bodies included, and their power (3,); floats or expressions."""
    on_bodies = [bound for bound in system.loads if not bound.on_coordinates]
    if not on_bodies:
        return forward_dynamics(system, q, v, effort), np.zeros(3)
    motion = kinematics(system, State(0.0, q, v))
    applied = Applied(motion, on_bodies)
    loaded = [body for body in range(system.structure.n_bodies) if _acts(applied.F[body]) or _acts(applied.M[body])]
    forces = {body: (motion.R[body].T @ applied.F[body], motion.R[body].T @ applied.M[body]) for body in loaded}
    power = np.array([applied.driven, applied.loaded, applied.dissipated])
    return forward_dynamics(system, q, v, effort, forces), power


def _acts(part: np.ndarray) -> bool:
    return part.dtype == object or part.any()


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
        self.on_coordinates = [bound for bound in system.loads if bound.on_coordinates]
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
        applied = Applied(Motion(system, state), self.on_coordinates)
        self.evaluations += 1
        result = self.kernel(np.concatenate([state.q, state.v, applied.P]))
        power = np.array([applied.driven, applied.loaded, applied.dissipated]) + result[system.n_v :]
        return Rates(result[: system.n_v], power)

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
