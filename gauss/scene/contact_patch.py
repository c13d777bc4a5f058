"""Contact points of two convex solids without a closed form: nearest points by coal, and the patch of faces that meet.

    distance g and normal n of the nearest points by GJK and EPA; where n is nearly across a face of one solid, the corners
    of the other's face within it, at their heights over it: exact distances of the points that touch next

GJK and EPA: Gilbert, Johnson, Keerthi, IEEE J. Robot. Autom. 4, 1988; van den Bergen, GDC 2001; coal (Montaut et al.,
IEEE Trans. Robot. 40, 2024). Clipping: Sutherland, Hodgman, Comm. ACM 17, 1974.
"""

from functools import lru_cache
from math import dist, inf, isfinite
from typing import NamedTuple

import numpy as np

from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere
from gauss.scene.convex_mesh import MESHES, ConvexMesh, hull_of
from gauss.scene.curved_shapes import Cone, Cylinder, Ellipsoid
from gauss.scene.support_faces import Face, Oval, Polytope, Revolved, Segment

SLOTS = 16  # most contact points of two solids
ACROSS = 0.9  # cosine of the angle of a normal and a face above which its corners may touch next
SAME_DEPTH = 1e-6  # relative to the size of both solids: along its normal a face is as far as the nearest points
TOLERANCE = 1e-10  # of GJK and EPA [m]
TOLERANCE_OF_CURVED = 1e-6  # of EPA, which fails on curved solids with smaller ones [m]
LOOSE_TOLERANCE = 1e-4  # of both, where they fail with those [m]
ITERATIONS = 1000
FAILED = 1e300  # distance that coal gives where it has none [m]


class SolidPose(NamedTuple):
    """Rotation (3, 3) from the axes of a solid to world, and its centre (3,) [m]."""

    R: np.ndarray
    x: np.ndarray


class ContactPoint(NamedTuple):
    """Distance [m], point on the second solid (3,) [m] and normal (3,) out of it."""

    gap: float
    place: np.ndarray
    normal: np.ndarray


Solid = Polytope | Segment | Oval | Revolved
Corner = tuple[float, float, float, float]  # of a polygon over a face, in its axes, and its height [m]


def solid_of(shape: Collider) -> Solid | None:
    """Solid of a shape in its own axes; None for a half-space."""
    if isinstance(shape, HalfSpace):
        return None
    if isinstance(shape, ConvexMesh):
        return _polytope(shape.vertices)
    if isinstance(shape, Box):
        return _box(0.5 * np.array(shape.size))
    if isinstance(shape, Ellipsoid):
        return Oval(shape.half_edges)
    if isinstance(shape, Sphere | Capsule | Points):  # each of several points alone
        return Segment(0.5 * getattr(shape, "length", 0.0), shape.radius)
    assert isinstance(shape, Cylinder | Cone)
    return Revolved(shape.radius, float(shape.half_edges[2]), isinstance(shape, Cone))


@lru_cache(maxsize=MESHES)
def _polytope(vertices: tuple) -> Polytope:
    return Polytope(*hull_of(vertices))


def _box(half: np.ndarray) -> Polytope:
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    loops, normals = [], []
    for axis in range(3):
        for side in (-1, 1):
            j, k = (axis + 1) % 3, (axis + 2) % 3
            order = [(-1, -1), (1, -1), (1, 1), (-1, 1)][::side]
            loops.append(
                np.array([np.flatnonzero((signs[:, [axis, j, k]] == (side, a, b)).all(axis=1))[0] for a, b in order])
            )
            normals.append(side * np.eye(3)[axis])
    return Polytope(signs * half, loops, np.array(normals))


