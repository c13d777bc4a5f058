"""A motion in which islands of bodies at rest sleep until they are pushed.

An island are bodies connected by contacts that bear a force; joints, loads and constraints connect bodies, too. Once all of
its bodies have been slow for long enough (:class:`gauss.simulation.moreau.sleeping.Sleeping`), their velocities are set to
zero and their forces are kept; the energy that this takes is dissipated. A step in which another body pushes one of them is
repeated with the island awake; a changed input wakes the islands that it acts on.
"""

from typing import Any, NamedTuple

import numpy as np

from gauss.dynamics.contact.asleep_bodies import BodySleepers
from gauss.dynamics.contact.asleep_trees import TreeSleepers
from gauss.dynamics.contact.contact_changes import ModeChange, RecordedChanges
from gauss.dynamics.contact.contact_stepper import Stepper
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.contact.step_parts import FreeBodyStep, MechanismStep
from gauss.errors import GaussError
from gauss.simulation.moreau.contact_motion import ContactMotion, ContactMotionState
from gauss.simulation.moreau.sleeping import Sleeping
from gauss.simulation.motion_records import Event, SleepRecord
from gauss.system import State, System

LOOK_STEPS = 16  # steps between two looks for islands at rest


class _Asleep(NamedTuple):
    """Bodies, or trees of joints, asleep."""

    island: np.ndarray  # (n,): island of each that sleeps; −1 of those awake
    stepper: FreeBodyStepper | MechanismStepper  # steps of those that are awake
    resting: Any  # forces on those asleep
    closed: np.ndarray  # elements that bear a force on these
    places: np.ndarray  # elements of the stepper among those of the scene

    @property
    def which(self) -> np.ndarray:
        """Whether each (n,) sleeps."""
        return self.island >= 0


