"""Certified accelerations: the compulsion of every state is minimised by a backend, with a certificate."""

from dataclasses import replace

import numpy as np

from gauss.backends import Backend, ready, solve
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution
from gauss.dynamics.assemble import assemble_motion, position_residual
from gauss.dynamics.compiled_assembly import Assembler
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.tiering import COMPILE_THRESHOLD
from gauss.dynamics.gap_functions import with_contacts
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.projection import velocity_residual_of
from gauss.dynamics.store import cached_on_disk
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, System


class CertifiedEngine(Engine):
    """Accelerations of one system by one backend with a persistent workspace.

    Parameters
    ----------
    backend : str, Backend or class
        Backend, or "auto".
    gains : tuple of float or None
        Baumgarte gains α and β [1/s] of the feedback −2α ċ − β² c.
    """

    evaluations, rescued = 0, 0

    def __init__(self, backend: str | Backend | type = "auto", gains: tuple[float, float] | None = None):
        self.gains = gains
        self.backend = "auto" if isinstance(backend, str) and backend == "auto" else ready(backend)
        self.assembler: Assembler | None = None
        self.largest_error = 0.0
        self._rescue = ""

    @property
    def name(self) -> str:
        """Method, in words."""
        name = self.backend if isinstance(self.backend, str) else self.backend.name
        rescue = f"; {self.rescued} times by {self._rescue}" if self.rescued else ""
        return f"backend {name!r}, certified at every evaluation{rescue}"

    @property
    def error(self) -> float:
        """Largest relative error of a certificate."""
        return self.largest_error

    def rates(self, system: System, state: State, load=None, loads=None) -> Rates:
        """Certified accelerations and power of the loads, all or those given; ``load`` (n_v,) is added to their forces.

        Raises
        ------
        SimulationError
            If the backend's answer is not certified; the message says why.
        """
        solution, (driven, loaded, dissipated) = self.solved(system, state, load, loads)
        driven = driven - solution.multipliers @ solution.compulsion.C  # rheonomic constraints do work, as drives do
        return Rates(solution.qdd, np.array([driven, loaded, dissipated]))

    def solved(self, system: System, state: State, load=None, loads=None) -> tuple[Solution, tuple]:
        """Certified solution, and power of drives, forces and dampers.

        Raises
        ------
        SimulationError
            If the backend's answer is not certified; the message says why.
        """
        compulsion, power = self.assembled(system, state, load, loads)
        return self.answer(compulsion, state.t), power

    def answer(self, compulsion: Compulsion, t: float) -> Solution:
        """Certified solution of a compulsion.

        Raises
        ------
        SimulationError
            If the backend's answer is not certified; the message says why.
        """
        solution = solve(compulsion, self.backend)
        self.evaluations += 1
        if not solution.status.certified:
            raise SimulationError(f"t = {t:.6g} s, backend {solution.backend!r}: {solution.status}.")
        if solution.status.rescued:
            self.rescued += 1
            self._rescue = f"{solution.backend!r}, where {solution.status.rescued}"
        self.largest_error = max(self.largest_error, solution.certificate.error)
        return solution

    def project(self, system: System, state: State) -> State:
        """State after a step, projected onto the constraints."""
        return project(system, state)

    def assembled(self, system: System, state: State, load, loads):
        """Compulsion, and power of drives, forces and dampers; compiled above the threshold of evaluations."""
        may_compile = self.evaluations == COMPILE_THRESHOLD and loads is None and self.gains is None
        may_compile = may_compile and not system.contacts.placed
        if may_compile and not (laws := Laws(system)).called:
            self.assembler = cached_on_disk(system, (Assembler, laws.key), lambda: Assembler(system))
        if self.assembler is not None:
            return self.assembler(state, load), self.assembler.power
        motion = kinematics(system, state)
        applied = Applied(motion, loads)
        compulsion = assemble_motion(motion, applied, load)
        if self.gains is not None:
            alpha, beta = self.gains
            feedback = -2.0 * alpha * velocity_residual_of(system, motion) - beta**2 * position_residual(motion)
            compulsion = replace(compulsion, D=compulsion.D + feedback)
        compulsion = with_contacts(motion, compulsion)
        return compulsion, (applied.driven, applied.loaded, applied.dissipated)

    def check(self, point: Point, last: bool = False):
        """Do nothing: every evaluation was certified."""
