"""Distances of contact points of convex hulls, thickened by radii, and of a hull and a half-space, in machine code.

The points are those of :class:`gauss.scene.contact_patch.SolidPair`, whose search for nearest points is tried where the one
here has no certificate, and whose choice of points where there are many.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, NativeFunction, Writer
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, routine
from gauss.codegen.kernels.hull_distance import FOUND, LEFT, NEAREST, PLACELESS, write_nearest_points
from gauss.codegen.kernels.hull_patch import HIGH, ROOM, write_patch
from gauss.codegen.kernels.hull_points import POSE, Hull, put, vector
from gauss.codegen.kernels.near_pairs import FAR_AWAY, HULL_INPUTS, PATCH, REACH, RECORDS, UNKNOWN
from gauss.codegen.kernels.patch_rows import POINT

SECOND = 16  # first place of the second pose in the input
MOVED_APART = 1e-2  # relative to the size of both hulls: distance at which the place of their least way out is found
SAME_NORMAL = 1e-9  # difference of normals that is rounding there


class Corners(NamedTuple):
    """Corners over a face, as of :func:`gauss.codegen.kernels.hull_patch.write_patch`."""

    corners: Array
    number: Array
    lowest: Array


class PointsWriter:
    """Writer of the points of a pair.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    records : list of Array
        Records of both hulls.
    R, x : list of ndarray
        Rotations (3, 3) and centres (3,) of both.
    reach : Value
        Distance [m] of the farthest points.
    """

    def __init__(self, r: Routine, records: list[Array], R: list[np.ndarray], x: list[np.ndarray], reach: Value):
        self.r, self.records, self.R, self.x, self.reach = r, records, R, x, reach
        self.count = r.variable(0, INTEGER)

    def add(self, gap: Value, place: np.ndarray, normal: np.ndarray):
        """Add a point in the axes of the poses."""
        raise NotImplementedError

    def search(self, placed: Array, reach: Array, nearest: Array, status: Array):
        """Nearest points; where the place of the least way out is not known, that of hulls moved apart along it."""
        r, search, moved, known = self.r, write_nearest_points(self.r.module), self.r.buffer(POSE), self.r.buffer(NEAREST)
        first, second = (Hull(r, record) for record in self.records)
        r.call(search, *self.records, placed, reach, nearest, status)
        with r.when((status[0] >= PLACELESS) & (status[0] <= PLACELESS)):
            way = (first.size + second.size) * MOVED_APART - nearest[0]
            r.copy(moved, placed, 9)
            put(moved, vector(placed, 9) + vector(nearest, 1) * way, 9)
            reach[0] = np.inf
            r.call(search, *self.records, moved, reach, known, status)
            off = vector(known, 1) - vector(nearest, 1)
            with r.when(~(off @ off <= SAME_NORMAL * SAME_NORMAL)):
                status[0] = LEFT
            put(nearest, vector(known, 4), 4)

    def faces(self, hulls, poses, normal: np.ndarray, across: float) -> Iterator[tuple[int, Value, np.ndarray, Corners]]:
        """Number of the hull whose face is across a normal, radius over it, its normal, and corners of the other one's."""
        r, write = self.r, write_patch(self.r.module)
        R = self.R[1].T @ self.R[0]
        (one, cosine), (other, other_cosine) = hulls[0].face(-(R.T @ normal)), hulls[1].face(normal)
        corners = Corners(r.buffer(HIGH * ROOM), r.variable(0, INTEGER), r.buffer(2))
        for k, face, is_own in ((1, other, other_cosine >= cosine), (0, one, ~(other_cosine >= cosine))):
            with r.when(is_own & ((other_cosine >= across) | (cosine >= across))):
                r.call(write, self.records[k], face, self.records[1 - k], poses[1 - k], *corners)
                yield k, hulls[1 - k].radius, vector(hulls[k].normals, face * 3), corners

    def corner(self, k: int, radius: Value, upward: np.ndarray, seen: Array, i: Value):
        """Point of a corner over the face of hull k: its height, place and normal."""
        height = seen[i * HIGH + 3] - radius
        depth, out = height + radius if k else radius, self.R[k] @ upward
        return height, self.x[k] + self.R[k] @ (vector(seen, i * HIGH) - upward * depth), out if k else -out

    def write_patch(self, hulls, poses, nearest, across: float, near: Value):
        """Nearest points, and corners of faces that meet there."""
        r, (gap, place, normal) = self.r, nearest
        least, is_alone = r.variable(np.inf), r.variable(1, INTEGER)
        for k, radius, upward, (seen, count, lowest) in self.faces(hulls, poses, normal, across):
            with r.each(count[0]) as i:
                height = seen[i * HIGH + 3] - radius
                least[0] = r.choose((height <= self.reach) & (height < least[0]), height, least[0])
            is_theirs = (lowest[0] - radius >= gap - near) & (lowest[0] <= lowest[1] + near)
            flat = is_theirs & (least[0] <= lowest[0] - radius + near)
            is_alone[0] = r.as_integer(~flat)
            with r.when(~flat):
                self.add(gap, place, self.R[1] @ normal)
            with r.each(count[0]) as i:
                height, corner, out = self.corner(k, radius, upward, seen, i)
                with r.when((height <= self.reach) & (flat | (height > gap))):
                    self.add(height, corner, out)
        with r.when((is_alone[0] > 0) & (self.count[0] < 1)):
            self.add(gap, place, self.R[1] @ normal)