class SleepingMotion(ContactMotion):
    """Motion of bodies that sleep.

    Parameters
    ----------
    system : System
        The system.
    sleeping : Sleeping
        When they are put to rest.
    held : bool
        Whether the inputs of the scene are held in each step.
    stepper : FreeBodyStepper or MechanismStepper
        Steps of this motion alone.
    """

    def __init__(self, system: System, sleeping: Sleeping, held: bool, stepper: Stepper):
        super().__init__(system, held, stepper)
        self.whole, self.speed, self.duration = stepper, sleeping.speed_in(system), sleeping.duration
        self.sleepers: Any = TreeSleepers(stepper) if isinstance(stepper, MechanismStepper) else BodySleepers(stepper)

    def begin(self, start: State):
        """Begin at a state, with all bodies awake."""
        n, elements = self.sleepers.count, len(self.whole.elements)
        nothing = self.sleepers.known_of_none(), np.zeros(elements, dtype=bool), np.arange(elements)
        self.asleep = _Asleep(np.full(n, -1), self.whole, *nothing)
        self.since, self.counted, self.times_woken = np.full(n, start.t), 0, 0
        self.first: dict[str, int] = {}
        self.stepper = self.whole
        super().begin(start)

    def advance(self, ends: np.ndarray) -> np.ndarray:
        """Make steps to some times [s], as of :meth:`ContactMotion.advance`."""
        rows, done = np.empty((ends.size, self.row)), 0
        while done < ends.size:
            count = min(ends.size - done, LOOK_STEPS - self.counted % LOOK_STEPS)
            try:
                found = self._part(ends[done : done + count])
            except GaussError:
                if not done:
                    raise
                return rows[:done]
            rows[done : done + len(found)] = found
            done, self.counted = done + len(found), self.counted + len(found)
            if len(found) < count:
                return rows[:done]
            if not self.counted % LOOK_STEPS and self._put_to_rest():
                rows[done - 1, 1 + self.system.n_q :] = np.concatenate([self.state.v, self.work])
        return rows

    def _part(self, ends: np.ndarray) -> np.ndarray:
        """Steps between two looks."""
        if self.asleep.which.all():
            state = self.state
            self.steps += ends.size
            self.continue_from(State(float(ends[-1]), state.q, state.v), self.work)
            return np.column_stack([ends, np.tile(np.concatenate([state.q, state.v, self.work]), (ends.size, 1))])
        rows = super().advance(ends)
        is_fast = self.sleepers.speeds(rows[:, 1 + self.system.n_q : -3], self.state) > self.speed
        fast = np.flatnonzero(is_fast.any(axis=0))
        last = len(rows) - 1 - np.argmax(is_fast[::-1], axis=0)
        self.since[fast] = rows[last[fast], 0]
        return rows

    def _put_to_rest(self) -> bool:
        """Put islands to rest in which all bodies have been slow for long enough; returned is whether there are any."""
        which = self.asleep.which
        calm = ~which & self.sleepers.able & (self.state.t - self.since >= self.duration)
        if not calm.any():
            return False
        known = self._known()
        island = self.sleepers.islands(known)
        restless = np.unique(island[~calm & ~which])
        new = calm & (island >= 0) & ~np.isin(island, restless)
        if not new.any():
            return False
        lost, v = float(self.sleepers.kinetic_energies(self.state)[new].sum()), self.state.v.copy()
        for k in np.flatnonzero(new):
            v[self.sleepers.rates[k]] = 0.0
        self.continue_from(State(self.state.t, self.state.q, v), self.work + np.array([0.0, 0.0, lost]))
        self._set_asleep(np.where(new, island, self.asleep.island), known)
        names = self._names(new)
        self.events.append(Event(self.state.t, "sleeps", names, lost))
        self.first = dict.fromkeys(names, self.counted) | self.first
        return True

    def _wake(self, pushed: np.ndarray):
        """Wake the islands of some bodies or trees asleep."""
        woken = np.isin(self.asleep.island, self.asleep.island[pushed])
        known, self.since[woken] = self._known(), self.state.t
        self._set_asleep(np.where(woken, -1, self.asleep.island), known)
        names = self._names(woken)
        self.events.append(Event(self.state.t, "wakes", names))
        self.times_woken += len(names)

    def _known(self):
        """Forces on all bodies."""
        return self.sleepers.joined(self.stepper.known, self.asleep.resting, self.asleep.which)

    def _set_asleep(self, island: np.ndarray, known):
        """Continue with others asleep, from the forces on all bodies."""
        which, sleepers, modes = island >= 0, self.sleepers, self.asleep.closed.astype(np.int64)
        before = self.asleep.places
        modes[before] = np.maximum(modes[before], self.stepper.record.modes[: before.size])
        stepper = sleepers.stepper(which, self.state) if which.any() else self.whole
        awake, resting = sleepers.split(known, which)
        closed, moving = sleepers.closed(resting, which), sleepers.closed(awake, ~which)
        places = sleepers.places(which)
        self.asleep, self.stepper = _Asleep(island, stepper, resting, closed, places), stepper
        stepper.known = awake
        kept = np.zeros(stepper.record.modes.size, dtype=np.int64)
        kept[: places.size] = np.where(moving, modes, 0)[places]
        stepper.record.take(kept)

    def _names(self, which: np.ndarray) -> tuple[str, ...]:
        """Names of the bodies of some, in the order of the scene."""
        names = {name for k in np.flatnonzero(which) for name in self.sleepers.bodies[k]}
        return tuple(name for name in self.system.scene.bodies if name in names)

    def hold(self, inputs: np.ndarray):
        """Set the inputs of the next steps; those that change wake the islands that they act on."""
        before, is_first = self.stepper.inputs.copy(), self.state.t == self.start
        super().hold(inputs)
        reached = self.sleepers.reached(before, self.stepper.inputs)
        if is_first:
            return
        self.since[reached] = self.state.t
        asleep = reached[self.asleep.which[reached]]
        if asleep.size:
            self._wake(asleep)

    def jump(self, state: State, work: np.ndarray):
        """Continue after a jump of prescribed velocities; it wakes the islands that it moves."""
        moved = np.array([bool(state.v[rates].any()) for rates in self.sleepers.rates])
        super().jump(state, work)
        if (moved & self.asleep.which).any():
            self._wake(np.flatnonzero(moved & self.asleep.which))

    def _python_step(self, h: float) -> FreeBodyStep | MechanismStep:
        while True:
            known = self.stepper.known
            found = self.stepper.python_step(self.state, h)
            pushed = self.sleepers.pushed(self.stepper, found)
            if not pushed.size:
                return found
            self.stepper.known = known
            self._wake(pushed)

    def _note(self, times: list[float], changes: RecordedChanges | list[ModeChange]):
        closed = self.asleep.closed
        if closed.any():  # an element of which contacts rest is closed all the time
            least = closed.astype(int)[self.asleep.places[[one.element for one in changes]]].tolist()
            raised = [
                one._replace(before=max(one.before, k), after=max(one.after, k))
                for one, k in zip(changes, least, strict=True)
            ]
            changes = [one for one in raised if one.before != one.after]
        super()._note(times, changes)

    def kept(self) -> ContactMotionState:
        """What the motion continues from."""
        more = self.asleep, self.since.copy(), self.counted, self.first, self.times_woken
        return super().kept()._replace(asleep=more)

    def take(self, kept: ContactMotionState):
        """Continue from what was kept."""
        self.asleep, since, self.counted, self.first, self.times_woken = kept.asleep
        self.since, self.stepper = since.copy(), self.asleep.stepper
        super().take(kept)

    def slept(self) -> SleepRecord:
        """Which bodies may sleep, and slept."""
        able = self.sleepers.able
        return SleepRecord(
            self._names(able), self._names(~able), dict(self.first), self._names(self.asleep.which), self.times_woken
        )
