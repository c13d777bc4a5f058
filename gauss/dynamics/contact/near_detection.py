"""Contacts that are near at one instant: near pairs of shapes, near pairs of their features, rows of the contact problem.

They are found by one call of machine code, :mod:`gauss.codegen.kernels.near_pairs` on a table of shapes.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from gauss.codegen import from_disk
from gauss.codegen.kernels import NearPairs
from gauss.codegen.kernels.broad_phase import grid_room
from gauss.codegen.kernels.near_pairs import FEATURE, KIND, MOST, MOVED, NEAR_INTEGERS, NEAR_NUMBERS, PART, ROW, near_code
from gauss.codegen.kernels.near_pairs import KINDS as MOST_KINDS
from gauss.codegen.kernels.patch_rows import POINT
from gauss.dynamics.contact.free_bodies import place_function
from gauss.dynamics.contact.hull_records import shape_records
from gauss.dynamics.contact.overlaps import START_OVERLAP
from gauss.dynamics.contact.pair_kernels import CYCLIC, POSE, SIGNS, SIZES, PairKernels, pair_kernels
from gauss.dynamics.contact.patch_kernels import PatchKernels
from gauss.dynamics.contact.shape_table import KINDS, MOST_FEATURES, ShapeTable
from gauss.errors import SimulationError
from gauss.scene import Collider, HalfSpace
from gauss.scene.contact_pairs import RULES
from gauss.scene.contact_patch import SLOTS
from gauss.scene.patch_distances import patch_points
from gauss.system import System

FIRST_ROOM = 64  # contacts that there is room for at first
MOST_LISTED_PAIRS = 4000  # pairs that are tried one by one; more are found by a grid
COLUMN = POSE + SIZES + 3  # pose and sizes of a part, centre of mass of its body
# Rows of a column for each axis of a box that counts as its first, and those that distances depend on.
TURNED = np.array([[*(3 * i + a for i in range(3) for a in axes), *range(9, POSE)] for axes in CYCLIC])
COLUMNS = np.concatenate([TURNED, POSE + CYCLIC, np.tile(np.arange(POSE + 3, COLUMN), (3, 1))], axis=1)


class NearContacts(NamedTuple):
    """Contacts of one instant, m of them."""

    key: np.ndarray  # (m,) pair of parts and of their features: the same contact has the same key at all times
    law: np.ndarray  # (m,) contact of the scene
    bodies: np.ndarray  # (m, 2) bodies; −1 is the ground
    gap: np.ndarray  # (m,) contact distances [m]
    place: np.ndarray  # place (m, 3), axes (m, 3, 3): points [m]; normals and two tangents as rows, in world axes
    axes: np.ndarray
    J: np.ndarray  # (m, 2, 3, 8) rows for the twists (ω, u) of both bodies; the last two columns are zero
    bias: np.ndarray  # (m, 3) accelerations along normal and tangents while the rates are constant [m/s²]

    def known_forces(self, keys: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Forces (m, 3) by the keys in order (k,) and forces (k, 3) of the last step; zero of new contacts."""
        found = np.zeros((self.gap.size, 3))
        if keys.size:
            places = np.minimum(np.searchsorted(keys, self.key), keys.size - 1)
            same = keys[places] == self.key
            found[same] = forces[places[same]]
        return found


class Overlap(NamedTuple):
    """Shapes in each other of which no pair of features says so: a contact of the scene, and how deep [m]."""

    law: int
    depth: float


class CandidatePairs(NamedTuple):
    """Pairs of convex parts of shapes that a step with contacts looks at."""

    parts: int  # convex parts of the shapes that take part in contacts
    pairs: int  # their pairs
    by_grid: bool  # whether near pairs are found by a grid: the work is then that of the parts, not that of the pairs


def candidate_pairs(system: System) -> CandidatePairs:
    """Pairs that the steps of a system look at."""
    table = ShapeTable(system)
    pairs = int(np.count_nonzero(np.triu(table.law)))
    return CandidatePairs(len(table.parts), pairs, pairs > MOST_LISTED_PAIRS)


