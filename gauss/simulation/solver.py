"""Certified accelerations, one state at a time."""

import numpy as np

from gauss.assembly import Applied, assemble_motion, kinematics
from gauss.backends import make, solve
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, System


class Solver:
    """Accelerations by one backend, which keeps its workspace from call to call.

    Parameters
    ----------
    backend : str
        Name of the backend, or "auto".
    """

    def __init__(self, backend: str = "auto"):
        self.backend = "auto" if backend == "auto" else make(backend)
        self.evaluations = 0
        self.worst_error = 0.0

    @property
    def method(self) -> str:
        """What was used, in words."""
        name = self.backend if isinstance(self.backend, str) else self.backend.name
        return f"backend {name!r}, certified at every evaluation"

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Certified accelerations and the power of all loads.

        Raises
        ------
        SimulationError
            If the backend's answer is not certified; the message says why.
        """
        motion = kinematics(system, state)
        applied = Applied(motion)
        solution = solve(assemble_motion(motion, applied, load), self.backend)
        self.evaluations += 1
        if not solution.status.certified:
            raise SimulationError(f"t = {state.t:.6g} s, backend {solution.backend!r}: {solution.status}.")
        self.worst_error = max(self.worst_error, solution.certificate.error)
        driven = applied.driven - solution.multipliers @ solution.compulsion.C  # constraints that move do work, as drives do
        return Rates(solution.qdd, np.array([driven, applied.loaded, applied.dissipated]))

    def confirm(self, point: Point, last: bool = False):
        """Do nothing: every evaluation was certified."""
