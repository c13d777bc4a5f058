"""Distances of the contact points of a height field and a ball, or a convex hull thickened by a radius, in machine code.

The points are those of :mod:`gauss.scene.terrain_contact`, which is tried where a search for nearest points has no
certificate. Where what is lowest of a hull, along the normal of a triangle, is over it, no search is needed:

    gap = height of that over the plane of the triangle, a plane that keeps both apart
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, NativeFunction, Writer
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, routine
from gauss.codegen.kernels.hull_distance import FOUND, LEFT, NEAREST
from gauss.codegen.kernels.hull_pairs import PointsWriter, array_at, given_poses
from gauss.codegen.kernels.hull_patch import HIGH, ROOM, write_patch
from gauss.codegen.kernels.hull_points import POSE, Hull, put, vector, write_nearest
from gauss.codegen.kernels.near_pairs import FAR_AWAY, HULL_INPUTS, PATCH, REACH, RECORDS, UNKNOWN
from gauss.codegen.kernels.patch_rows import POINT
from gauss.codegen.kernels.terrain_choice import MOST_RAW, write_choice
from gauss.codegen.kernels.terrain_prism import Prism
from gauss.codegen.kernels.terrain_surface import Surface, Triangle, TriangleMemory

AROUND, OVER, WITHIN = 0, 1, 2  # which points count: those at the nearest one; those with normals of the surface; within it
MARGIN = 2.0  # depths of a point from the sides of its prism: no way out is shorter than that upward


class TerrainLaws(NamedTuple):
    """Tolerances of :mod:`gauss.scene.terrain_contact`, :mod:`gauss.scene.terrain` and :mod:`gauss.scene.contact_patch`."""

    same: float
    tiny: float
    least_depth: float
    near_side: float
    beside: float
    flush: float
    closed: float
    odd: tuple[tuple[float, ...], ...]
    aligned: float
    on_edge: float
    across: float
    same_depth: float
    slots: int


class _TerrainWriter(PointsWriter):
    """Writer of the points of a hull and a height field, in the axes of this."""

    def __init__(self, r: Routine, given, found, laws: TerrainLaws):
        self.laws, self.found, self.world = laws, found, given_poses(given)
        self.points_out = array_at(r, given[PATCH], found.pointer.type)
        records = [array_at(r, given[place], INTEGERS) for place in (RECORDS, RECORDS + 1)]
        (one, other), (x, y) = self.world
        self.rotation, self.centre = other.T @ one, other.T @ (x - y)
        self.hull, self.surface, self.prism = Hull(r, records[0]), Surface(r, records[1]), Prism(r)
        poses = [self.rotation, np.eye(3)], [self.centre, np.zeros(3)]
        super().__init__(r, [records[0], self.prism.record], *poses, given[REACH])
        self.points, self.within = r.buffer(POINT * MOST_RAW), r.buffer(POINT * MOST_RAW)
        self.total, self.inner, self.closed = (r.variable(0, INTEGER) for _ in range(3))
        self.left, self.flush = r.variable(0, INTEGER), r.variable(0, INTEGER)
        self.memory = TriangleMemory(r, self.surface, (laws.aligned, laws.on_edge))
        self.mode, self.nearest_place, self.nearest_normal = r.variable(AROUND, INTEGER), r.buffer(3), r.buffer(3)

    def add(self, gap: Value, place: np.ndarray, normal: np.ndarray):
        """Add a point, given around the middle of the prism, if it counts."""
        r, place, counts = self.r, place + vector(self.middle), self.r.variable(1, INTEGER)
        self.count[0] = self.count[0] + 1
        with r.when(self.mode[0] < OVER):
            between, near = place - vector(self.nearest_place), self._least(self.hull.size * self.laws.beside, self.reach)
            is_flush = normal @ vector(self.nearest_normal) >= self.laws.flush
            counts[0] = r.as_integer(is_flush | (between @ between > near * near))
            self.flush[0] = self.flush[0] + r.as_integer(is_flush)
        with r.when((self.mode[0] >= OVER) & (self.mode[0] < WITHIN)):
            counts[0] = r.as_integer(self.memory.has_normal(place, normal))
        with r.when(counts[0] > 0):
            with r.when(self.mode[0] < WITHIN):
                self._store(self.points, self.total, gap, place, normal)
                self.closed[0] = self.closed[0] + r.as_integer(gap <= 0.0)
            with r.when(self.mode[0] >= WITHIN):
                self._store(self.within, self.inner, gap, place, normal)

    def _least(self, x: Value, y: Value) -> Value:
        return -self.r.maximum(-x, -y)

    def _store(self, points: Array, count: Array, gap: Value, place: np.ndarray, normal: np.ndarray):
        with self.r.when(count[0] >= MOST_RAW):
            self.left[0] = 1
        with self.r.when(count[0] < MOST_RAW):
            put(points, [gap, *place, *normal], count[0] * POINT)
            count[0] = count[0] + 1

    def _extent(self, direction: np.ndarray) -> Value:
        """Farthest that the hull reaches in a direction from its centre."""
        own = self.rotation.T @ direction
        return vector(self.hull.vertices, self.hull.farthest(own) * 3) @ own + self.hull.radius

    def write_ball(self):
        """Nearest places of all triangles that are local minima of the distance; under the surface, the nearest one."""
        r, surface, centre, laws = self.r, self.surface, self.centre, self.laws
        nearest, shares, foot, corners = write_nearest(r.module), r.buffer(3), r.buffer(3), r.buffer(9)
        depth, least = r.variable(-np.inf), r.variable(np.inf)
        with r.when(surface.is_over(centre)):
            depth[0] = surface.height(centre) - centre[2]
        radius = self.hull.radius
        far = r.maximum(radius + self.reach, depth[0] * (1.0 + laws.same))
        is_under = depth[0] > 0.0
        with surface.under(list(centre - far), list(centre + far)) as triangle:
            put(corners, (triangle.points - centre).ravel())
            r.call(nearest, *(corners.after(3 * k) for k in range(3)), shares, foot)
            out = -vector(foot)
            distance = r.square_root(out @ out)
            is_clear = distance > surface.size * laws.tiny
            ways = [r.choose(is_under, -part, part) / distance for part in out]
            up = np.array([r.choose(is_clear, *pair) for pair in zip(ways, triangle.normal, strict=True)])
            place = centre - out
            with r.when(is_under & (distance < least[0])):
                least[0], self.total[0] = distance, 0
                self._store(self.points, self.total, -distance - radius, place, up)
            with r.when(~is_under & (distance <= far)):
                self.memory.put(triangle)
                with r.when(self.memory.has_normal(place, up)):
                    self._store(self.points, self.total, distance - radius, place, up)
        with r.when(is_under & ~(surface.margin(centre) > least[0])):
            self.total[0] = 0
        self._finish(r.choose(radius > 0.0, radius, surface.size))

    def write_hull(self):
        """Points of all triangles under the box around the hull."""
        r, x, reach = self.r, self.centre, self.reach
        high = [x[k] + self._extent(np.eye(3)[k]) + reach for k in range(3)]
        low = [x[k] - self._extent(-np.eye(3)[k]) - reach for k in range(3)]
        self.poses = r.buffer(POSE), r.buffer(POSE)
        self.middle, self.bottom = r.buffer(3), r.variable(0.0)
        with self.surface.under(low, high) as triangle:
            height = triangle.normal @ (x - triangle.points[0]) - self._extent(-triangle.normal)
            with r.when((height <= reach) & (self.left[0] < 1) & self._is_beside(triangle)):
                self._meet(triangle)
        with r.when(self.closed[0] < 1), r.each(self.inner[0]) as k:
            point = self.within.after(k * POINT)
            self._store(self.points, self.total, point[0], vector(point, 1), vector(point, 4))
        with r.when(self.hull.vertex_count < 1):
            self.left[0] = 1
        self._finish(self.hull.size)

    def _is_beside(self, triangle: Triangle) -> Value:
        """Whether no upright plane through an edge keeps the hull away."""
        r, x, apart = self.r, self.centre, self.r.number(-np.inf)
        for k in range(3):
            a, b = triangle.points[k], triangle.points[(k + 1) % 3]
            across = np.array([b[1] - a[1], a[0] - b[0], r.number(0.0)])
            out = across / r.square_root(across[0] * across[0] + across[1] * across[1])
            apart = r.maximum(apart, out @ (x - a) - self._extent(-out))
        return apart <= self.reach

    def _meet(self, triangle: Triangle):
        """Points of the hull and the prism under a triangle."""
        r, surface, points = self.r, self.surface, triangle.points
        lowest = self._least(self._least(points[0][2], points[1][2]), points[2][2])
        self.bottom[0] = r.maximum(surface.base, lowest - self.hull.size * self.laws.least_depth)
        self.memory.put(triangle)
        put(self.middle, self.prism.begin(points, triangle.normal, self.bottom[0]))
        R, x = self.rotation, self.centre - vector(self.middle)
        put(self.poses[0], [*R.ravel(), *x])
        put(self.poses[1], [*R.T.ravel(), *(-(R.T @ x))])
        self.x = [x, np.zeros(3)]
        is_met = r.variable(0, INTEGER)
        self._meet_above(is_met)
        with r.when(is_met[0] < 1):
            self.prism.complete()
            self._meet_anywhere()

    def _meet_above(self, is_met: Array):
        """Points over the triangle, if the lowest ones of the hull along its normal are among them."""
        r, hull, normal = self.r, self.hull, vector(self.memory.points, 9)
        seen, count, lowest = r.buffer(HIGH * ROOM), r.variable(0, INTEGER), r.buffer(2)
        face = Value(r.b, INTEGER(0))
        r.call(write_patch(r.module), self.prism.record, face, self.records[0], self.poses[0], seen, count, lowest)
        least, sums, number = r.variable(np.inf), [r.variable(0.0) for _ in range(3)], r.variable(0.0)
        with r.each(count[0]) as i:
            least[0] = self._least(seen[i * HIGH + 3], least[0])
        near = (hull.size + self.prism.numbers[1]) * self.laws.same
        with r.each(count[0]) as i, r.when(seen[i * HIGH + 3] <= least[0] + near):
            number[0] = number[0] + 1.0
            for total, part in zip(sums, vector(seen, i * HIGH), strict=True):
                total[0] = total[0] + part
        middle = np.array([total[0] / number[0] for total in sums])
        sides = [vector(self.prism.side(k)) @ middle + self.prism.side(k)[3] for k in range(3)]
        margin = self._least(self._least(*sides[:2]), sides[2]) * normal[2]
        margin = self._least(margin, middle[2] + self.middle[2] - self.bottom[0])
        is_lowest = (least[0] <= lowest[1] + near) & (number[0] > 0.0)
        with r.when(is_lowest & ((least[0] >= 0.0) | (margin >= least[0] * -MARGIN))):
            is_met[0], self.mode[0] = 1, AROUND
            put(self.nearest_normal, normal)
            with r.each(count[0]) as i:
                gap = seen[i * HIGH + 3] - hull.radius
                with r.when(gap <= self.reach):
                    self.add(gap, vector(seen, i * HIGH) - normal * (gap + hull.radius), normal)

    def _meet_anywhere(self):
        """Points at the nearest ones, by a search for these; else of faces that may touch next, or within the field."""
        r, laws, hulls = self.r, self.laws, (self.hull, Hull(self.r, self.prism.record))
        nearest, status, reach = r.buffer(NEAREST), r.variable(0, INTEGER), r.buffer(1)
        reach[0], status[0] = self.reach + self.hull.radius, LEFT
        self.search(self.poses[0], reach, nearest, status)
        gap, normal = nearest[0] - self.hull.radius, vector(nearest, 1)
        with r.when(status[0] >= LEFT):
            self.left[0] = 1
        with r.when((status[0] <= FOUND) & (gap <= self.reach)):
            around, upward = vector(nearest, 4), vector(self.memory.points, 9)
            place, size = around + vector(self.middle), self.hull.size
            put(self.nearest_place, place)
            put(self.nearest_normal, normal)
            has_normal = self.memory.has_normal(place, normal)
            with r.when(has_normal):
                self.mode[0], self.count[0], self.flush[0] = AROUND, 0, 0
                near = (size + self.prism.numbers[1]) * laws.same_depth
                self.write_patch(hulls, self.poses, (gap, around, normal), laws.across, near)
                with r.when(self.flush[0] < 1):
                    self.add(gap, around, normal)
            is_apart = gap > 0.0  # another triangle is nearer; the faces that meet here may touch next
            with r.when(~has_normal & (is_apart | (self.surface.margin(place) > size * laws.near_side))):
                across = np.array([r.choose(is_apart, a, b) for a, b in zip(normal, upward, strict=True)])
                self.mode[0] = WITHIN
                with r.when(is_apart):
                    self.mode[0] = OVER
                for k, radius, out, (seen, count, _) in self.faces(hulls, self.poses, across, laws.across):
                    with r.each(count[0]) as i:
                        height, corner, up = self.corner(k, radius, out, seen, i)
                        with r.when(height <= self.reach):
                            self.add(height, corner, up)

    def _finish(self, size: Value):
        """Choose from the points, and move these to world axes."""
        r, laws, (R, x) = self.r, self.laws, (part[1] for part in self.world)
        with r.each(laws.slots) as k:
            self.found[k] = FAR_AWAY
        with r.each(self.total[0]) as k:
            point = self.points.after(k * POINT)
            put(point, [*(x + R @ vector(point, 1)), *(R @ vector(point, 4))], 1)
        settings = r.buffer(8)
        put(settings, [size * laws.same, size * laws.closed, *R[:, 0], *R[:, 1]])
        chosen, count = r.buffer(laws.slots, INTEGER), r.variable(0, INTEGER)
        r.call(write_choice(r.module, laws), self.points, self.total[0], settings, chosen, count)
        with r.each(count[0]) as k:
            r.copy(self.points_out.after(k * POINT), self.points.after(chosen[k] * POINT), POINT)
            self.found[k] = self.points[chosen[k] * POINT]
        with r.when((self.left[0] > 0) | ~(self.centre @ self.centre < np.inf)):
            self.found[0] = UNKNOWN


class TerrainDistances(NativeFunction):
    """Distances of the points of a hull and terrain, as of :class:`gauss.codegen.kernels.hull_pairs.HullDistances`.

    Parameters
    ----------
    laws : TerrainLaws
        Tolerances.
    is_ball : bool
        Whether the hull is a point thickened by a radius.
    """

    def __init__(self, laws: TerrainLaws, is_ball: bool):
        self.laws, self.is_ball = laws, is_ball
        self.name = "ball_on_terrain" if is_ball else "hull_on_terrain"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return HULL_INPUTS, self.laws.slots

    def operations(self) -> dict[str, int]:
        """None that are known before: they depend on the hull and the field."""
        return {}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one pair at a time."""
        r, given, found = routine(self, writer.module, width)
        points = _TerrainWriter(r, given, found, self.laws)
        if self.is_ball:
            points.write_ball()
        else:
            points.write_hull()
        return r.done()
