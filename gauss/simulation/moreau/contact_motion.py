"""A motion by kernels of pairs of shapes, advanced from time to time: by machine code, and by Python where that stops."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from gauss.codegen.kernels.step_memory import CHANGES_ROOM
from gauss.dynamics.contact.contact_changes import ModeChange, RecordedChanges
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.contact.step_parts import FreeBodyStep, MechanismStep
from gauss.errors import GaussError
from gauss.simulation.moreau.contact_events import event_of
from gauss.simulation.moreau.contact_warnings import ParadoxWarnings
from gauss.simulation.motion_records import Event, SleepRecord
from gauss.system import State, System


class ContactMotionState(NamedTuple):
    """What a motion continues from."""

    state: State  # the state
    work: np.ndarray  # (3,): work of drives and of forces on bodies, energy lost, since the start [J]
    known: Any  # forces of the last step
    modes: np.ndarray  # modes of the contacts and set-valued elements after it
    asleep: Any = None  # bodies asleep, in motions that know any


class ContactMotion:
    """State of a motion, its work, its events, and the record of its steps.

    Parameters
    ----------
    system : System
        The system.
    held : bool
        Whether the inputs of the scene are held in each step; otherwise they are zero.
    stepper : FreeBodyStepper or MechanismStepper, optional
        Steps of this motion alone, where others may interrupt it.

    Attributes
    ----------
    stepper : FreeBodyStepper or MechanismStepper
        Steps of the system.
    steps, relaxed : int
        Steps, and those of the convex relaxation of Coulomb's law.
    largest : float
        Largest error of the laws of contact, relative.
    state : State
        The state.
    work : ndarray, shape (3,)
        Work of drives and of forces on bodies, energy lost, since the start [J].
    events : list of Event
        Changes of the contact mode.
    """

    stepper: FreeBodyStepper | MechanismStepper
    _noted: list[tuple[list[float], RecordedChanges | list[ModeChange], FreeBodyStepper | MechanismStepper]]

    def __init__(self, system: System, held: bool = False, stepper: FreeBodyStepper | MechanismStepper | None = None):
        self.system, self.stepper = system, stepper or new_contact_stepper(system, held)
        self.n_q, self.row = system.n_q, 4 + system.n_q + system.n_v
        self.paradoxes, self.warned = ParadoxWarnings(), set[bytes]()

    def begin(self, start: State):
        """Begin at a state."""
        self.stepper.forget()
        self.continue_from(start, np.zeros(3))
        self.start, self.steps, self.relaxed, self.largest = start.t, 0, 0, 0.0
        self.events = []

    @property
    def state(self) -> State:
        """The state, made when asked for."""
        return self._state_of(self.reached)

    @property
    def work(self) -> np.ndarray:
        """Work (3,) of drives and of forces on bodies, energy lost, since the start [J]."""
        return self.reached[-3:]

    def continue_from(self, state: State, work: np.ndarray):
        """Be at another state, with another work."""
        self.reached = np.concatenate([[state.t], state.q, state.v, work])

    @property
    def events(self) -> list[Event]:
        """Changes of the contact mode; those noted since they were last asked for become events here."""
        noted, self._noted = self._noted, []
        for times, changes, stepper in noted:
            self._events += self._made(times, changes, stepper.elements, stepper.first_set_valued)
        return self._events

    @events.setter
    def events(self, events: list[Event]):
        self._events, self._noted = events, []

    def hold(self, inputs: np.ndarray):
        """Set the inputs of the next steps."""
        self.stepper.inputs[:] = inputs

    def jump(self, state: State, work: np.ndarray):
        """Continue from a state after a jump of prescribed velocities, with its work."""
        self.continue_from(state, work)

    def advance(self, ends: np.ndarray) -> np.ndarray:
        """Make steps to some times [s], and return (t, q, v, work) at these, (k, row).

        Raises
        ------
        GaussError
            If the first step fails. If another one fails, the rows end before it.
        """
        return self.filled(np.ascontiguousarray(ends), np.empty((ends.size, self.row)))  # machine code reads them

    def filled(self, ends: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Rows of :meth:`advance`, written into an array; both arrays are contiguous."""
        done = 0
        while done < ends.size:
            count, goes_on = self._by_machine_code(*((ends[done:], rows[done:]) if done else (ends, rows)))
            done += count
            if done == ends.size or goes_on:
                continue
            try:
                rows[done] = self._by_python(float(ends[done]))
            except GaussError:
                if not done:
                    raise
                return rows[:done]
            done += 1
        return rows

    def _by_machine_code(self, ends: np.ndarray, rows: np.ndarray) -> tuple[int, bool]:
        """Number of steps that machine code finishes, and whether it may continue."""
        begin = self.reached
        loop = self.stepper.steps_from(begin, ends, rows)
        if not loop.steps:
            return 0, False
        if loop.changes:
            self._note([float(begin[0]), *ends.tolist()], loop.changes)
        self.steps, self.largest = self.steps + loop.steps, max(self.largest, loop.largest)
        if loop.doubtful:
            before = begin if loop.steps == 1 else rows[loop.steps - 2]
            self._examine(self._state_of(before), float(ends[loop.steps - 1]))
        self.reached = rows[loop.steps - 1].copy()
        return loop.steps, loop.doubtful or len(loop.changes) >= CHANGES_ROOM

    def _examine(self, before: State, t: float):
        """Warn of Painlevé's paradoxes of a step, unless the same contacts were warned of."""
        key = self.stepper.record.modes.tobytes()
        if key not in self.warned:
            found = self.stepper.examined(before, t - before.t)
            self.paradoxes.warn(found, before.t)
            self.warned |= {key} if found else set()

    def _state_of(self, row: np.ndarray) -> State:
        end = 1 + self.n_q
        return State(float(row[0]), row[1:end], row[end:-3])

    def _by_python(self, t: float) -> np.ndarray:
        begin, h = self.state, t - self.state.t
        found = self._python_step(h)
        self.steps += 1
        self.largest, self.relaxed = max(self.largest, found.error or 0.0), self.relaxed + (found.error is None)
        self.paradoxes.warn(found.paradoxes, begin.t)
        if found.modes is not None:
            self._note([begin.t, t], self.stepper.record.update(found.modes))
        self.continue_from(self.stepper.projected(State(t, found.q, found.v)), self.work + h * found.power)
        return self.reached.copy()

    def _python_step(self, h: float) -> FreeBodyStep | MechanismStep:
        return self.stepper.python_step(self.state, h)

    def _note(self, times: list[float], changes: RecordedChanges | list[ModeChange]):
        """Keep changes of the contact mode in steps between some times, until the events are asked for."""
        self._noted.append((times, changes, self.stepper))

    def _made(self, times: list[float], changes: Iterable[ModeChange], names: list[str], first: int) -> Iterator[Event]:
        """Events of changes, each at the end of its step; elements that begin closed make none."""
        for change in changes:
            begins = not change.before and (change.element >= first or times[change.step] == self.start)
            event = event_of(change, names[change.element], float(times[change.step + 1]), begins)
            if event is not None:
                yield event

    def slept(self) -> SleepRecord | None:
        """Which bodies slept; None in motions without sleeping."""
        return None

    def beside(self, begin: ContactMotionState, t: float) -> tuple[State, np.ndarray]:
        """State and work at a time after a shorter step from what was kept; the motion does not continue from there."""
        now, events, counts = self.kept(), self.events, (self.steps, self.relaxed, self.largest)
        self.take(begin)
        self.events = []
        try:
            self.advance(np.array([t]))
            return self.state, self.work
        finally:
            self.take(now)
            self.events, (self.steps, self.relaxed, self.largest) = events, counts

    def kept(self) -> ContactMotionState:
        """What the motion continues from."""
        return ContactMotionState(self.state, self.work, self.stepper.known, self.stepper.record.kept())

    def take(self, kept: ContactMotionState):
        """Continue from what was kept."""
        state, work, self.stepper.known, modes, _ = kept
        self.continue_from(state, work)
        self.stepper.record.take(modes)
