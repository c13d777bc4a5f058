"""Gap functions of boxes: a corner on a box, and two edges that cross.

The distance of two boxes is not smooth. So every pair of features, corner and face, or edge and edge, has a smooth gap
function of its own. While open, the nearest features count. A closed contact keeps its features; a margin becomes zero where
the corner reaches the rim of its face, or one edge the end of the other: it opens there. Corners that meet edges or corners
exactly have no normal; within ``RIM_WIDTH`` of a face they rest on it.
"""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from gauss import math
from gauss.rotations import along, cross
from gauss.scene import values
from gauss.scene.collision import Box, Capsule, Collider
from gauss.scene.contact_distances import PARALLEL_SEGMENTS, FeaturePair, Touch, across, ball, corner

RIM_WIDTH = 1e-7  # relative to the length of the scene: of a face beyond its rim; wider than a closed gap
FAR_APART = 1e3  # relative to the length of the scene: gap function of edges that do not cross, or do not separate the boxes


@dataclass(frozen=True)
class CornerOnBox(FeaturePair):
    """Corner of a shape, or the ball around it, and a box."""

    shape: Collider  # the shape
    index: int
    box: Box
    # axis and side, −1 or 1, of the face that counts; the nearest feature when not given
    face: tuple[int, int] | None = None

    def touch(self, at) -> Touch:
        """Signed distance of the corner from the box, less the radius; of a fixed face, the height over its plane."""
        axes, half = _axes(self.box, at), _half(self.box)
        x, p = self._seen_from_box(at), corner(self.shape, self.index, at)
        if self.face is not None:
            axis, side = self.face
            height, normal = side * x[axis] - half[axis], side * axes[:, axis]
        else:
            out = np.abs(x) - half
            around = _second(out) > self._rim(at)  # of an edge or corner: where two or three are positive
            apart, _, direction = ball(at, math.where(around, math.maximum(out, 0.0), 1.0), np.zeros(3), 0.0, 0.0)
            face = _one_hot(self._merits(at, x, out))
            height = face @ out
            if self._is_of_a_box:  # it may be beside the face
                height = math.where(reduce(math.maximum, out) - self._rim(at) > math.maximum(height, 0.0), far(at), height)
            height = math.where(around, apart, height)
            normal = axes @ (_sides(x) * math.where(around, direction, face))
        return Touch(height - self.shape.radius, p - height * normal, normal)

    def fixed(self, at) -> "CornerOnBox | None":
        """Pair of the present face; None of a ball, whose distance is smooth."""
        if self.shape.is_round:
            return None
        x = self._seen_from_box(at)
        axis = int(np.argmax(self._merits(at, x, np.abs(x) - _half(self.box))))
        return replace(self, face=(axis, int(_sides(x)[axis])))

    def margin(self, at):
        """Distance of the corner from the rim, which it passes at zero [m]."""
        out = np.abs(self._seen_from_box(at)) - _half(self.box)
        assert self.face is not None  # a margin is that of a fixed face
        j, k = across(self.face[0])
        return 2.0 * reach(at) - math.maximum(out[j], out[k])

    def _rim(self, at) -> float:
        """Width of a face beyond its rim: a ball turns round an edge, a corner without radius has to pass it."""
        return 0.0 if self.shape.is_round else reach(at)

    @property
    def _is_of_a_box(self) -> bool:
        return isinstance(self.shape, Box)

    def _merits(self, at, x, out) -> np.ndarray:
        """Scores of the three faces, highest of that which the shape is farthest out of; of a point, of the nearest one."""
        if self.shape.is_round:
            return out
        others = np.array([self._seen_from_box(at, k) for k in range(len(self.shape.corners))])
        separations = reduce(math.minimum, others * _sides(x)) - _half(self.box)
        if self._is_of_a_box:
            return separations
        nearly = reduce(math.maximum, out) - reach(at)
        return np.array([math.where(out[k] >= nearly, separations[k], -far(at)) for k in range(3)])

    def _seen_from_box(self, at, index: int | None = None) -> np.ndarray:
        middle = at.position(self.box.body, self.box.at)
        return _axes(self.box, at).T @ (corner(self.shape, self.index if index is None else index, at) - middle)


