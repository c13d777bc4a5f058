"""Steps of some free bodies while the others sleep: these stand still, as if fixed, and have no contacts among themselves.

A step in which a contact pushes a body asleep is not finished: its island is woken first. Until then the bodies asleep feel
nothing of the others, and what holds them does not change.
"""

from copy import copy

import numpy as np

from gauss.dynamics.contact.compiled_free_body_step import KnownContacts, first_memory
from gauss.dynamics.contact.contact_changes import ModeRecord
from gauss.dynamics.contact.free_body_step import FreeBodyStepper, block_contact_laws
from gauss.dynamics.contact.near_contacts import NearContacts
from gauss.dynamics.contact.near_detection import NearDetection
from gauss.system import State


def stepper_of_awake(whole: FreeBodyStepper, asleep: np.ndarray, state: State) -> FreeBodyStepper:
    """Stepper of the bodies that are awake.

    Parameters
    ----------
    asleep : ndarray of bool, shape (n,)
        Bodies that sleep.
    """
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
    made.memory = first_memory(made, block_contact_laws(), made.settings)
    made.forget()
    return made


def pushed_asleep(stepper: FreeBodyStepper, near: NearContacts, force: np.ndarray) -> np.ndarray:
    """Bodies asleep that forces (m, 3) of near contacts push, as columns of the stepper of all bodies."""
    pushed = near.bodies[force[:, 0] > 0.0] - stepper.n
    return stepper.asleep[np.unique(pushed[(pushed >= 0) & (pushed < stepper.asleep.size)])]


def bodies_of(whole: FreeBodyStepper, key: np.ndarray) -> np.ndarray:
    """Columns (m, 2) of the bodies of contacts by their keys."""
    return whole.table.body[np.column_stack(whole.table.pair(key))].reshape(-1, 2)


def islands(whole: FreeBodyStepper, known: KnownContacts) -> np.ndarray:
    """Number (n,) of the island of each body, by contacts that bear a force; −1 of bodies without one."""
    bodies = bodies_of(whole, known.key[known.force[:, 0] > 0.0])
    parent = list(range(whole.n))

    def root(body: int) -> int:
        while parent[body] != body:
            parent[body] = parent[parent[body]]
            body = parent[body]
        return body

    for one, other in bodies[(bodies < whole.n).all(axis=1)].tolist():
        parent[root(other)] = root(one)
    found = np.full(whole.n, -1)
    for body in np.unique(bodies[bodies < whole.n]).tolist():
        found[body] = root(body)
    return found


def split(whole: FreeBodyStepper, known: KnownContacts, asleep: np.ndarray) -> tuple[KnownContacts, KnownContacts]:
    """Contacts of bodies that are awake, and those of bodies asleep, of the known contacts of all."""
    rests = np.append(asleep, np.zeros(whole.fixed.shape[1], dtype=bool))[bodies_of(whole, known.key)].any(axis=1)
    return (
        KnownContacts(known.key[~rests], known.force[~rests], known.expected[:, ~asleep]),
        KnownContacts(known.key[rests], known.force[rests], known.expected[:, asleep]),
    )


def joined(awake: KnownContacts, resting: KnownContacts, asleep: np.ndarray) -> KnownContacts:
    """Known contacts of all bodies, from those of :func:`split`."""
    key = np.concatenate([awake.key, resting.key])
    order, expected = np.argsort(key), np.empty((6, asleep.size))
    expected[:, ~asleep], expected[:, asleep] = awake.expected, resting.expected
    return KnownContacts(key[order], np.concatenate([awake.force, resting.force])[order], expected)


def kinetic_energies(whole: FreeBodyStepper, state: State) -> np.ndarray:
    """Kinetic energy (n,) of each body [J]."""
    begun = whole.begin(state, 0.0, 0.0)
    spin, pull, inertia = begun.both[: whole.n, :3, 0], begun.both[: whole.n, 3:6, 0], begun.mass[:, :9].reshape(-1, 3, 3)
    return 0.5 * ((spin[:, None] @ inertia @ spin[:, :, None]).ravel() + begun.mass[:, 18] * (pull * pull).sum(axis=1))
