"""Steps of Moreau–Jean time stepping one at a time, from any point that was reached before, with their events."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from gauss.codegen.kernels import Due, LoopStatus
from gauss.errors import SimulationError
from gauss.simulation.moreau.compiled_run import CompiledMoreauRun
from gauss.simulation.moreau.contact_motion import ContactMotion
from gauss.simulation.trajectory import Event
from gauss.system import State, System


class ReachedPoint(NamedTuple):
    """Point of a motion.

    Attributes
    ----------
    row : ndarray, shape (1 + n_q + n_v + 3,)
        Time [s], coordinates, rates, work [J].
    kept : object
        What steps continue from beside it.
    events : list of Event
        Changes of the contact mode in the step before.
    closed : bool
        Whether a gap is closed, by its force in the step before.
    """

    row: np.ndarray
    kept: Any
    events: list[Event]
    closed: bool


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
        self.normal = slice(first, first + run.stepper.laws.normal.size)

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
        return self.run.python_steps.relaxed if "python_steps" in vars(self.run) else 0

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


class PairKernelSingleSteps:
    """Steps by kernels of pairs of shapes.

    Parameters
    ----------
    system : System
        The system.
    """

    def __init__(self, system: System):
        self.motion = ContactMotion(system, own=True)

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
        self.motion.stepper.refuse_penetration(start)
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
