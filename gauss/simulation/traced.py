"""Compiled forward dynamics with laws that are called as Python functions, confirmed by the certified recursion."""

import numpy as np

from gauss.assembly import Applied, Motion
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.simulation.laws import Laws
from gauss.simulation.solver import Solver
from gauss.system import State, System
from gauss.tracing import Kernel

AGREEMENT = 1e-9  # of the kernel with the certified recursion, relative to the largest acceleration


class DistrustError(SimulationError):
    """A step was made with compiled accelerations that the certified recursion does not confirm; make it again."""


class Traced:
    """Accelerations by the compiled articulated-body recursion, until it fails a check; then by the certified one.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.system.obstacles`).
    kernel : Kernel
        Its machine code, see :meth:`gauss.simulation.program.Program.forward`.
    laws : Laws
        Its loads; those that are called act on coordinates.
    """

    def __init__(self, system: System, kernel: Kernel, laws: Laws):
        self.system, self.kernel, self.laws, self.certified = system, kernel, laws, Solver("recursion")
        self.evaluations = 0
        self.failed_at: float | None = None

    @property
    def method(self) -> str:
        """What was used, in words."""
        if self.failed_at is None:
            return (
                "compiled articulated-body recursion, each step confirmed by the certified recursion; "
                f"called in every evaluation, which costs the time: {', '.join(self.laws.reasons)}"
            )
        return f"certified recursion from t = {self.failed_at:.6g} s on: the compiled one lost too many digits there"

    @property
    def worst_error(self) -> float:
        """Largest estimated relative error of the steps that were confirmed."""
        return self.certified.worst_error

    def rates(self, system: System, state: State) -> Rates:
        """Accelerations, and the power of all loads."""
        if self.failed_at is not None:
            return self.certified.rates(system, state)
        applied = Applied(Motion(system, state), self.laws.called)
        self.evaluations += 1
        result = self.kernel(np.concatenate([[state.t], state.q, state.v, applied.P]))
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