class SolidPair:
    """Contact points of two solids; the second may be a half-space, None."""

    farthest = inf  # distance at which points are found [m]

    def __init__(self, first: Solid, second: Solid | None):
        self.first, self.second = first, second
        self.given: tuple | None = None
        self.is_curved = any(isinstance(solid, Oval | Revolved) for solid in (first, second))
        self.tolerances = (
            (TOLERANCE, TOLERANCE_OF_CURVED if self.is_curved else TOLERANCE),
            (LOOSE_TOLERANCE, LOOSE_TOLERANCE),
        )
        self.size = inf if second is None else first.size + second.size

    def may_touch(self, one: list[float], other: list[float], reach: float) -> bool:
        """Whether the balls around two solids, at centres (3,), are nearer than ``reach`` [m]."""
        return dist(one, other) <= self.size + reach

    def points(self, one: SolidPose, other: SolidPose, reach: float) -> list[ContactPoint]:
        """At most :data:`SLOTS` contact points nearer than ``reach`` [m], of the poses of the two solids."""
        if self.second is None:
            assert isinstance(self.first, Polytope)
            return spread(_below(self.first.vertices, one, other, reach))
        nearest = self.nearest(one, other)
        return [] if nearest.gap > reach else self.around(nearest, one, other, reach)

    def around(self, nearest: ContactPoint, one: SolidPose, other: SolidPose, reach: float) -> list[ContactPoint]:
        """Contact points of the faces that meet at the nearest points, with these; see :meth:`points`."""
        found, across = self.patch(one, other, nearest.normal, reach)
        near = SAME_DEPTH * self.size
        if across >= nearest.gap - near and found and min(point.gap for point in found) <= across + near:
            return spread(found)
        return spread([nearest, *(point for point in found if point.gap > nearest.gap)])

    def nearest(self, one: SolidPose, other: SolidPose) -> ContactPoint:
        """Nearest points, or those of the least way out; ArithmeticError if coal finds none."""
        if self.given is None:
            import coal  # few scenes need it

            assert self.second is not None
            request = coal.DistanceRequest()
            request.enable_signed_distance = True
            request.gjk_max_iterations = request.epa_max_iterations = ITERATIONS
            solids = self.first.in_coal(coal), self.second.in_coal(coal)
            places = coal.Transform3s(), coal.Transform3s()
            self.given = coal.distance, solids, places, request, coal.DistanceResult()
        distance, (first, second), (place, other_place), request, result = self.given
        place.setRotation(one.R)
        place.setTranslation(one.x)
        other_place.setRotation(other.R)
        other_place.setTranslation(other.x)
        for request.gjk_tolerance, request.epa_tolerance in self.tolerances:
            result.clear()
            gap = distance(first, place, second, other_place, request, result)
            normal = -result.normal
            if isfinite(normal.dot(normal)) and abs(gap) < FAILED:
                gap = self._separation(one, other, normal) if self.is_curved else gap
                return ContactPoint(gap, np.array(result.getNearestPoint2()), normal)
        raise ArithmeticError("no nearest points")

    def _separation(self, one: SolidPose, other: SolidPose, normal: np.ndarray) -> float:
        """Distance of the planes across a normal that support both solids: exact to second order in the normal [m]."""
        assert self.second is not None
        height = float(normal @ (one.x - other.x))
        for solid, direction in ((self.first, -(one.R.T @ normal)), (self.second, other.R.T @ normal)):
            face = solid.face(direction)
            height -= float((face.points @ direction).max()) + face.radius
        return height

    def patch(self, one: SolidPose, other: SolidPose, normal: np.ndarray, reach: float) -> tuple[list[ContactPoint], float]:
        """Corners of one face over the other, and the distance of the solids along its normal, as of :meth:`_across` [m]."""
        assert self.second is not None
        toward = -normal.dot(one.R), normal.dot(other.R)
        faces = self.first.face(toward[0]), self.second.face(toward[1])
        cosines = [-1.0 if f.normal is None else f.normal.dot(d) for f, d in zip(faces, toward, strict=True)]
        k = 1 if cosines[1] >= cosines[0] else 0
        if cosines[k] < ACROSS:
            return [], -inf
        own, far, distant = (other, one, self.first) if k else (one, other, self.second)
        face, upward = faces[k], faces[k].normal
        assert upward is not None  # its cosine is not that of an edge
        out = own.R.dot(upward)
        incident = distant.face(-out.dot(far.R))
        seen = incident.points.dot(far.R.T.dot(own.R)) + (far.x - own.x).dot(own.R)
        heights = (seen - face.points[0]).dot(upward).tolist()
        across = self._across(
            min(heights) - incident.radius, out, far, distant, float(out.dot(own.x) + upward.dot(face.points[0]))
        )
        low = _low(seen, heights, face, reach + incident.radius)
        if not low:
            return [], across
        table, up = np.array(low), out if k else -out
        depths = table[:, 3:] if k else incident.radius
        places = own.x + (table[:, :3] - depths * upward).dot(own.R.T)
        return [ContactPoint(p[3] - incident.radius, place, up) for p, place in zip(low, places, strict=True)], across

    def _across(self, height: float, out: np.ndarray, far: SolidPose, distant: Solid, base: float) -> float:
        """Height of a face over another one at ``base``, if it is that of its solid; −∞ if other faces of this are lower."""
        lowest = out.dot(far.x) - base - float(distant.extent(-out.dot(far.R)[None])[0])
        return -inf if height > lowest + SAME_DEPTH * self.size else height


