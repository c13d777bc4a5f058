"""Contacts that are near at one instant: near pairs of shapes, near pairs of their features, rows of the contact problem."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.moreau_step import START_OVERLAP
from gauss.dynamics.contact.pair_kernels import CYCLIC, PLACE, POSE, SIGNS, SIZES, PairKernels, pair_kernels
from gauss.dynamics.contact.shape_table import KINDS, MOST_FEATURES, ShapeTable
from gauss.errors import SimulationError

COLUMN = POSE + SIZES + 3  # pose and sizes of a part, centre of mass of its body
# Rows of a column for each axis of a box that counts as its first, and those that distances depend on.
TURNED = np.array([[*(3 * i + a for i in range(3) for a in axes), *range(9, POSE)] for axes in CYCLIC])
COLUMNS = np.concatenate([TURNED, POSE + CYCLIC, np.tile(np.arange(POSE + 3, COLUMN), (3, 1))], axis=1)
DISTANCE_ROWS = np.array([*range(PLACE), *range(POSE, POSE + SIZES)])


class NearContacts(NamedTuple):
    """Contacts of one instant, m of them.

    Attributes
    ----------
    key : ndarray of int64, shape (m,)
        Pair of parts and of their features: the same contact has the same key at all times.
    law : ndarray of int, shape (m,)
        Contact of the scene.
    bodies : ndarray of int64, shape (m, 2)
        Bodies; −1 is the ground.
    gap : ndarray, shape (m,)
        Contact distances [m].
    place, axes : ndarray, shape (m, 3), (m, 3, 3)
        Points [m]; normals and two tangents as rows, in world axes.
    J : ndarray, shape (m, 2, 3, 8)
        Rows for the twists (ω, u) of both bodies; the last two columns are zero.
    bias : ndarray, shape (m, 3)
        Accelerations along normal and tangents while the rates are constant [m/s²].
    """

    key: np.ndarray
    law: np.ndarray
    bodies: np.ndarray
    gap: np.ndarray
    place: np.ndarray
    axes: np.ndarray
    J: np.ndarray
    bias: np.ndarray


class _Kind:
    """Pairs of features of one kind of pairs of shapes, as arrays."""

    def __init__(self, kernels: PairKernels):
        self.kernels = kernels
        self.function = np.array([feature.function for feature in kernels.features])
        axes = np.array([feature.axes for feature in kernels.features]).T
        self.columns = [COLUMNS[own].T for own in axes]  # rows of the columns of both parts, for each pair of features
        self.signs = np.zeros((SIGNS, len(kernels.features)))
        for k, feature in enumerate(kernels.features):
            self.signs[: len(feature.signs), k] = feature.signs


class Overlap(NamedTuple):
    """Shapes in each other of which no pair of features says so: a contact of the scene, and how deep [m]."""

    law: int
    depth: float


class ContactDetection:
    """Detection of the near contacts of a system.

    Parameters
    ----------
    table : ShapeTable
        Its shapes.
    length : float
        Length of the scene [m].
    """

    def __init__(self, table: ShapeTable, length: float):
        self.table, self.scale = table, length
        self._kinds: dict[int, _Kind] = {}

    @cached_property
    def depth(self) -> np.ndarray:
        """Least edges (k,) of boxes [m], of which a part is the depth of a missed overlap; infinite for other shapes."""
        least = self.table.sizes[:3].min(axis=0)
        return np.where(least > 0.0, 2.0 * least, np.inf)

    def find(self, poses: np.ndarray, centres: np.ndarray, reach: float, unseen: float = np.inf):
        """Contacts nearer than ``reach``, and pairs of shapes that overlap without one.

        Parameters
        ----------
        poses : ndarray, shape (24, k)
            Poses of the parts.
        centres : ndarray, shape (3, n + 1)
            Centres of mass of the bodies, that of the ground last [m].
        reach : float
            Distance [m].
        unseen : float
            Depth of a missed overlap, relative to the shortest edge of the boxes.
        """
        first, second = self.table.near(poses, reach)
        columns = np.concatenate([poses, self.table.sizes, centres[:, self.table.body]])
        code = self.table.kind[first] * len(KINDS) + self.table.kind[second]
        found: list[NearContacts] = []
        overlaps: list[Overlap] = []
        for number in np.flatnonzero(np.bincount(code)):
            mine = code == number
            pairs = first[mine], second[mine]
            kind = self._kind(int(number))
            given = [columns[DISTANCE_ROWS[:, None], part] for part in pairs]
            gaps = kind.kernels.distances(np.concatenate([*given, np.full((1, pairs[0].size), self.scale)]))
            m = kind.function.size
            if kind.kernels.guarded:
                overlaps += self._missed(gaps[:m], gaps[m], pairs, unseen)
            feature, pair = np.nonzero(gaps[:m] <= reach)
            for function in range(len(kind.kernels.rows)):
                which = np.flatnonzero(kind.function[feature] == function)
                if which.size:
                    here = pairs[0][pair[which]], pairs[1][pair[which]]
                    found.append(self._rows(kind, function, feature[which], *here, columns))
        return _joined(found), overlaps

    def _kind(self, number: int) -> _Kind:
        if number not in self._kinds:
            one, other = divmod(number, len(KINDS))
            self._kinds[number] = _Kind(pair_kernels((KINDS[one], KINDS[other])))
        return self._kinds[number]

    def _missed(self, gaps, apart, pairs, unseen: float) -> list[Overlap]:
        """Overlaps beyond a depth with all gap functions positive."""
        first, second = pairs
        deepest = unseen * np.minimum(self.depth[first], self.depth[second])
        missed = np.flatnonzero((apart <= -deepest) & (gaps.min(axis=0) > -START_OVERLAP * self.scale))
        return [Overlap(int(self.table.law[first[k], second[k]]) - 1, -float(apart[k])) for k in missed]

    def _rows(self, kind: _Kind, function: int, feature, first, second, columns) -> NearContacts:
        """Rows of pairs of features of one kind."""
        table, m = self.table, feature.size
        given = np.empty((2 * COLUMN + 1 + SIGNS, m))
        given[:COLUMN] = columns[kind.columns[0][:, feature], first]
        given[COLUMN : 2 * COLUMN] = columns[kind.columns[1][:, feature], second]
        given[2 * COLUMN] = self.scale
        given[2 * COLUMN + 1 :] = kind.signs[:, feature]
        found = kind.kernels.rows[function](given)
        J = found[4:52].T.reshape(m, 2, 3, 8)
        key = (first * len(table.parts) + second) * MOST_FEATURES + feature
        bodies = np.column_stack([table.body[first], table.body[second]])
        return NearContacts(
            key, table.law[first, second] - 1, bodies, found[0], found[1:4].T, J[:, 0, :, 3:6], J, found[52:].T
        )


def confirmed(near: NearContacts, overlaps: list[Overlap], table: ShapeTable, t: float) -> NearContacts:
    """Contacts of a state, whose shapes are not too deep in each other, and meet where they have normals.

    Raises
    ------
    SimulationError
        If they are, or do not: it names the contact.
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


def _joined(found: list[NearContacts]) -> NearContacts:
    if len(found) == 1:
        return found[0]
    if found:
        return NearContacts(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
    none, integers = np.zeros(0), np.zeros(0, dtype=np.int64)
    bodies, J = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2, 3, 8))
    return NearContacts(integers, integers, bodies, none, np.zeros((0, 3)), np.zeros((0, 3, 3)), J, np.zeros((0, 3)))