def array_at(r: Routine, address: Value, kind: ir.Type) -> Array:
    """Array by its address in a double."""
    return Array(r.b, r.b.inttoptr(r.b.fptosi(address.value, INTEGER), kind))


def given_poses(given: Array) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Rotations (3, 3) and centres (3,) of both shapes in the input of distances."""
    return (
        [np.array([[given[at + 3 * i + j] for j in range(3)] for i in range(3)]) for at in (0, SECOND)],
        [np.array([given[at + 9 + i] for i in range(3)]) for at in (0, SECOND)],
    )


class _PairWriter(PointsWriter):
    """Writer of the points of a pair of shapes; see :class:`HullDistances`.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    given, found : Array
        Input and output of the function.
    slots : int
        Most points.
    """

    def __init__(self, r: Routine, given, found, slots: int):
        records = [array_at(r, given[place], INTEGERS) for place in (RECORDS, RECORDS + 1)]
        super().__init__(r, records, *given_poses(given), given[REACH])
        self.found, self.slots, self.points = found, slots, array_at(r, given[PATCH], found.pointer.type)
        with r.each(slots) as k:
            found[k] = FAR_AWAY

    def add(self, gap: Value, place: np.ndarray, normal: np.ndarray):
        """Add a point in world axes."""
        with self.r.when(self.count[0] < self.slots):
            put(self.points, [gap, *place, *normal], self.count[0] * POINT)
            self.found[self.count[0]] = gap
        self.count[0] = self.count[0] + 1

    def leave(self, where: Value):
        """Leave the pair to the other method where a condition holds."""
        with self.r.when(where):
            self.found[0] = UNKNOWN

    def write_on_plane(self):
        """Vertices of the first hull near the half-space."""
        r, hull, normal = self.r, Hull(self.r, self.records[0]), self.R[1][:, 2]
        down, height = self.R[0].T @ normal, normal @ (self.x[0] - self.x[1])
        with r.each(hull.vertex_count) as k:
            vertex = vector(hull.vertices, k * 3)
            gap = vertex @ down + height
            with r.when(gap <= self.reach):
                self.add(gap, self.x[0] + self.R[0] @ vertex - normal * gap, normal)
        self.leave(self.count[0] > self.slots)

    def write(self, across: float, same_depth: float):
        """Nearest points, and corners of faces that meet there."""
        r, (first, second) = self.r, (Hull(self.r, record) for record in self.records)
        nearest, status, reach = r.buffer(NEAREST), r.variable(0, INTEGER), r.buffer(1)
        poses, R, x = [r.buffer(POSE), r.buffer(POSE)], self.R[1].T @ self.R[0], self.R[1].T @ (self.x[0] - self.x[1])
        put(poses[0], [*R.ravel(), *x])
        put(poses[1], [*R.T.ravel(), *(-(R.T @ x))])
        reach[0], status[0] = self.reach + first.radius + second.radius, LEFT
        with r.when((first.vertex_count > 0) & (second.vertex_count > 0)):
            self.search(poses[0], reach, nearest, status)
        gap, normal = nearest[0] - first.radius - second.radius, vector(nearest, 1)
        place = self.x[1] + self.R[1] @ (vector(nearest, 4) + normal * second.radius)
        with r.when((status[0] <= FOUND) & (gap <= self.reach)):
            near = (first.size + second.size) * same_depth
            self.write_patch((first, second), poses, (gap, place, normal), across, near)
        self.leave((status[0] >= LEFT) | (self.count[0] > self.slots))


class HullDistances(NativeFunction):
    """Distances of the points of a pair, which go to the array of points; :data:`UNKNOWN` leaves it to another method.

    Parameters
    ----------
    slots : int
        Most points.
    laws : tuple of float, optional
        Of two hulls: cosine of the angle of a normal and a face above which its corners may touch next; relative distance at
        which a face is as far as the nearest points. The second solid is a half-space without them.
    """

    def __init__(self, slots: int, laws: tuple[float, float] | None = None):
        self.slots, self.laws = slots, laws
        self.name = "hull_distances" if laws else "hull_on_plane"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return HULL_INPUTS, self.slots

    def operations(self) -> dict[str, int]:
        """None that are known before: they depend on the hulls."""
        return {}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one pair at a time."""
        r, given, found = routine(self, writer.module, width)
        points = _PairWriter(r, given, found, self.slots)
        if self.laws:
            points.write(*self.laws)
        else:
            points.write_on_plane()
        return r.done()