@dataclass(frozen=True)
class Edges(FeaturePair):
    """An edge of a box that crosses one of another.

    The four edges along an axis come in two pairs that lie opposite to each other; of a pair only the one that faces the
    other box counts.
    """

    first: Box
    second: Box
    axis: int  # axis, other: axes of the two boxes along which the edges lie
    other: int
    pair: int  # pair, other_pair: product of the sides, −1 or 1, on which an edge lies: which pair it belongs to
    other_pair: int
    # sides of the normal and of the two edges, −1 or 1, that count; those of facing edges when not given
    signs: tuple[int, int, int] | None = None

    def touch(self, at) -> Touch:
        """Distance of the two lines along their common normal, where they cross; far where they do not."""
        (E, a, F, b, apart), signs = self._boxes(at), self.signs or self._facing(at)
        s, t, gap, normal = self._crossing(at, signs)
        place = at.position(self.second.body, self.second.at) + signs[2] * self._edge(F, b, 1) + t * F[:, self.other]
        if self.signs is None:
            crossed = self._normal(E, F)[1] - PARALLEL_SEGMENTS
            inside = self._inside(s, t) - 2.0 * reach(at)
            nearest = gap - _best(E, a, F, b, apart, far(at)) + reach(at)
            gap = math.where(reduce(math.minimum, (crossed, inside, nearest)) > 0.0, gap, far(at))
        return Touch(gap, place, normal)

    def fixed(self, at) -> "Edges":
        """Pair of the present edges."""
        side, first, second = (int(sign) for sign in self._facing(at))
        return replace(self, signs=(side, first, second))

    def margin(self, at):
        """How far the crossing is from the nearest end of an edge [m]."""
        s, t, *_ = self._crossing(at, self.signs)
        return self._inside(s, t) - reach(at)

    def _boxes(self, at):
        """Axes and half edges of both boxes, and the way from the second to the first."""
        one, two = self.first, self.second
        apart = at.position(one.body, one.at) - at.position(two.body, two.at)
        return _axes(one, at), _half(one), _axes(two, at), _half(two), apart

    def _normal(self, E, F):
        """Common normal of the edges, any across the first where they are parallel; and sin² of their angle."""
        normal = cross(E[:, self.axis], F[:, self.other])
        squared = normal @ normal
        parallel = squared < PARALLEL_SEGMENTS
        length = np.sqrt(math.where(parallel, 1.0, squared))
        return math.where(parallel, E[:, across(self.axis)[0]], normal / length), squared

    def _facing(self, at):
        """Signs of the normal, out of the second box, and of the edges of the pairs that face each other."""
        E, a, F, b, apart = self._boxes(at)
        normal, _ = self._normal(E, F)
        side = math.where(normal @ apart < 0.0, -1.0, 1.0)
        first, second = side * (normal @ self._edge(E, a, 0)), side * (normal @ self._edge(F, b, 1))
        return side, math.where(first > 0.0, -1.0, 1.0), math.where(second < 0.0, -1.0, 1.0)

    def _edge(self, axes, half, which: int) -> np.ndarray:
        """From the middle of a box to that of one edge of the pair."""
        axis, pair = ((self.axis, self.pair), (self.other, self.other_pair))[which]
        j, k = across(axis)
        return half[j] * axes[:, j] + pair * half[k] * axes[:, k]

    def _crossing(self, at, signs):
        """Where along both edges they are nearest [m], their distance along the normal, and the normal."""
        E, a, F, b, apart = self._boxes(at)
        normal, squared = self._normal(E, F)
        normal, e, f = signs[0] * normal, E[:, self.axis], F[:, self.other]
        way = apart + signs[1] * self._edge(E, a, 0) - signs[2] * self._edge(F, b, 1)
        k = e @ f
        s = (k * (f @ way) - e @ way) / math.maximum(squared, PARALLEL_SEGMENTS)
        t = k * s + f @ way
        return s, t, normal @ way, normal

    def _inside(self, s, t):
        """How far the crossing is from the nearest end [m]."""
        return math.minimum(_half(self.first)[self.axis] - np.abs(s), _half(self.second)[self.other] - np.abs(t))


def _axes(shape: Box | Capsule, at) -> np.ndarray:
    return at.rotation(shape.body) @ (shape.axes if isinstance(shape, Box) else along(values.unit(shape.axis)))


def _half(shape: Box | Capsule) -> np.ndarray:
    return 0.5 * np.array(shape.size if isinstance(shape, Box) else (0.0, 0.0, shape.length))


def separation(first: Box | Capsule, second: Box | Capsule, at):
    """Separation of two boxes, or of the axis of a capsule and a box, along the best axis [m]; negative if they overlap."""
    apart = at.position(first.body, first.at) - at.position(second.body, second.at)
    return _best(_axes(first, at), _half(first), _axes(second, at), _half(second), apart, far(at))


def _best(E, a, F, b, apart, least: float):
    """Separation along the best of fifteen axes (Gottschalk, Lin, Manocha 1996, OBBTree)."""

    def room(axis):
        return np.abs(axis @ apart) - np.abs(axis @ E) @ a - np.abs(axis @ F) @ b

    found = [room(axis) for axis in (*E.T, *F.T)]
    for e in E.T:
        for f in F.T:
            normal = cross(e, f)
            squared = normal @ normal
            parallel = squared < PARALLEL_SEGMENTS
            length = np.sqrt(math.where(parallel, 1.0, squared))
            found.append(math.where(parallel, -least, room(normal / length)))
    return reduce(math.maximum, found)


def reach(at) -> float:
    """Width beyond the rim of a face in which a corner rests on it [m]."""
    return RIM_WIDTH * at.system.scale.length


def far(at) -> float:
    """Gap function of edges that do not cross, or do not separate the boxes [m]."""
    return FAR_APART * at.system.scale.length


def _second(values):
    x, y, z = values
    return math.maximum(math.minimum(x, y), math.minimum(math.maximum(x, y), z))


def _sides(x) -> np.ndarray:
    return np.array([math.where(entry < 0.0, -1.0, 1.0) for entry in x])


def _one_hot(values) -> np.ndarray:
    """One where a value is the largest, the first of these, else zero."""
    largest = reduce(math.maximum, values)
    first = math.where(values[0] >= largest, 1.0, 0.0)
    second = math.where(values[1] >= largest, 1.0 - first, 0.0)
    return np.array([first, second, 1.0 - first - second])
