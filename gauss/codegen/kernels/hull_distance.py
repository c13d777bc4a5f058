"""Nearest points of two convex hulls in machine code, certified: what is found agrees with a plane that keeps both apart.

    D = {a − b};   distance = |v| of the point v of D nearest to the origin;   |v| ≥ distance ≥ min over D of v · w / |v|

GJK (Gilbert, Johnson, Keerthi, IEEE J. Robot. Autom. 4, 1988) on corners of D; hulls in each other go on with
:mod:`gauss.codegen.kernels.hull_penetration`. What rounding leaves without a certificate is LEFT to another method.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Value, subroutine
from gauss.codegen.kernels.hull_penetration import write_penetration
from gauss.codegen.kernels.hull_points import Hull, cross, pose, put, vector, write_farthest, write_nearest

FOUND, INSIDE, FAR, LEFT, PLACELESS = range(1, 6)  # states of the search, 0 while it goes on; the last: a depth, no place
NEAREST = 7  # distance, normal out of the second hull (3), point on it (3)
ROUNDS = 64
BOUND_GAP = 1e-14  # relative to the size of both hulls: difference of both bounds that is rounding
ACCEPTED_GAP = 1e-12  # the same, where no better corner is found
TOUCHING = 4e-15  # the same: distance that has no direction
LEAST_TRIANGLE = 1e-4  # relative to the square of the size: twice the area of a triangle
ODD = 0.11, 0.17, 0.05  # added to the direction of the other hull's centre at first: no faces are expected across it
WITHOUT_FOURTH = ((0, 1, 3, 2), (1, 2, 3, 0), (0, 2, 3, 1))  # sides of a simplex with its newest corner; the corner across


class _DistanceWriter:
    def __init__(self, module: ir.Module):
        kinds = [INTEGERS, INTEGERS, POINTER, POINTER, POINTER, INTEGERS]
        r = self.r = subroutine(module, "nearest_points", kinds)
        self.records, (self.pose, self.reach, self.result, self.status) = r.arrays[:2], r.arrays[2:]
        self.first, self.second = (Hull(r, record) for record in self.records)
        self.farthest, self.nearest = write_farthest(module), write_nearest(module)
        self.penetration = write_penetration(module, (FOUND, PLACELESS, LEFT), BOUND_GAP, ACCEPTED_GAP)
        self.corners, self.vertices, self.shares = r.buffer(12), r.buffer(8, INTEGER), r.buffer(4)
        self.v, self.count = r.buffer(3), r.variable(0, INTEGER)
        self.direction, self.tried, self.tried_shares = r.buffer(3), r.buffer(3), r.buffer(3)
        self.side, self.best_shares, self.new = r.buffer(3, INTEGER), r.buffer(3), r.buffer(3)
        self.scale = r.buffer(1)

    def write(self) -> ir.Function:
        r = self.r
        x = pose(self.pose)[1]
        between = r.square_root(x @ x)
        self.scale[0] = self.first.size + self.second.size + between
        away = r.choose(between > 0.0, between, 1.0)
        self._search(-(x + np.array([away * part for part in ODD])), 0)
        put(self.v, vector(self.corners))
        self.shares[0], self.count[0], self.status[0] = 1.0, 1, 0
        rounds = r.variable(0, INTEGER)
        with r.loop() as leave_if:
            square = vector(self.v) @ vector(self.v)
            length = r.square_root(square)
            with r.when(length <= self.scale[0] * TOUCHING):
                self._touch()
            leave_if(self.status[0] > 0)
            self._extend(length)
            rounds[0] = rounds[0] + 1
            self._end(rounds[0] > ROUNDS, LEFT)
            leave_if(self.status[0] > 0)
            self.count[0] = self.count[0] + 1
            self._reduce(square)
            leave_if(self.status[0] > 0)
            self._keep()
        with r.when(self.status[0] >= LEFT):
            self._try_faces()
        with r.when((self.status[0] >= INSIDE) & (self.status[0] <= INSIDE)):
            r.call(
                self.penetration, *self.records, self.pose, self.scale, self.corners, self.vertices, self.result, self.status
            )
        return r.done()

    def _search(self, direction: np.ndarray, place):
        """Corner of D farthest in a direction, as the one of the simplex at a place."""
        put(self.direction, direction)
        at = self.corners.after(place * 3), self.vertices.after(place * 2)
        self.r.call(self.farthest, *self.records, self.pose, self.direction, *at)

    def _end(self, where: Value, status: int):
        """End the search where a condition holds, unless it has ended."""
        with self.r.when(where & (self.status[0] < 1)):
            self.status[0] = status

    def _touch(self):
        """The simplex goes through the origin: the normal of a side with it, if D lies on one side of that."""
        r = self.r
        with r.when((self.count[0] > 1) & (self.count[0] < 3)):
            self._widen()
        a, b, c = (vector(self.corners, 3 * k) for k in range(3))
        across = cross(b - a, c - a)
        size = r.square_root(across @ across)
        for sign in (1.0, -1.0):
            with r.when((self.count[0] > 2) & (self.status[0] < 1)):
                normal = across / (size * sign)
                self._search(-normal, 3)
                low = normal @ vector(self.corners, 9)
                with r.when(low >= self.scale[0] * -ACCEPTED_GAP):
                    self._write(low, normal)
        self._end(self.count[0] > 2, INSIDE)
        self._end(self.status[0] < 1, LEFT)

    def _widen(self):
        """Add a corner of D beside an edge through the origin."""
        r, (a, b) = self.r, (vector(self.corners, 3 * k) for k in range(2))
        edge = b - a
        for direction in (cross(edge, sign * axis) for sign in (1.0, -1.0) for axis in np.eye(3)):
            with r.when(self.count[0] < 3):
                self._search(direction, 2)
                beside, least = cross(vector(self.corners, 6) - a, edge), self.scale[0] * self.scale[0] * LEAST_TRIANGLE
                with r.when(beside @ beside > least * least):
                    self.shares[2], self.count[0] = 0.0, 3

    def _extend(self, length: Value):
        """The corner of D beyond the nearest point; the search ends where there is none."""
        r, k = self.r, self.count[0]
        v = vector(self.v)
        self._search(-v, k)
        low = v @ vector(self.corners, k * 3) / length
        self._end(low > self.reach[0], FAR)
        is_known = r.variable(0, INTEGER)
        with r.each(k) as i:
            same = [
                (self.vertices[i * 2 + s] >= self.vertices[k * 2 + s])
                & (self.vertices[i * 2 + s] <= self.vertices[k * 2 + s])
                for s in (0, 1)
            ]
            is_known[0] = is_known[0] + r.as_integer(same[0] & same[1])
        between = length - low
        is_found = (between <= self.scale[0] * BOUND_GAP) | ((is_known[0] > 0) & (between <= self.scale[0] * ACCEPTED_GAP))
        with r.when(is_found & (self.status[0] < 1)):
            self._write(length, v / length)
        self._end(is_known[0] > 0, LEFT)
        self.shares[k] = 0.0

    def _try_faces(self):
        """Many corners of D in one plane may form triangles without a normal: that of a face of one hull takes its place."""
        r, v, R = self.r, vector(self.v), pose(self.pose)[0]
        length = r.square_root(v @ v)
        for hull, axes, sign in ((self.second, np.eye(3), 1.0), (self.first, R, -1.0)):
            with r.when((self.status[0] >= LEFT) & (hull.face_count > 0)):
                face = hull.face(axes.T @ v * sign)[0]
                normal = axes @ vector(hull.normals, face * 3) * sign
                self._search(-normal, 3)
                low = normal @ vector(self.corners, 9)
                with r.when(r.absolute(length - low) <= self.scale[0] * ACCEPTED_GAP):
                    self._write(low, normal)

    def _write(self, distance: Value, normal: np.ndarray):
        """Result: the point on the second hull by the shares of the corners."""
        r, sums = self.r, [self.r.variable(0.0) for _ in range(3)]
        with r.each(self.count[0]) as i:
            b = vector(self.second.vertices, self.vertices[i * 2 + 1] * 3) * self.shares[i]
            for total, term in zip(sums, b, strict=True):
                total[0] = total[0] + term
        put(self.result, [distance, *normal, *(total[0] for total in sums)])
        self.status[0] = FOUND

    def _reduce(self, square: Value):
        """Side of the simplex nearest to the origin; the search ends where the origin is inside, or no nearer."""
        r, k = self.r, self.count[0]
        best = r.variable(np.inf)
        with r.when(k < 4):
            self._try((0, 1, k - 1), best)
        with r.when(k > 3):
            for *side, other in WITHOUT_FOURTH:
                a, b, c, d = (vector(self.corners, 3 * i) for i in (*side, other))
                normal = cross(b - a, c - a)
                with r.when(~((normal @ (d - a)) * -(normal @ a) > 0.0)):
                    self._try(side, best)
        self._end((k > 3) & ~(best[0] < square), INSIDE)
        self._end(~(best[0] < square), LEFT)

    def _try(self, side, best: Array):
        """Nearest point of a side, if it is nearer than others."""
        r = self.r
        r.call(self.nearest, *(self.corners.after(i * 3) for i in side), self.tried_shares, self.tried)
        v = vector(self.tried)
        square = v @ v
        with r.when(square < best[0]):
            best[0] = square
            put(self.new, v)
            put(self.best_shares, vector(self.tried_shares))
            put(self.side, side)

    def _keep(self):
        """Keep the corners that have shares in the nearest point."""
        r, count = self.r, self.r.variable(0, INTEGER)
        with r.each(3) as i:
            share, k, to = self.best_shares[i], self.side[i], count[0]
            with r.when(share > 0.0):
                put(self.corners, vector(self.corners, k * 3), to * 3)
                put(self.vertices, [self.vertices[k * 2], self.vertices[k * 2 + 1]], to * 2)
                self.shares[to] = share
                count[0] = to + 1
        self.count[0] = count[0]
        put(self.v, vector(self.new))


def write_nearest_points(module: ir.Module) -> ir.Function:
    """Emit ``nearest_points(i64* first, i64* second, double* pose, double* reach, double* result, i64* status)``.

    Poses are those of :data:`gauss.codegen.kernels.hull_points.POSE`, the result that of :data:`NEAREST` in the axes of the
    second hull; status is FOUND, FAR beyond the reach, PLACELESS or LEFT.
    """
    return module.globals.get("nearest_points") or _DistanceWriter(module).write()
