"""Certified accelerations, one state at a time."""

import numpy as np

from gauss.assembly import Applied, Assembler, assemble_motion, kinematics, with_contacts
from gauss.backends import make, solve
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.simulation.laws import Laws
from gauss.system import State, System

PATIENCE = 500  # evaluations by numpy that cost about as much as the machine code of the assembly does once


class Solver:
    """Accelerations of one system by one backend, which keeps its workspace from call to call.

    Parameters
    ----------
    backend : str
        Name of the backend, or "auto".
    """

    def __init__(self, backend: str = "auto"):
        self.backend = "auto" if backend == "auto" else make(backend)
        self.assembler: Assembler | None = None
        self.evaluations = 0
        self.worst_error = 0.0

    @property
    def method(self) -> str:
        """What was used, in words."""
        name = self.backend if isinstance(self.backend, str) else self.backend.name
        return f"backend {name!r}, certified at every evaluation"

    def rates(self, system: System, state: State, load=None, loads=None) -> Rates:
        """Certified accelerations and the power of the loads: of all, or of those given; ``load`` (n_v,) is added.

        Raises
        ------
        SimulationError
            If the backend's answer is not certified; the message says why.
        """
        compulsion, (driven, loaded, dissipated) = self._assembled(system, state, load, loads)
        solution = solve(compulsion, self.backend)
        self.evaluations += 1
        if not solution.status.certified:
            raise SimulationError(f"t = {state.t:.6g} s, backend {solution.backend!r}: {solution.status}.")
        self.worst_error = max(self.worst_error, solution.certificate.error)
        driven = driven - solution.multipliers @ solution.compulsion.C  # constraints that move do work, as drives do
        return Rates(solution.qdd, np.array([driven, loaded, dissipated]))

    def _assembled(self, system: System, state: State, load, loads):
        """Compulsion, and power of drives, forces and dampers; by machine code once there is enough to do for it."""
        may_compile = self.evaluations == PATIENCE and loads is None and not system.contacts.placed
        if may_compile and not (laws := Laws(system)).called:
            self.assembler = system.dynamics.on_demand(f"assembler {laws.key}", lambda: Assembler(system))
        if self.assembler is not None:
            return self.assembler(state, load), self.assembler.power
        motion = kinematics(system, state)
        applied = Applied(motion, loads)
        compulsion = with_contacts(motion, assemble_motion(motion, applied, load))
        return compulsion, (applied.driven, applied.loaded, applied.dissipated)

    def confirm(self, point: Point, last: bool = False):
        """Do nothing: every evaluation was certified."""
