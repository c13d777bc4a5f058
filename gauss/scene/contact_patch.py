"""Contact points of two convex solids without a closed form: nearest points by coal, and the patch of faces that meet.

    distance g and normal n of the nearest points by GJK and EPA; where n is nearly across a face of one solid, the corners
    of the other's face within it, at their heights over it: exact distances of the points that touch next

GJK and EPA: Gilbert, Johnson, Keerthi, IEEE J. Robot. Autom. 4, 1988; van den Bergen, GDC 2001; coal (Montaut et al.,
IEEE Trans. Robot. 40, 2024). Clipping: Sutherland, Hodgman, Comm. ACM 17, 1974.
"""

from math import dist, inf
from typing import NamedTuple

import numpy as np

from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere
from gauss.scene.convex_mesh import ConvexMesh
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


def solid_of(shape: Collider) -> Solid | None:
    """Solid of a shape in its own axes; None for a half-space."""
    if isinstance(shape, HalfSpace):
        return None
    if isinstance(shape, ConvexMesh):
        return Polytope(*shape.hull)
    if isinstance(shape, Box):
        return _box(0.5 * np.array(shape.size))
    if isinstance(shape, Ellipsoid):
        return Oval(shape.half_edges)
    if isinstance(shape, Sphere | Capsule | Points):  # each of several points alone
        return Segment(0.5 * getattr(shape, "length", 0.0), shape.radius)
    assert isinstance(shape, Cylinder | Cone)
    return Revolved(shape.radius, float(shape.half_edges[2]), isinstance(shape, Cone))


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
    """Contact points of two solids.

    Parameters
    ----------
    first, second : Solid or None
        The solids; the second may be a half-space, None.
    """

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
        """At most :data:`SLOTS` contact points nearer than ``reach`` [m].

        Parameters
        ----------
        one, other : SolidPose
            Poses of the two solids.
        reach : float
            Distance [m].
        """
        if self.second is None:
            assert isinstance(self.first, Polytope)
            return spread(_below(self.first.vertices @ one.R.T + one.x, other.x, other.R[:, 2], reach))
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
        """Nearest points, or those of the least way out.

        Raises
        ------
        ArithmeticError
            If coal finds none.
        """
        if self.given is None:
            import coal  # few scenes need it

            assert self.second is not None
            request = coal.DistanceRequest()
            request.enable_signed_distance = True
            request.gjk_max_iterations = request.epa_max_iterations = ITERATIONS
            solids = self.first.in_coal(coal), self.second.in_coal(coal)
            places = coal.Transform3s(), coal.Transform3s()
            self.given = coal.distance, solids, places, request, coal.DistanceResult()
        distance, (first, second), places, request, result = self.given
        for place, pose in zip(places, (one, other), strict=True):
            place.setRotation(pose.R)
            place.setTranslation(pose.x)
        for request.gjk_tolerance, request.epa_tolerance in self.tolerances:
            result.clear()
            gap = distance(first, places[0], second, places[1], request, result)
            normal = -np.array(result.normal)
            if np.isfinite(normal).all() and abs(gap) < FAILED:
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
        """Corners of one face over the other, and the distance of the solids along its normal [m]."""
        assert self.second is not None
        poses, solids = (one, other), (self.first, self.second)
        toward = [pose.R.T @ d for pose, d in zip(poses, (-normal, normal), strict=True)]
        faces = [solid.face(d) for solid, d in zip(solids, toward, strict=True)]
        cosines = [-1.0 if f.normal is None else float(f.normal @ d) for f, d in zip(faces, toward, strict=True)]
        k = 1 if cosines[1] >= cosines[0] else 0
        if cosines[k] < ACROSS:
            return [], -inf
        own, far, face = poses[k], poses[1 - k], faces[k]
        out = own.R @ face.normal
        incident = solids[1 - k].face(-(far.R.T @ out))
        seen = (incident.points @ far.R.T + (far.x - own.x)) @ own.R
        across = float(((seen - face.points[0]) @ face.normal).min()) - incident.radius
        points = _clipped(seen, face)
        heights = (points - face.points[0]) @ face.normal - incident.radius
        low = heights <= reach
        heights, points = heights[low], points[low]
        depths = heights + incident.radius if k == 1 else np.full(heights.size, incident.radius)
        places = own.x + (points - depths[:, None] * face.normal) @ own.R.T
        up = out if k == 1 else -out
        found = [ContactPoint(height, place, up) for height, place in zip(heights.tolist(), places, strict=True)]
        return found, across


def _below(points: np.ndarray, at: np.ndarray, normal: np.ndarray, reach: float) -> list[ContactPoint]:
    """Points near a half-space."""
    heights = (points - at) @ normal
    near = np.flatnonzero(heights <= reach)
    return [ContactPoint(float(heights[k]), points[k] - heights[k] * normal, normal) for k in near]


def _clipped(points: np.ndarray, face: Face) -> np.ndarray:
    """Part of a polygon, edge or point over a face, in its axes."""
    assert face.sides is not None
    depths = points @ face.sides[:, :3].T + face.sides[:, 3]
    kept, closed = points.tolist(), len(points) > 2
    for k in np.flatnonzero((depths < 0.0).any(axis=0)):
        kept = _cut(kept, face.sides[k].tolist(), closed)
    return np.array(kept).reshape(-1, 3)


def _cut(points: list[list[float]], side: list[float], closed: bool) -> list[list[float]]:
    """Part of a polygon or edge on the inner side of a plane."""
    a, b, c, d = side
    depth = [a * x + b * y + c * z + d for x, y, z in points]
    kept: list[list[float]] = []
    for k, p in enumerate(points):
        if depth[k] >= 0.0:
            kept.append(p)
        follows = (k + 1) % len(points)
        if (closed or follows) and (depth[k] < 0.0) != (depth[follows] < 0.0):
            share = depth[k] / (depth[k] - depth[follows])
            kept.append([x + share * (y - x) for x, y in zip(p, points[follows], strict=True)])
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
