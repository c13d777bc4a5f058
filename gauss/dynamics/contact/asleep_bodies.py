"""Steps of some free bodies while the others sleep: these stand still, as if fixed, and have no contacts among themselves.

A step in which a contact pushes a body asleep is not finished: its island is woken first. Until then the bodies asleep feel
nothing of the others, and what holds them does not change.
"""

from copy import copy

import numpy as np

from gauss.dynamics.contact.compiled_free_body_step import FreeBodyMemory, KnownContacts
from gauss.dynamics.contact.contact_changes import ModeRecord
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.near_detection import NearDetection
from gauss.dynamics.contact.step_parts import FreeBodyStep
from gauss.linked_groups import linked_groups
from gauss.system import State


class BodySleepers:
    """What may sleep of free bodies: each of them.

    Parameters
    ----------
    whole : FreeBodyStepper
        Stepper of all bodies.

    Attributes
    ----------
    rates, bodies, able
        As of :class:`gauss.dynamics.contact.asleep_trees.TreeSleepers`.
    """

    def __init__(self, whole: FreeBodyStepper):
        self.whole, self.count = whole, whole.n
        self.rates, names = list(whole.v_places.T), whole.system.structure.bodies
        self.bodies = [(names[body],) for body in whole.child]
        self.able = np.ones(whole.n, dtype=bool)
        self.lever = whole.reach + np.linalg.norm(whole.given[21:24], axis=0)  # from the joint point

    def known_of_none(self) -> KnownContacts:
        """Forces on nothing."""
        return KnownContacts(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((6, 0)))

    def speeds(self, v: np.ndarray, state: State) -> np.ndarray:
        """Speeds (k, n) of the fastest point of each body, at rates (k, n_v) [m/s]."""
        parts = v[:, self.whole.v_places]  # (k, 6, n)
        return np.linalg.norm(parts[:, :3], axis=1) + np.linalg.norm(parts[:, 3:], axis=1) * self.lever

    def kinetic_energies(self, state: State) -> np.ndarray:
        """Kinetic energy (n,) of each body [J]."""
        n, begun = self.count, self.whole.begin(state, 0.0, 0.0)
        W, u, inertia = begun.both[:n, :3, 0], begun.both[:n, 3:6, 0], begun.mass[:, :9].reshape(-1, 3, 3)
        return 0.5 * ((W[:, None] @ inertia @ W[:, :, None]).ravel() + begun.mass[:, 18] * (u * u).sum(axis=1))

    def islands(self, known: KnownContacts) -> np.ndarray:
        """Number (n,) of the island of each body, by contacts that bear a force; −1 of bodies without one."""
        bodies = self.whole.table.bodies(known.key[known.force[:, 0] > 0.0])
        root = linked_groups(self.count, bodies[(bodies < self.count).all(axis=1)].tolist())
        touched, found = np.unique(bodies[bodies < self.count]), np.full(self.count, -1)
        found[touched] = root[touched]
        return found

    def split(self, known: KnownContacts, asleep: np.ndarray) -> tuple[KnownContacts, KnownContacts]:
        """Contacts of bodies that are awake, and those of bodies asleep, of the known contacts of all."""
        fixed = np.zeros(self.whole.fixed.shape[1], dtype=bool)
        rests = np.append(asleep, fixed)[self.whole.table.bodies(known.key)].any(axis=1)
        return (
            KnownContacts(known.key[~rests], known.force[~rests], known.expected[:, ~asleep]),
            KnownContacts(known.key[rests], known.force[rests], known.expected[:, asleep]),
        )

    def joined(self, awake: KnownContacts, resting: KnownContacts, asleep: np.ndarray) -> KnownContacts:
        """Known contacts of all bodies, from those of :meth:`split`."""
        key = np.concatenate([awake.key, resting.key])
        order, expected = np.argsort(key), np.empty((6, asleep.size))
        expected[:, ~asleep], expected[:, asleep] = awake.expected, resting.expected
        return KnownContacts(key[order], np.concatenate([awake.force, resting.force])[order], expected)

    def stepper(self, asleep: np.ndarray, state: State) -> FreeBodyStepper:
        """Stepper of the bodies that are awake, by the state of all."""
        whole = self.whole
        made, awake = copy(whole), ~asleep
        made.asleep = np.flatnonzero(asleep)
        made.moving = [joint for joint, moves in zip(whole.moving, awake, strict=True) if moves]
        made.child, made.n = whole.child[awake], len(made.moving)
        for name in ("given", "q_places", "v_places", "gravity"):
            setattr(made, name, getattr(whole, name)[:, awake].copy())
        made.reach = whole.reach[awake]
        still = np.zeros((24, made.asleep.size))
        still[:12] = whole.begin(state, 0.0, 0.0).bodies[:12, made.asleep]
        made.fixed = np.concatenate([still, whole.fixed], axis=1)
        column = np.arange(whole.n + whole.fixed.shape[1])
        column[np.flatnonzero(awake)], column[made.asleep] = np.arange(made.n), made.n + np.arange(made.asleep.size)
        made.table = copy(whole.table)
        made.table.body, made.table.law = column[whole.table.body], whole.table.law.copy()
        stands = np.flatnonzero(made.table.body >= made.n)
        made.table.law[np.ix_(stands, stands)] = 0
        made.detection = NearDetection(made.table, column.size, whole.system.scale.length, whole.detection.code)
        made.record, made.graph = ModeRecord(len(made.elements)), None
        made.memory = FreeBodyMemory(made)
        made.forget()
        return made

    def places(self, asleep: np.ndarray) -> np.ndarray:
        """Numbers of the elements of the stepper of those awake among the elements of the scene: all of them."""
        return np.arange(len(self.whole.elements))

    def pushed(self, stepper: FreeBodyStepper, step: FreeBodyStep) -> np.ndarray:
        """Bodies asleep that contacts of a step push, as columns of the stepper of all bodies."""
        pushed = step.contacts.bodies[step.force[:, 0] > 0.0] - stepper.n
        return stepper.asleep[np.unique(pushed[(pushed >= 0) & (pushed < stepper.asleep.size)])]

    def closed(self, known: KnownContacts, asleep: np.ndarray) -> np.ndarray:
        """Whether elements of the scene have contacts that bear a force on the bodies asleep."""
        return self.whole.table.closed(known.key, known.force)

    def reached(self, before: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Bodies that changed inputs act on: none."""
        return np.zeros(0, dtype=np.int64)