def _below(vertices: np.ndarray, one: SolidPose, plane: SolidPose, reach: float) -> list[ContactPoint]:
    """Vertices of a solid near a half-space."""
    normal = plane.R[:, 2]
    heights = vertices.dot(normal.dot(one.R)) + normal.dot(one.x - plane.x)
    near = heights <= reach
    if not near.any():
        return []
    heights = heights[near]
    places = one.x + vertices[near].dot(one.R.T) - heights[:, None] * normal
    return [ContactPoint(height, place, normal) for height, place in zip(heights.tolist(), places, strict=True)]


def _low(seen: np.ndarray, heights: list[float], face: Face, highest: float) -> list[Corner]:
    """Corners that are no higher than ``highest`` of the part of a polygon, edge or point that is over a face."""
    assert face.sides is not None
    points, closed = list(zip(*seen.T.tolist(), heights, strict=True)), len(heights) > 2
    for side in face.sides.tolist():
        points = _cut(points, side, closed)
    return [point for point in points if point[3] <= highest]


def _cut(points: list[Corner], side: list[float], closed: bool) -> list[Corner]:
    """Part of a polygon or edge on the inner side of a plane."""
    a, b, c, d = side
    depth = [a * x + b * y + c * z + d for x, y, z, _ in points]
    if not points or min(depth) >= 0.0:
        return points
    kept: list[Corner] = []
    for k, p in enumerate(points):
        if depth[k] >= 0.0:
            kept.append(p)
        follows = (k + 1) % len(points)
        if (closed or follows) and (depth[k] < 0.0) != (depth[follows] < 0.0):
            share = depth[k] / (depth[k] - depth[follows])
            (x, y, z, u), (x1, y1, z1, u1) = p, points[follows]
            kept.append((x + share * (x1 - x), y + share * (y1 - y), z + share * (z1 - z), u + share * (u1 - u)))
    return kept


def spread(points: list[ContactPoint]) -> list[ContactPoint]:
    """The deepest point and those farthest out in the plane of contact, where there are too many."""
    if len(points) <= SLOTS:
        return points
    places, gaps = np.array([p.place for p in points]), np.array([p.gap for p in points])
    kept = {int(np.argmin(gaps))}
    flat = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)[2][:2]
    for angle in 2.0 * np.pi / (SLOTS - 1) * np.arange(SLOTS - 1):
        kept.add(int(np.argmax(places @ (np.cos(angle) * flat[0] + np.sin(angle) * flat[1]))))
    return [points[k] for k in sorted(kept)]
