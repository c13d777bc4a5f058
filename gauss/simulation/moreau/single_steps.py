"""Steps of Moreau–Jean time stepping one at a time, from any point that was reached before, with their events."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from gauss.codegen.kernels import Due, LoopStatus
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.gap_laws import removal_time
from gauss.errors import SimulationError
from gauss.simulation.moreau.compiled_run import CompiledMoreauRun
from gauss.simulation.moreau.contact_motion import ContactMotion
from gauss.simulation.moreau.moreau_jean import accepted_overlap
from gauss.simulation.motion_records import Event
from gauss.simulation.problem import Problem
from gauss.system import State


class ReachedPoint(NamedTuple):
    """Point of a motion."""

    row: np.ndarray  # (1 + n_q + n_v + 3,): time [s], coordinates, rates, work [J]
    kept: Any  # what steps continue from beside it
    events: list[Event]  # changes of the contact mode in the step before
    closed: bool  # whether a gap is closed, by its force in the step before


class SingleSteps(Protocol):
    """Steps of one motion."""

    @property
    def shares(self) -> tuple[float, ...]:
        """Candidates of the share of the old rates, see :attr:`MoreauStepper.shares`."""

    @property
    def law_error(self) -> float:
        """Largest residual of the laws of contact and friction so far, relative."""

    @property
    def relaxed(self) -> int:
        """Steps by the convex relaxation of Coulomb's law."""

    @property
    def acceleration_error(self) -> float:
        """Largest relative error of accelerations found by a check."""

    def begun(self, start: State) -> ReachedPoint:
        """Point at a start without penetration."""

    def after(self, begin: ReachedPoint, t: float) -> ReachedPoint:
        """Point after one step to a time [s].

        Raises
        ------
        GaussError
            If the motion cannot continue.
        """

    def with_row(self, reached: ReachedPoint, row: np.ndarray) -> ReachedPoint:
        """The same point with another row."""

    def reverses(self, begin: ReachedPoint, end: ReachedPoint) -> bool:
        """Whether a force of friction or of a set-valued element has changed its direction between two points."""


class CompiledSingleSteps:
    """Steps in machine code of a whole scene.

    Parameters
    ----------
    run : CompiledMoreauRun
        Its run.
    """

    def __init__(self, run: CompiledMoreauRun):
        self.run, self.layout, modes = run, run.layout, run.stepper.modes
        self.point, self.confirmed = np.empty((2, self.layout.size))
        self.grid, self.note = np.array([[0.0, Due.STEP]]), np.empty(1 + modes.codes + len(modes.elements))
        self.steps = run.prepared_steps()
        self.given = run.arrays(self.point, self.confirmed, self.grid, self.note)
        first = self.layout.row + self.layout.n_v + 3
        self.largest, self.law_at = 0.0, first + run.forces + 1
        laws = run.stepper.laws
        self.normal = slice(first, first + laws.normal.size)
        self.across, self.set_valued = first + laws.across, first + laws.set_valued

    @property
    def shares(self) -> tuple[float, ...]:
        """Candidates of the share of the old rates."""
        return self.run.stepper.shares

    @property
    def law_error(self) -> float:
        """Largest residual of the laws of contact and friction so far, relative."""
        return self.largest

    @property
    def relaxed(self) -> int:
        """Steps by the convex relaxation of Coulomb's law."""
        return self.run.relaxed

    @property
    def acceleration_error(self) -> float:
        """Largest relative error of accelerations found by a check."""
        return float(self.run.control.worst)

    def begun(self, start: State) -> ReachedPoint:
        """Point at a start without penetration."""
        self.confirmed[:] = self.run.begun(start)
        return self._reached(self.confirmed.copy(), [])

    def after(self, begin: ReachedPoint, t: float) -> ReachedPoint:
        """Point after one step to a time [s]."""
        (point, modes), control, contacts = begin.kept, self.run.control, self.run.contacts
        self.point[:], self.grid[0, 0], control.notes = point, t, 0.0
        self.steps.call(*self.given, 1)
        status, control.status = LoopStatus(int(control.status)), 0.0
        noted = self.note[1:] if control.notes else None
        if status == LoopStatus.UNSOLVED:
            self.point[:] = self.run.repeated(point, t)
            noted = self.run.python_steps.modes
        elif status != LoopStatus.DONE:
            raise SimulationError(f"t = {t:.6g} s: {status.name.lower().replace('_', ' ')}.")
        contacts.modes = modes.copy()
        events = [] if noted is None else contacts.of([t], noted[None])
        self.largest = max(self.largest, float(self.point[self.law_at]))
        return self._reached(self.point.copy(), events)

    def _reached(self, point: np.ndarray, events: list[Event]) -> ReachedPoint:
        closed = bool(point[self.normal].any())
        return ReachedPoint(point[: self.layout.row], (point, self.run.contacts.modes), events, closed)

    def with_row(self, reached: ReachedPoint, row: np.ndarray) -> ReachedPoint:
        """The same point with another row."""
        point, modes = reached.kept
        moved = np.concatenate([row, point[self.layout.row :]])
        return reached._replace(row=moved[: self.layout.row], kept=(moved, modes))

    def reverses(self, begin: ReachedPoint, end: ReachedPoint) -> bool:
        """Whether a force of friction or of a set-valued element has changed its direction between two points."""
        (before, _), (after, _) = begin.kept, end.kept
        turned = (before[self.across] * after[self.across]).sum(axis=1) < 0.0
        return bool(turned.any() or (before[self.set_valued] * after[self.set_valued] < 0.0).any())


