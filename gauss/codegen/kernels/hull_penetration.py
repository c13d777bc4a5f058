"""Penetration of two convex hulls, the shortest translation that separates them, in machine code.

    D = {a − b} around the origin;   depth = distance of the origin from the nearest face of D

A polytope of corners of D is expanded at its face nearest to the origin until that face is one of D (EPA: van den Bergen,
GDC 2001).
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Value, name_with, subroutine
from gauss.codegen.kernels.hull_points import Hull, cross, put, vector, write_farthest, write_nearest

MOST_POINTS, MOST_FACES, MOST_EDGES = 48, 256, 192
LEAST_FACE = 1e-13  # relative to the square of the size: twice the area of a face without a normal
SIDES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3))  # of a tetrahedron, counterclockwise from outside


class _PenetrationWriter:
    def __init__(self, module: ir.Module, name: str, states: tuple[int, int, int], close: float, accepted: float):
        kinds = [INTEGERS, INTEGERS, POINTER, POINTER, POINTER, INTEGERS, POINTER, INTEGERS]
        r = self.r = subroutine(module, name, kinds)
        self.records, (self.pose, self.scale, self.simplex, self.own, self.result, self.status) = r.arrays[:2], r.arrays[2:]
        (self.found, self.placeless, self.left), self.close, self.accepted = states, close, accepted
        self.farthest, self.nearest = write_farthest(module), write_nearest(module)
        self.points, self.vertices = r.buffer(3 * MOST_POINTS), r.buffer(2 * MOST_POINTS, INTEGER)
        self.faces, self.planes = r.buffer(3 * MOST_FACES, INTEGER), r.buffer(4 * MOST_FACES)
        self.edges = r.buffer(2 * MOST_EDGES, INTEGER)
        self.point_count, self.face_count, self.edge_count = (r.variable(0, INTEGER) for _ in range(3))
        self.direction, self.shares, self.foot = r.buffer(3), r.buffer(3), r.buffer(3)

    def write(self) -> ir.Function:
        r, scale = self.r, self.scale[0]
        self.status[0], self.face_count[0], self.point_count[0] = 0, 0, 4
        r.copy(self.points, self.simplex, 12)
        r.copy(self.vertices, self.own, 8)
        a, b, c, d = (vector(self.points, 3 * k) for k in range(4))
        with r.when(cross(b - a, c - a) @ (d - a) > 0.0):  # two are swapped: faces are counterclockwise from outside
            put(self.points, [*b, *a])
            one = [self.vertices[k] for k in range(4)]
            put(self.vertices, one[2:] + one[:2])
        for side in SIDES:
            self._add(*(self._integer(k) for k in side))
        with r.loop() as leave_if:
            face, distance = self._nearest_face()
            normal, k = vector(self.planes, face * 4), self.point_count[0]
            put(self.direction, normal)
            r.call(
                self.farthest, *self.records, self.pose, self.direction, self.points.after(k * 3), self.vertices.after(k * 2)
            )
            between = normal @ vector(self.points, k * 3) - distance
            is_known = self._is_known(k)
            is_found = (between <= scale * self.close) | (is_known & (between <= scale * self.accepted))
            with r.when(is_found & (self.status[0] < 1)):
                self._write(face, distance, normal)
            is_full = (k > MOST_POINTS - 2) | (self.face_count[0] > MOST_FACES - MOST_POINTS) | ~(distance < np.inf)
            self._end(is_known | is_full)
            leave_if(self.status[0] > 0)
            self._open(vector(self.points, k * 3))
            leave_if(self.status[0] > 0)
            self._close(k)
            self.point_count[0] = k + 1
            leave_if(self.status[0] > 0)
        return r.done()

    def _integer(self, k: int) -> Value:
        return Value(self.r.b, INTEGER(k))

    def _end(self, where: Value):
        with self.r.when(where & (self.status[0] < 1)):
            self.status[0] = self.left

    def _add(self, i: Value, j: Value, k: Value):
        """Add a face; one without area is never the nearest, nor visible from any point."""
        r, place = self.r, self.face_count[0]
        a, b, c = (vector(self.points, corner * 3) for corner in (i, j, k))
        across = cross(b - a, c - a)
        size = r.square_root(across @ across)
        is_flat = ~(size > self.scale[0] * self.scale[0] * LEAST_FACE)
        normal = np.array([r.choose(is_flat, 0.0, x) for x in across / size])
        distance = r.choose(is_flat, np.inf, normal @ a)
        put(self.faces, [i, j, k], place * 3)
        put(self.planes, [*normal, distance], place * 4)
        self.face_count[0] = place + 1
        self._end(distance < self.scale[0] * -self.accepted)

    def _nearest_face(self) -> tuple[Value, Value]:
        r, least, place = self.r, self.r.variable(np.inf), self.r.variable(0, INTEGER)
        with r.each(self.face_count[0]) as k:
            distance = self.planes[k * 4 + 3]
            is_less = distance < least[0]
            place[0], least[0] = r.choose(is_less, k, place[0]), r.choose(is_less, distance, least[0])
        return place[0], least[0]

    def _is_known(self, k: Value) -> Value:
        """Whether a corner is one of those before."""
        r, found = self.r, self.r.variable(0, INTEGER)
        with r.each(k) as i:
            found[0] = found[0] + r.as_integer(self._are_equal(self.vertices, i, k))
        return found[0] > 0

    def _are_equal(self, pairs: Array, i: Value, k: Value, turned: bool = False) -> Value:
        """Whether two pairs of integers are equal, or the reverse of each other."""
        a, b, c, d = pairs[i * 2], pairs[i * 2 + 1], pairs[k * 2 + int(turned)], pairs[k * 2 + int(not turned)]
        return (a >= c) & (a <= c) & (b >= d) & (b <= d)

    def _open(self, w: np.ndarray):
        """Remove the faces visible from a point, and list their edges; the last face takes the place of each."""
        r = self.r
        self.edge_count[0] = 0
        place = r.variable(0, INTEGER)
        with r.loop() as leave_if:
            k = place[0]
            leave_if(k >= self.face_count[0])
            is_seen = vector(self.planes, k * 4) @ w > self.planes[k * 4 + 3] + self.scale[0] * (0.1 * self.close)
            with r.when(is_seen & (self.edge_count[0] < MOST_EDGES - 2)):
                e, corners = self.edge_count[0], [self.faces[k * 3 + s] for s in range(3)]
                put(self.edges, [corners[0], corners[1], corners[1], corners[2], corners[2], corners[0]], e * 2)
                self.edge_count[0] = e + 3
                last = self.face_count[0] - 1
                put(self.faces, [self.faces[last * 3 + s] for s in range(3)], k * 3)
                put(self.planes, [self.planes[last * 4 + s] for s in range(4)], k * 4)
                self.face_count[0] = last
            with r.when(~is_seen):
                place[0] = k + 1
            with r.when(self.edge_count[0] > MOST_EDGES - 3):
                self.status[0] = self.left
            leave_if(self.status[0] > 0)

    def _close(self, new: Value):
        """New faces from the edges of the hole, which belong to one removed face only, to the new point."""
        r = self.r
        with r.each(self.edge_count[0]) as e:
            both = r.variable(0, INTEGER)
            with r.each(self.edge_count[0]) as other:
                both[0] = both[0] + r.as_integer(self._are_equal(self.edges, e, other, turned=True))
            with r.when((both[0] < 1) & (self.face_count[0] < MOST_FACES)):
                self._add(self.edges[e * 2], self.edges[e * 2 + 1], new)

    def _write(self, face: Value, distance: Value, normal: np.ndarray):
        r, second = self.r, Hull(self.r, self.records[1])
        corners = [self.faces[face * 3 + s] for s in range(3)]
        r.call(self.nearest, *(self.points.after(k * 3) for k in corners), self.shares, self.foot)
        b = [vector(second.vertices, self.vertices[k * 2 + 1] * 3) * self.shares[s] for s, k in enumerate(corners)]
        put(self.result, [-distance, *(-normal), *(b[0] + b[1] + b[2])])
        self.status[0] = self.found
        foot = vector(self.foot)
        with r.when(~(r.square_root(foot @ foot) - distance <= self.scale[0] * self.accepted)):
            self.status[0] = self.placeless


def write_penetration(module: ir.Module, states: tuple[int, int, int], close: float, accepted: float) -> ir.Function:
    """Emit ``penetration(i64* first, i64* second, double* pose, double* scale, double* corners, ...)``.

    More arguments: ``i64* vertices, double* result, i64* status``. Corners of D around the origin with their vertices
    (4, 2); the result is that of :data:`gauss.codegen.kernels.hull_distance.NEAREST`.

    Parameters
    ----------
    states : tuple of int
        Values of status: the depth agrees with a plane that supports D; so, but D touches it beside the face, where no place
        is known; nothing agrees.
    close, accepted : float
        Relative to the scale: differences of bounds that are rounding, and that are accepted without a better corner.
    """
    name = name_with("penetration", states, close, accepted)
    return module.globals.get(name) or _PenetrationWriter(module, name, states, close, accepted).write()
