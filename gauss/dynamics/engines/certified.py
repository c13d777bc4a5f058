"""Certified accelerations: the compulsion of every state is minimised by a backend, with a certificate.

The compulsion is assembled by numpy in a millisecond, above a threshold of evaluations by machine code in a microsecond.
"""

from dataclasses import replace

import numpy as np

from gauss.backends import Backend, ready, solve
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution
from gauss.codegen import trace
from gauss.dynamics.assemble import assemble_motion, checked_load, position_residual, units
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.tiering import COMPILE_THRESHOLD
from gauss.dynamics.gap_functions import with_contacts
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.projection import velocity_residual_of
from gauss.dynamics.store import cached_on_disk
from gauss.errors import SceneError, SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, System


class Assembler:
    """Compulsions of one system, assembled by a kernel traced from :func:`gauss.assemble`.

    TypeError if a law cannot be traced.
    SceneError if there are unilateral constraints, which have no fixed rows.

    ``system``: the laws of its loads must be written with :mod:`gauss.math`.
    """

    def __init__(self, system: System):
        if system.contacts.placed or system.set_valued.placed or system.losses:
            raise SceneError(
                "unilateral constraints, set-valued elements and losses have no fixed rows; they are solved state by state."
            )
        self.system = system

        def flat(t, q, v):
            motion = kinematics(system, State(t[0], q, v))
            applied = Applied(motion)
            compulsion = assemble_motion(motion, applied)
            self._shapes = [[block.shape for block in blocks] for blocks in _blocks(compulsion)]
            entries = [block.ravel() for blocks in _blocks(compulsion) for block in blocks]
            power = applied.power
            vectors = compulsion.impressed, compulsion.P, compulsion.C, compulsion.D
            return *vectors, [compulsion.constraint_residual], power, np.concatenate(entries)

        self.kernel = trace(flat, 1, system.n_q, system.n_v, batch=False)
        n_rows = system.structure.n_rows
        self._ends = np.cumsum([system.Phi.size, system.n_v, n_rows, n_rows, 1, 3])

    def __call__(self, state: State, load=None) -> tuple[Compulsion, np.ndarray]:
        """Compulsion in a state, see :func:`gauss.assemble`, and power of drives, of forces on bodies, of dampers [W]."""
        system = self.system
        numbers = self.kernel(np.concatenate([[state.t], state.q, state.v]))
        impressed, P, C, D, (gap,), power, entries = np.split(numbers, self._ends)
        blocks, place = [], 0
        for shapes in self._shapes:
            row = []
            for shape in shapes:
                size = shape[0] * shape[1]
                row.append(entries[place : place + size].reshape(shape))
                place += size
            blocks.append(tuple(row))
        count = len(system.structure.constraints)
        none = np.zeros((0, system.Phi.size + system.n_v))
        A, B = tuple(blocks[:count]), tuple(blocks[count:])
        P = P + checked_load(system, load)
        return Compulsion(
            system.structure, system.Phi, impressed, P, A, B, C, D, none, np.zeros(0), float(gap), units(system)
        ), power


def _blocks(compulsion: Compulsion):
    return *compulsion.A_blocks, *compulsion.B_blocks


class CertifiedEngine(Engine):
    """Accelerations of one system by one backend with a persistent workspace.

    ``backend``: backend, or "auto". ``gains``: Baumgarte gains α and β [1/s] of the feedback −2α ċ − β² c.
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

        SimulationError if the answer of the backend is not certified, with the reason.
        """
        return rates_of(*self.solved(system, state, load, loads))

    def solved(self, system: System, state: State, load=None, loads=None) -> tuple[Solution, np.ndarray]:
        """Certified solution, and power of drives, forces and dampers."""
        compulsion, power = self.assembled(system, state, load, loads)
        return self.answer(compulsion, state.t), power

    def answer(self, compulsion: Compulsion, t: float) -> Solution:
        """Certified solution of a compulsion."""
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

    def assembled(self, system: System, state: State, load, loads) -> tuple[Compulsion, np.ndarray]:
        """Compulsion, and power of drives, forces and dampers; compiled above the threshold of evaluations."""
        may_compile = self.evaluations == COMPILE_THRESHOLD and loads is None and self.gains is None
        may_compile = may_compile and not system.contacts.placed
        if may_compile and not (laws := Laws(system)).called:
            self.assembler = cached_on_disk(system, (Assembler, laws.key), lambda: Assembler(system))
        if self.assembler is not None:
            return self.assembler(state, load)
        motion = kinematics(system, state)
        applied = Applied(motion, loads)
        compulsion = assemble_motion(motion, applied, load)
        if self.gains is not None:
            alpha, beta = self.gains
            feedback = -2.0 * alpha * velocity_residual_of(system, motion) - beta**2 * position_residual(motion)
            compulsion = replace(compulsion, D=compulsion.D + feedback)
        compulsion = with_contacts(motion, compulsion)
        return compulsion, applied.power

    def check(self, point: Point, last: bool = False):
        """Do nothing: every evaluation was certified."""


def rates_of(solution: Solution, power: np.ndarray) -> Rates:
    """Rates by a solution, and the power of the loads; rheonomic constraints do work, as drives do."""
    return Rates(solution.qdd, power - np.array([solution.multipliers @ solution.compulsion.C, 0.0, 0.0]))