class PairKernelSingleSteps:
    """Steps by kernels of pairs of shapes.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    """

    def __init__(self, problem: Problem):
        system, self.accepted = problem.system, accepted_overlap(problem, controlled=True)
        self.motion = ContactMotion(system, stepper=new_contact_stepper(system, removal=removal_time(system)))

    @property
    def shares(self) -> tuple[float, ...]:
        """Candidates of the share of the old rates."""
        return self.motion.stepper.shares

    @property
    def law_error(self) -> float:
        """Largest residual of the laws of contact and friction so far, relative."""
        return self.motion.largest

    @property
    def relaxed(self) -> int:
        """Steps by the convex relaxation of Coulomb's law."""
        return self.motion.relaxed

    @property
    def acceleration_error(self) -> float:
        """Largest relative error of accelerations found by a check."""
        return self.motion.stepper.acceleration_error

    def begun(self, start: State) -> ReachedPoint:
        """Point at a start without penetration."""
        self.motion.begin(start)
        self.motion.stepper.refuse_penetration(start, self.accepted)
        self.motion.stepper.check(start)
        return ReachedPoint(np.concatenate([[start.t], start.q, start.v, np.zeros(3)]), self.motion.kept(), [], False)

    def after(self, begin: ReachedPoint, t: float) -> ReachedPoint:
        """Point after one step to a time [s]."""
        self.motion.take(begin.kept)
        self.motion.events = []
        row = self.motion.advance(np.array([t]))[0]
        kept = self.motion.kept()
        closed = bool(kept.modes[: self.motion.stepper.first_set_valued].any())
        return ReachedPoint(row, kept, self.motion.events, closed)

    def with_row(self, reached: ReachedPoint, row: np.ndarray) -> ReachedPoint:
        """The same point with another row."""
        end = 1 + self.motion.system.n_q
        state = State(float(row[0]), row[1:end], row[end:-3])
        return reached._replace(row=row, kept=reached.kept._replace(state=state, work=row[-3:]))

    def reverses(self, begin: ReachedPoint, end: ReachedPoint) -> bool:
        """Whether a force of friction or of a set-valued element has changed its direction between two points."""
        before, after = begin.kept.known, end.kept.known
        _, one, other = np.intersect1d(before.key, after.key, assume_unique=True, return_indices=True)
        turned = (before.force[one, 1:] * after.force[other, 1:]).sum(axis=1) < 0.0
        return bool(turned.any() or (self._set_valued(before) * self._set_valued(after) < 0.0).any())

    def _set_valued(self, known) -> np.ndarray:
        """Forces of set-valued elements; free bodies have none."""
        elements = len(self.motion.stepper.elements) - self.motion.stepper.first_set_valued
        return known.others[known.others.size - elements :] if elements else np.zeros(0)
