"""A motion in which islands of bodies at rest sleep until they are pushed.

An island are bodies connected by contacts that bear a force. Once all of its bodies have been slow for long enough
(:class:`gauss.simulation.moreau.sleeping.Sleeping`), their velocities are set to zero and their forces are kept; the energy
that this takes is dissipated. A step in which another body pushes one of them is repeated with the island awake.
"""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.asleep_bodies import islands, joined, kinetic_energies, pushed_asleep, split, stepper_of_awake
from gauss.dynamics.contact.compiled_free_body_step import KnownContacts
from gauss.dynamics.contact.contact_changes import ModeChange
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.free_body_step_parts import FreeBodyStep
from gauss.errors import GaussError
from gauss.simulation.moreau.contact_motion import ContactMotion, ContactMotionState
from gauss.simulation.moreau.sleeping import Sleeping
from gauss.simulation.motion_records import Event
from gauss.system import State, System

LOOK_STEPS = 16  # steps between two looks for islands at rest


class _Asleep(NamedTuple):
    """Bodies asleep.

    Attributes
    ----------
    island : ndarray of int, shape (n,)
        Island of each body that sleeps; −1 of those awake.
    stepper : FreeBodyStepper
        Steps of the bodies that are awake.
    resting : KnownContacts
        Contacts of those asleep.
    closed : ndarray of bool
        Elements that have closed contacts among these.
    """

    island: np.ndarray
    stepper: FreeBodyStepper
    resting: KnownContacts
    closed: np.ndarray

    @property
    def which(self) -> np.ndarray:
        """Whether each body (n,) sleeps."""
        return self.island >= 0


class SleepingMotion(ContactMotion):
    """Motion of free bodies that sleep.

    Parameters
    ----------
    system : System
        The system.
    sleeping : Sleeping
        When they are put to rest.
    """

    stepper: FreeBodyStepper  # scenes of other steps are refused

    def __init__(self, system: System, sleeping: Sleeping):
        super().__init__(system)
        self.whole, self.speed, self.duration = self.stepper, sleeping.speed_in(system), sleeping.duration
        self.lever = self.whole.reach + np.linalg.norm(self.whole.given[21:24], axis=0)  # from the joint point

    def begin(self, start: State):
        """Begin at a state, with all bodies awake."""
        n, nothing = self.whole.n, np.zeros(0, dtype=np.int64)
        resting = KnownContacts(nothing, np.zeros((0, 3)), np.zeros((6, 0)))
        self.asleep = _Asleep(np.full(n, -1), self.whole, resting, np.zeros(len(self.whole.elements), dtype=bool))
        self.since, self.counted, self.times_asleep, self.times_woken = np.full(n, start.t), 0, 0, 0
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
            self.steps, self.state = self.steps + ends.size, State(float(ends[-1]), state.q, state.v)
            return np.column_stack([ends, np.tile(np.concatenate([state.q, state.v, self.work]), (ends.size, 1))])
        rows = super().advance(ends)
        v = rows[:, 1 + self.system.n_q :][:, self.whole.v_places]  # (k, 6, n)
        speed = np.linalg.norm(v[:, :3], axis=1) + np.linalg.norm(v[:, 3:], axis=1) * self.lever
        fast = np.flatnonzero((speed > self.speed).any(axis=0))
        last = len(rows) - 1 - np.argmax((speed > self.speed)[::-1], axis=0)
        self.since[fast] = rows[last[fast], 0]
        return rows

    def _put_to_rest(self) -> bool:
        """Put islands to rest in which all bodies have been slow for long enough; returned is whether there are any."""
        which = self.asleep.which
        calm = ~which & (self.state.t - self.since >= self.duration)
        if not calm.any():
            return False
        known = self._known()
        island = islands(self.whole, known)
        restless = np.unique(island[~calm & ~which])
        new = calm & (island >= 0) & ~np.isin(island, restless)
        if not new.any():
            return False
        lost, v = float(kinetic_energies(self.whole, self.state)[new].sum()), self.state.v.copy()
        v[self.whole.v_places[:, new]] = 0.0
        self.state, self.work = State(self.state.t, self.state.q, v), self.work + np.array([0.0, 0.0, lost])
        self._set_asleep(np.where(new, island, self.asleep.island), known)
        self.events.append(Event(self.state.t, "sleeps", self._names(new), lost))
        self.times_asleep += int(new.sum())
        return True

    def _wake(self, bodies: np.ndarray):
        """Wake the islands of some bodies."""
        woken = np.isin(self.asleep.island, self.asleep.island[bodies])
        known, self.since[woken] = self._known(), self.state.t
        self._set_asleep(np.where(woken, -1, self.asleep.island), known)
        self.events.append(Event(self.state.t, "wakes", self._names(woken)))
        self.times_woken += int(woken.sum())

    def _known(self) -> KnownContacts:
        """Contacts of all bodies with their forces."""
        return joined(self.stepper.known, self.asleep.resting, self.asleep.which)

    def _set_asleep(self, island: np.ndarray, known: KnownContacts):
        """Continue with other bodies asleep, from the contacts of all bodies."""
        which, modes = island >= 0, np.maximum(self.stepper.record.modes, self.asleep.closed)
        stepper = stepper_of_awake(self.whole, which, self.state) if which.any() else self.whole
        awake, resting = split(self.whole, known, which)
        closed, moving = (self._closed(part) for part in (resting, awake))
        self.asleep, self.stepper = _Asleep(island, stepper, resting, closed), stepper
        stepper.known = awake
        stepper.record.take(np.where(moving, modes, 0))

    def _closed(self, known: KnownContacts) -> np.ndarray:
        """Whether elements have contacts that bear a force among some."""
        found = np.zeros(self.stepper.record.modes.size, dtype=bool)
        first, second = self.whole.table.pair(known.key[known.force[:, 0] > 0.0])
        found[self.whole.table.law[first, second] - 1] = True
        return found

    def _names(self, which: np.ndarray) -> tuple[str, ...]:
        names = list(self.system.scene.bodies)
        return tuple(names[body] for body in self.whole.child[which])

    def _python_step(self, h: float) -> FreeBodyStep:
        while True:
            known = self.stepper.known
            found = self.stepper.python_step(self.state, h)
            pushed = pushed_asleep(self.stepper, found.contacts, found.force)
            if not pushed.size:
                return found
            self.stepper.known = known
            self._wake(pushed)

    def _note(self, times, changes: list[ModeChange]):
        closed = self.asleep.closed
        if closed.any():  # an element of which contacts rest is closed all the time
            least = closed.astype(int)[[one.element for one in changes]].tolist()
            raised = [
                one._replace(before=max(one.before, k), after=max(one.after, k))
                for one, k in zip(changes, least, strict=True)
            ]
            changes = [one for one in raised if one.before != one.after]
        super()._note(times, changes)

    def kept(self) -> ContactMotionState:
        """What the motion continues from."""
        more = self.asleep, self.since.copy(), self.counted, self.times_asleep, self.times_woken
        return super().kept()._replace(asleep=more)

    def take(self, kept: ContactMotionState):
        """Continue from what was kept."""
        self.asleep, since, self.counted, self.times_asleep, self.times_woken = kept.asleep
        self.since, self.stepper = since.copy(), self.asleep.stepper
        super().take(kept)

    def in_words(self) -> str:
        """How many bodies slept."""
        return (
            f"; {np.count_nonzero(self.asleep.which)} of {self.whole.n} bodies asleep at the end, "
            f"{self.times_asleep} put to rest, {self.times_woken} woken"
        )