class NearDetection:
    """Detection of the near contacts of a system, all pairs of which are candidates.

    Parameters
    ----------
    bodies : int
        Number of bodies that its shapes belong to, with the ground.
    length : float
        Length of the scene [m].
    code : NearPairs
        The machine code.
    """

    def __init__(self, table: ShapeTable, bodies: int, length: float, code: NearPairs):
        self.table, self.length, self.code = table, length, code
        self.version = 0  # changes with the addresses of the arrays
        n = len(table.parts)
        self.law = np.ascontiguousarray(table.law)
        is_listed = 0 < np.count_nonzero(self.law) <= 2 * MOST_LISTED_PAIRS  # each pair stands there twice
        self.pair = np.column_stack(np.nonzero(np.triu(self.law))) if is_listed else np.zeros((0, 2), dtype=np.int64)
        self.grid = grid_room(0 if is_listed else n)
        self.body = np.column_stack([table.body, table.kind == KINDS.index(HalfSpace), table.kind]).astype(np.int64)
        self.records = shape_records(table)
        addresses = [[0.0 if record is None else record.address for record in self.records]]
        self.own = np.concatenate([table.own, table.centre, table.sizes, table.ball[None], addresses]).T.copy()
        assert self.own.shape == (n, PART)
        least = table.sizes[:3].min(axis=0)
        self.edges = np.where(least > 0.0, 2.0 * least, np.inf)
        self.moved, self.bodies = np.empty(n * (MOVED + 3)), np.empty((24, bodies))
        self.patch = np.full((SLOTS, POINT), np.nan)
        self.deepest = np.empty(n)
        self.near_settings = np.array([0.0, length, START_OVERLAP * length, self.patch.ctypes.data])
        self.kinds: dict[int, PairKernels | PatchKernels] = {}
        self._make_room(FIRST_ROOM)
        self.kind, self.feature = np.zeros((MOST_KINDS**2, KIND), dtype=np.int64), np.zeros((0, FEATURE), dtype=np.int64)
        self.signs, self.count, self.depth = np.zeros((0, SIGNS)), np.zeros(4, dtype=np.int64), np.zeros(1)

    def _make_room(self, capacity: int):
        self.rows, self.found = np.empty((capacity, ROW)), np.empty((capacity, 2), dtype=np.int64)

    def expect(self, contacts: int):
        """Make room for a number of contacts, if there is less."""
        if contacts > len(self.rows):
            self._make_room(2 * contacts)
            self._take_addresses()

    def _kernels(self, code: int) -> PairKernels | PatchKernels:
        """Kernels of a pair of kinds of shapes."""
        one, other = divmod(code, MOST_KINDS)
        kinds = KINDS[one], KINDS[other]
        if RULES[kinds] is not patch_points:
            return pair_kernels(kinds)
        parts, shapes = self.table.parts, self.table.scene.shapes

        def shapes_of(pair: int) -> tuple[Collider, Collider]:
            first, second = divmod(pair, len(parts))
            return shapes[parts[first].shape], shapes[parts[second].shape]

        return PatchKernels(kinds, shapes_of, self.count, self.near_settings, self.patch)

    def connect(self):
        """Take the addresses of the kernels anew: a new motion may run in another tier."""
        features: list[np.ndarray] = []
        signs: list[np.ndarray] = []
        for number, kernels in sorted(self.kinds.items()):
            other = 0 if kernels.otherwise is None else kernels.otherwise.address()
            self.kind[number] = kernels.distances.address(), len(kernels.features), len(features), kernels.guarded, other
            addresses = [rows.address() for rows in kernels.rows]
            assert len(kernels.features) < MOST
            for one in kernels.features:
                features.append(np.concatenate([[addresses[one.function]], *(COLUMNS[axis] for axis in one.axes)]))
                signs.append(np.append(one.signs, np.zeros(SIGNS - len(one.signs))))
        self.feature = np.array(features, dtype=np.int64).reshape(-1, FEATURE)
        self.signs = np.array(signs).reshape(-1, SIGNS)
        self._take_addresses()

    def _take_addresses(self):
        self.version += 1
        names = *NEAR_INTEGERS, "bodies", *NEAR_NUMBERS
        self.addresses = [getattr(self, name).ctypes.data for name in names]

    def find(self, bodies: np.ndarray, reach: float, unseen: float = np.inf) -> tuple[NearContacts, list[Overlap]]:
        """Contacts nearer than ``reach``, and a pair of shapes that overlap without one.

        Parameters
        ----------
        bodies : ndarray, shape (24, n + 1)
            Poses, velocities and their rates of the bodies, the ground last.
        reach : float
            Distance [m].
        unseen : float
            Depth of a missed overlap, relative to the shortest edge of the boxes.
        """
        table = self.table
        self.bodies[...] = bodies
        self.near_settings[0] = reach
        np.multiply(unseen, self.edges, out=self.deepest)
        while True:
            counts = len(table.parts), len(self.pair), len(self.rows), self.bodies.shape[1]
            self.code(counts, self.addresses)
            m, missed, unmade, _ = self.count.tolist()
            if unmade:
                self.kinds[unmade - 1] = self._kernels(unmade - 1)
                self.connect()
            elif m > len(self.rows):
                self.expect(m)
            else:
                break
        pair, feature = self.found[:m].T
        first, second = np.divmod(pair, len(table.parts))
        rows = self.rows[:m].copy()
        J = rows[:, 4:52].reshape(m, 2, 3, 8)
        key = pair * MOST_FEATURES + feature
        touching = np.column_stack([table.body[first], table.body[second]])
        law = table.law[first, second] - 1
        near = NearContacts(key, law, touching, rows[:, 0], rows[:, 1:4], J[:, 0, :, 3:6], J, rows[:, 52:])
        return near, [Overlap(int(self.law.flat[missed - 1]) - 1, float(self.depth[0]))] if missed else []


@cache
def near_pairs() -> NearPairs:
    """Machine code of its own, made once on a machine; compiled steps hold the same."""
    return from_disk((NearPairs,), lambda: NearPairs(near_code(place_function())))


def confirmed(near: NearContacts, overlaps: list[Overlap], table: ShapeTable, t: float) -> NearContacts:
    """Contacts of a state, whose shapes are not too deep in each other, and meet where they have normals.

    SimulationError if they are, or do not: it names the contact.
    """
    if overlaps:
        law, depth = overlaps[0]
        raise SimulationError(
            f"t = {t:.6g} s: shapes are {depth:.3g} m in each other, and no gap of {table.contacts[law].name!r} leads out; "
            "move them apart with scene.start, or shorten the step."
        )
    sloped = np.isfinite(near.J).all(axis=(1, 2, 3))
    if not sloped.all():
        name = table.contacts[near.law[int(np.flatnonzero(~sloped)[0])]].name
        raise SimulationError(f"t = {t:.6g} s: {name!r} has no slope; its shapes meet where they have no normal.")
    return near
