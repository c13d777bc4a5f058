"""Working memory of the compiled step of free bodies, and the rounds of Newton steps in which its contact problem is solved.

The step is :mod:`gauss.codegen.kernels.free_body_step`. Newton steps with hardly any regularisation nearly always converge.
In heaps contacts cycle between sticking, slipping and open: all contacts are regularised, or those alone that cycle. Where
contacts that stick bear more components of force than the bodies have freedoms, forces are not unique, and the search ends
at residuals that more steps hardly lessen.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from gauss.codegen import from_disk
from gauss.codegen.kernels import BlockContactLaws, CompiledFreeBodyStep, FreeBodyFunctions, Round
from gauss.codegen.kernels.contact_islands import ISLANDS
from gauss.codegen.kernels.free_body_poses import FREE_BODIES, SETTINGS
from gauss.dynamics.contact.compiled_step_memory import CompiledStepMemory
from gauss.dynamics.contact.contact_step import contact_solver
from gauss.dynamics.contact.free_bodies import CONSTANTS, begin_function, end_function, place_function
from gauss.dynamics.contact.gap_laws import REST_STEPS, gap_prediction, laws_of_gaps
from gauss.dynamics.contact.near_detection import FIRST_ROOM
from gauss.dynamics.contact.paradox import SLIDING as SLIDING_SPEED
from gauss.dynamics.contact.shape_table import MOST_FEATURES
from gauss.dynamics.gap_functions import RESTING

FIRST_BLOCKS = 6  # blocks of the matrix of the contact problem for which there is room at first, for each body
ROUNDS = (
    Round(0, 1e-7, 12),
    Round(0, 1e-2, 30),
    Round(0, 1e-4, 10),
    Round(0, 1e-7, 10),
    Round(30, 1e-3, 30),
    Round(0, 1e-7, 10),
    Round(100, 1e-2, 30),
    Round(0, 1e-5, 10),
    # Redundant contacts between which forces move far at small residuals: much regularisation stands still, little cycles.
    Round(0, 1e-5, 30),
    Round(0, 3e-6, 40),
    Round(0, 1e-3, 20),
    Round(0, 1e-5, 30),
)
# What is left cycles beside contacts that converge: the regularisation stays where contacts change their modes. Of 3000
# steps of three bins of 30 balls, 33 miss the tolerance of the laws instead of 130, by 8e-7 at most instead of 1e-4.
LAST_ROUNDS = (
    Round(0, 3e-2, 28, decay=0.8),
    Round(0, 1e-7, 10),
    Round(100, 3e-2, 40, decay=0.8),
    Round(0, 1e-7, 10),
    Round(300, 1e-1, 40, decay=0.7),
    Round(0, 1e-7, 12),
)
LEAST_CONTACTS = 100  # of problems whose redundant contacts have rounds of their own: of fewer, all rounds cost little
# Residuals in units of their tolerance. Those below CLOSE are worth Newton steps with hardly any regularisation; those from
# CLOSE to FINE are left in heaps that come to rest, where contacts stick but for some that slip by micrometres per second:
# in a bin of 100 balls, 200 Newton steps more lessened them by half at most.
CLOSE, FINE = 1e3, 1e5
REDUNDANT_ROUNDS = (
    Round(0, 1e-7, 12),
    Round(0, 3e-2, 28, decay=0.8),
    Round(0, 1e-2, 20, decay=0.6),
    Round(0, 1e-5, 10, below=CLOSE),
    Round(0, 1e-7, 10, below=CLOSE),
    Round(0, 1e-5, 30, below=0.1 * CLOSE),
    Round(0, 3e-6, 40, below=0.1 * CLOSE),
    *(each._replace(above=FINE) for each in ROUNDS[1:]),
)


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
    stepper : FreeBodyStepper
        The stepper, with its settings of a step by name.
    capacity, blocks : int, optional
        Contacts, and blocks of the matrix of the contact problem, with room; by default those of a new stepper.
    """

    def __init__(self, stepper, capacity: int = FIRST_ROOM, blocks: int | None = None):
        self.stepper = stepper
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
            "blocks": FIRST_BLOCKS * (n + 1) if blocks is None else blocks,
            "laws": len(table.contacts),
            "constants": CONSTANTS,
            "sleepers": stepper.asleep.size,
        }
        super().__init__(compiled_free_body_step(), FREE_BODIES, sizes, {})
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
        self.set_first(system, length * RESTING, length * SLIDING_SPEED, share, SETTINGS, stepper.settings)

    def fitting(self) -> "FreeBodyMemory":
        """Return the memory, or a larger one if contacts or blocks lack room."""
        capacity, needed = len(self.detection.rows), int(self.integers["needed"][0])
        if capacity == self.sizes["capacity"] and needed <= self.sizes["blocks"]:
            return self
        blocks = max(self.sizes["blocks"], 2 * needed if needed > self.sizes["blocks"] else 0)
        larger = FreeBodyMemory(self.stepper, capacity, blocks)
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


@cache
def compiled_free_body_step() -> CompiledFreeBodyStep:
    """Machine code, made once on a machine."""
    rounds = ROUNDS + LAST_ROUNDS, REDUNDANT_ROUNDS, LEAST_CONTACTS

    def make() -> CompiledFreeBodyStep:
        solver = contact_solver()
        laws = BlockContactLaws(solver.normal, solver.friction, solver.project_normal, solver.project_friction, *rounds)
        functions = place_function(), begin_function(), end_function(), laws, *laws_of_gaps(), gap_prediction(), REST_STEPS
        return CompiledFreeBodyStep(FreeBodyFunctions(*functions))

    return from_disk((CompiledFreeBodyStep, *rounds), make)
