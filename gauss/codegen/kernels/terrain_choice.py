"""Choice of the contact points with terrain in machine code: outlines, their order, and the ones that are kept of many.

The rules are those of ``chosen`` in :mod:`gauss.scene.terrain_contact`: points between others of their plane are left out,
for distances are linear there. Corners of the convex hull of points of a plane: Andrew, Inf. Process. Lett. 9, 1979.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Value, name_with, subroutine
from gauss.codegen.kernels.hull_points import cross, vector
from gauss.codegen.kernels.patch_rows import POINT

MOST_RAW = 512  # points before


class _OutlineWriter:
    """Writer of ``outlines``.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Where code is emitted.
    name : str
        Name of the function there.
    same : float
        Difference of normals of one plane.
    odd : tuple
        Directions along which no edges are expected.
    """

    def __init__(self, module: ir.Module, name: str, same: float, odd: tuple):
        r = self.r = subroutine(module, name, [POINTER, INTEGER, POINTER, INTEGERS])
        (self.total,), (self.points, given, self.kept) = r.integers, r.arrays
        self.near, self.same, self.odd = given[0], same, odd
        self.group, self.leader = r.buffer(MOST_RAW, INTEGER), r.buffer(MOST_RAW, INTEGER)
        self.plane, self.order, self.chain = r.buffer(2 * MOST_RAW), r.buffer(MOST_RAW, INTEGER), r.buffer(MOST_RAW, INTEGER)
        self.groups, self.members, self.length = (r.variable(0, INTEGER) for _ in range(3))

    def write(self) -> ir.Function:
        r = self.r
        self.groups[0] = 0
        with r.each(self.total) as i:
            self.kept[i], self.group[i] = 0, -1
            with r.each(self.groups[0]) as g, r.when(self.group[i] < 0), r.when(self._is_of(i, self.leader[g])):
                self.group[i] = g
            with r.when(self.group[i] < 0):
                self.group[i], self.leader[self.groups[0]] = self.groups[0], i
                self.groups[0] = self.groups[0] + 1
        with r.each(self.groups[0]) as g:
            self._sort(g)
            with r.each(2) as turned:
                self._mark(turned)
        with r.each(self.total) as i, r.when(self.kept[i] > 0), r.each(i) as k:
            is_again = (self.kept[k] > 0) & (self.group[k] <= self.group[i]) & (self.group[k] >= self.group[i])
            with r.when(is_again & self._is_at(i, k)):
                self.kept[i] = 0
        return r.done()

    def _point(self, i: Value) -> tuple[np.ndarray, np.ndarray]:
        """Place and normal."""
        return vector(self.points, i * POINT + 1), vector(self.points, i * POINT + 4)

    def _is_small(self, out: np.ndarray, least) -> Value:
        a, b, c = (self.r.absolute(part) <= least for part in out)
        return a & b & c

    def _is_at(self, i: Value, k: Value) -> Value:
        return self._is_small(self._point(i)[0] - self._point(k)[0], self.near)

    def _is_of(self, i: Value, leader: Value) -> Value:
        """Whether a point is of the plane of another."""
        (place, normal), (base, upward) = self._point(i), self._point(leader)
        return self._is_small(normal - upward, self.same) & (self.r.absolute(upward @ (place - base)) <= self.near)

    def _sort(self, g: Value):
        """Coordinates in their plane of the points of a group, and their order by these."""
        r, (base, normal) = self.r, self._point(self.leader[g])
        one, other = (cross(normal, np.array(odd)) for odd in self.odd)
        first = np.array([r.choose(other @ other > one @ one, y, x) for x, y in zip(one, other, strict=True)])
        length = r.square_root(first @ first)
        axes = first / length, cross(normal, first) / length
        self.members[0] = 0
        with r.each(self.total) as i, r.when((self.group[i] >= g) & (self.group[i] <= g)):
            out = self._point(i)[0] - base
            u, v = (out @ axis for axis in axes)
            self.plane[i * 2], self.plane[i * 2 + 1] = u, v
            place = r.variable(0, INTEGER)
            place[0] = self.members[0]
            with r.loop() as leave_if:
                leave_if(place[0] < 1)
                before = self.order[place[0] - 1]
                a, b = self.plane[before * 2], self.plane[before * 2 + 1]
                leave_if((a < u) | ((a <= u) & (b <= v)))
                self.order[place[0]] = before
                place[0] = place[0] - 1
            self.order[place[0]] = i
            self.members[0] = self.members[0] + 1

    def _mark(self, turned: Value):
        """Keep the corners of the lower half of a hull, or of the upper one, but its last."""
        r, count, length = self.r, self.members[0], self.length
        length[0] = 0
        with r.each(count) as k:
            point = self.order[k + turned * (count - 1 - k * 2)]
            is_within = r.variable(0, INTEGER)
            with r.loop() as leave_if:
                leave_if((length[0] < 2) | (is_within[0] > 0))
                height, share = self._seen(self.chain[length[0] - 2], self.chain[length[0] - 1], point)
                leave_if(height > self.near)
                is_within[0] = r.as_integer((height >= -self.near) & (share > 1.0))
                with r.when(is_within[0] < 1):
                    length[0] = length[0] - 1
            with r.when(is_within[0] < 1):
                self.chain[length[0]] = point
                length[0] = length[0] + 1
        with r.each(r.choose(length[0] > 1, length[0] - 1, length[0])) as k:
            self.kept[self.chain[k]] = 1

    def _seen(self, i: Value, k: Value, m: Value) -> tuple[Value, Value]:
        """Distance of the second point to the right of the line from the first to the third, and its share of the way."""
        r, (a, b, c) = self.r, ([self.plane[n * 2], self.plane[n * 2 + 1]] for n in (i, k, m))
        x, y, u, v = c[0] - a[0], c[1] - a[1], b[0] - a[0], b[1] - a[1]
        square = x * x + y * y
        is_line = square > 0.0
        return (
            r.choose(is_line, (u * y - v * x) / r.square_root(square), 0.0),
            r.choose(is_line, (u * x + v * y) / square, 0.0),
        )


def write_outlines(module: ir.Module, same: float, odd: tuple) -> ir.Function:
    """Emit ``outlines(double* points, i64 total, double* near, i64* kept)``: 1 for points that are kept, 0 for others."""
    name = name_with("outlines", same, odd)
    return module.globals.get(name) or _OutlineWriter(module, name, same, odd).write()


class _ChoiceWriter:
    def __init__(self, module: ir.Module, name: str, laws):
        r = self.r = subroutine(module, name, [POINTER, INTEGER, POINTER, INTEGERS, INTEGERS])
        (self.total,), (self.points, self.settings, self.chosen, self.count) = r.integers, r.arrays
        self.laws, self.kept, self.order = laws, r.buffer(MOST_RAW, INTEGER), r.buffer(MOST_RAW, INTEGER)
        self.level, self.number = r.buffer(MOST_RAW), r.variable(0, INTEGER)

    def write(self) -> ir.Function:
        r, slots = self.r, self.laws.slots
        r.call(write_outlines(r.module, self.laws.same, self.laws.odd), self.points, self.total, self.settings, self.kept)
        self.number[0], self.count[0] = 0, 0
        with r.each(self.total) as i, r.when(self.kept[i] > 0):
            self._insert(i)
        with r.each(self.number[0]) as k:
            self.kept[k] = r.as_integer((self.number[0] <= slots) | (k < slots // 2))
        with r.when(self.number[0] > slots):
            for angle in 2.0 * np.pi / (slots // 2) * np.arange(slots // 2):
                self._keep_farthest(vector(self.settings, 2) * np.cos(angle) + vector(self.settings, 5) * np.sin(angle))
        with r.each(self.number[0]) as k, r.when((self.kept[k] > 0) & (self.count[0] < slots)):
            self.chosen[self.count[0]] = self.order[k]
            self.count[0] = self.count[0] + 1
        return r.done()

    def _insert(self, i: Value):
        """Put a point in its place of the order by gaps, then by places."""
        r = self.r
        self.level[i] = r.as_double(r.floor(self._bounded(self.points[i * POINT] / self.settings[1]) + 0.5))
        place = r.variable(0, INTEGER)
        place[0] = self.number[0]
        with r.loop() as leave_if:
            leave_if(place[0] < 1)
            before = self.order[place[0] - 1]
            leave_if(self._is_before(before, i))
            self.order[place[0]] = before
            place[0] = place[0] - 1
        self.order[place[0]] = i
        self.number[0] = self.number[0] + 1

    def _bounded(self, x: Value) -> Value:
        """A double that an integer holds."""
        r, most = self.r, self.r.number(2.0**60)
        return r.maximum(-r.maximum(-x, -most), -most)

    def _is_before(self, k: Value, i: Value) -> Value:
        """Whether a point comes before another one, or is equal."""
        (a, *p), (b, *q) = ([self.level[n], *vector(self.points, n * POINT + 1)] for n in (k, i))
        found = p[2] <= q[2]
        for one, other in ((p[1], q[1]), (p[0], q[0]), (a, b)):
            found = (one < other) | ((one <= other) & found)
        return found

    def _keep_farthest(self, direction: np.ndarray):
        """Keep the one of the later points that is farthest in a direction."""
        r, most, place = self.r, self.r.variable(-np.inf), self.r.variable(0, INTEGER)
        with r.each(self.number[0], self.laws.slots // 2) as k:
            height = vector(self.points, self.order[k] * POINT + 1) @ direction
            with r.when(height > most[0]):
                most[0], place[0] = height, k
        self.kept[place[0]] = 1


def write_choice(module: ir.Module, laws) -> ir.Function:
    """Emit ``choice(double* points, i64 total, double* settings, i64* chosen, i64* count)``.

    Settings are the distance of places that are the same, and of gaps that have one place in the order; two axes (3,) of the
    field along its grid.
    """
    name = name_with("choice", laws.same, laws.odd, laws.slots)
    return module.globals.get(name) or _ChoiceWriter(module, name, laws).write()
