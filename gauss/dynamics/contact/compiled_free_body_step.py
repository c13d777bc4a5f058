"""Working memory of the compiled step of free bodies: :mod:`gauss.codegen.kernels.free_body_step`."""

from functools import cache
from typing import NamedTuple

import numpy as np

from gauss.codegen import from_disk
from gauss.codegen.kernels import CompiledFreeBodyStep, FreeBodyFunctions
from gauss.codegen.kernels.contact_islands import ISLANDS
from gauss.codegen.kernels.free_body_poses import FREE_BODIES, SETTINGS
from gauss.dynamics.contact.compiled_step_memory import CompiledStepMemory
from gauss.dynamics.contact.free_bodies import CONSTANTS, begin_function, end_function, place_function
from gauss.dynamics.contact.gap_laws import REST_STEPS, gap_prediction, laws_of_gaps
from gauss.dynamics.contact.near_detection import FIRST_ROOM
from gauss.dynamics.contact.paradox import SLIDING as SLIDING_SPEED
from gauss.dynamics.contact.shape_table import MOST_FEATURES
from gauss.dynamics.gap_functions import RESTING

FIRST_BLOCKS = 6  # blocks of the matrix of the contact problem for which there is room at first, for each body


class KnownContacts(NamedTuple):
    """Forces of the last step."""

    key: np.ndarray  # (m,) contacts, in order
    force: np.ndarray  # (m, 3) their forces [N]
    # (6, n) mean accelerations of the bodies by these, expected in the next step as well; zero after an impact
    expected: np.ndarray


class FreeBodyMemory(CompiledStepMemory):
    """Compiled steps of free bodies, with their working memory.

    Parameters
    ----------
    laws : BlockContactLaws
        Laws of contact and friction.
    constants : dict
        Settings of a step by name.
    capacity, blocks : int
        Contacts, and blocks of the matrix of the contact problem, for which there is room.
    """

    def __init__(self, stepper, laws, constants: dict[str, float], capacity: int, blocks: int):
        self.stepper, self.laws, self.constants = stepper, laws, constants
        self.detection, self.record = stepper.detection, stepper.record
        system, table, n = stepper.system, stepper.table, stepper.n
        sizes = {
            "n_q": system.n_q,
            "n_v": system.n_v,
            "n": n,
            "bodies": n + stepper.fixed.shape[1],
            "parts": len(table.parts),
            "pairs": len(self.detection.pair),
            "capacity": capacity,
            "blocks": blocks,
            "laws": len(table.contacts),
            "constants": CONSTANTS,
            "sleepers": stepper.asleep.size,
        }
        super().__init__(compiled_free_body_step(laws), FREE_BODIES, sizes, {})
        at = self.at
        at["constants"][:], at["gravity"][:] = stepper.given.T.ravel(), system.scene.gravity
        at["reach"][:] = stepper.reach
        at["bodies"].reshape(24, -1)[:, n:] = stepper.fixed
        at["friction"][:-1], at["restitution"][:-1] = table.friction, table.restitution
        one, two, islands = ("known_count", "status", "needed"), ("known_found", "touching", "ordered", "within"), n + 1
        lengths = dict.fromkeys(one, 1) | dict.fromkeys(two, 2 * capacity) | dict.fromkeys(ISLANDS, islands)
        lengths |= {"slot": n * n, "list": n * n + islands, "order": n, "degree": n, "start": n + islands}
        lengths |= {"contact_place": capacity, "ordered_count": 2}
        self.integers = {name: np.zeros(length, dtype=np.int64) for name, length in lengths.items()}
        self.integers["q_start"], self.integers["v_start"] = stepper.q_places[0].copy(), stepper.v_places[0].copy()
        self.integers["ordered_count"][0] = -1
        length, share = system.scale.length, stepper.shares[0]
        self.set_first(system, length * RESTING, length * SLIDING_SPEED, share, SETTINGS, constants)

    def fitting(self) -> "FreeBodyMemory":
        """Return the memory, or a larger one if contacts or blocks lack room."""
        capacity, needed = len(self.detection.rows), int(self.integers["needed"][0])
        if capacity == self.sizes["capacity"] and needed <= self.sizes["blocks"]:
            return self
        blocks = max(self.sizes["blocks"], 2 * needed if needed > self.sizes["blocks"] else 0)
        larger = FreeBodyMemory(self.stepper, self.laws, self.constants, capacity, blocks)
        larger.known = self.known
        return larger

    @property
    def islands(self) -> int:
        """Number of groups of bodies that touch each other, in the last step by machine code."""
        return int(self.integers["ordered_count"][1])

    @property
    def known(self) -> KnownContacts:
        """Forces of the last step."""
        m = int(self.integers["known_count"][0])
        pair, feature = self.integers["known_found"][: 2 * m].reshape(m, 2).T
        key = pair * MOST_FEATURES + feature
        order = np.argsort(key)
        force, expected = self.at["known"][: 3 * m].reshape(m, 3)[order], self.at["expected"].reshape(-1, 6).T.copy()
        return KnownContacts(key[order], force, expected)

    @known.setter
    def known(self, found: KnownContacts):
        key, force, expected = found
        m = key.size
        self.integers["known_found"][: 2 * m] = np.column_stack(np.divmod(key, MOST_FEATURES)).ravel()
        self.integers["known_count"][0] = m
        self.at["known"][: 3 * m] = force.ravel()
        self.at["expected"][:] = expected.T.ravel()


def first_memory(stepper, laws, constants: dict[str, float]) -> FreeBodyMemory:
    """Memory of a new stepper."""
    return FreeBodyMemory(stepper, laws, constants, FIRST_ROOM, FIRST_BLOCKS * (stepper.n + 1))


@cache
def compiled_free_body_step(laws) -> CompiledFreeBodyStep:
    """Machine code, made once on a machine."""

    def make() -> CompiledFreeBodyStep:
        functions = place_function(), begin_function(), end_function(), laws, *laws_of_gaps(), gap_prediction(), REST_STEPS
        return CompiledFreeBodyStep(FreeBodyFunctions(*functions))

    return from_disk((CompiledFreeBodyStep, laws.rounds, laws.redundant_rounds, laws.least_contacts), make)
