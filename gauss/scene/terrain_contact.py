"""Contact points of a height field: with a ball in closed form, with other convex solids by a prism under each triangle.

Of the nearest points of all triangles those count whose normal is one of the surface (:mod:`gauss.scene.terrain`): the
local minima of the distance. A solid deep in the field, where no triangle has such a normal, is pushed out along those of
the triangles over it. Cost follows the cells under a body, whatever the size of the field. Nearest point of a triangle:
Ericson, Real-Time Collision Detection, 2005, sec. 5.1.
"""

from math import dist, sqrt

import numpy as np

from gauss.rotations import cross
from gauss.scene.contact_patch import SLOTS, ContactPoint, Solid, SolidPair, SolidPose
from gauss.scene.support_faces import Polytope, Segment
from gauss.scene.terrain import Terrain, Triangles

PLANE_TOLERANCE = 1e-9  # relative to the size of a solid: places and planes that are the same
LEAST_DEPTH = 4.0  # sizes of the solid that prisms reach below their triangles at least, where the field does
NEAR_SIDE = 1e-5  # of the size of the solid: a place is at the sides or the bottom of the field
ODD = np.array([(0.31, 0.57, 0.76), (0.76, -0.31, 0.57)])  # along which no edges are expected: ties are sorted by rounding
LOOKED_AT = 0.1  # of the size of a solid: up to this distance points are found where no step says how far they may move
DISTANCE = 0.05  # of the size of a solid: points that are no farther from the nearest one are at its place
CLOSED = 1e-5  # of the size of a solid: gaps that differ less have one place in the order of points
FLUSH = 0.9998  # cosine of the angle of two faces that lie on each other
MOST_PRISMS = 4096  # that are kept
CENTRE_DISTANCE = 1e-12  # relative to the size of the field: distance of a centre from the surface that has no direction


class BallOnTerrain:
    """Contact points of a ball and a height field."""

    def __init__(self, ball: Segment, terrain: Terrain):
        self.radius, self.terrain = ball.radius, terrain
        self.farthest = LOOKED_AT * ball.size

    def may_touch(self, one: list[float], other: list[float], reach: float) -> bool:
        """Whether the balls around both, at centres (3,), are nearer than ``reach`` [m]."""
        return dist(one, other) <= self.radius + self.terrain.size + reach

    def points(self, one: SolidPose, other: SolidPose, reach: float) -> list[ContactPoint]:
        """Contact points nearer than ``reach`` [m]: places on the field, normals out of it."""
        terrain, centre = self.terrain, other.R.T @ (one.x - other.x)
        depth = terrain.height(centre) - centre[2]
        far = max(self.radius + reach, depth * (1.0 + PLANE_TOLERANCE))
        near = terrain.under(centre - far, centre + far)
        if not len(near.corners):
            return []
        places = nearest_places(centre, near, terrain.edges)
        out = centre - places
        distances = np.linalg.norm(out, axis=1)
        if depth > 0.0:
            k = int(np.argmin(distances))
            up = -out[k] / distances[k] if distances[k] > CENTRE_DISTANCE * terrain.size else near.normals[k]
            deepest = ContactPoint(-float(distances[k]) - self.radius, other.x + other.R @ places[k], other.R @ up)
            return [deepest] if terrain.margin(centre) > distances[k] else []
        found: dict[tuple, ContactPoint] = {}
        for k in np.flatnonzero(distances <= far).tolist():
            up = out[k] / distances[k] if distances[k] > CENTRE_DISTANCE * terrain.size else near.normals[k]
            if terrain.has_normal(near.corners[k], near.points[k], near.normals[k], places[k], up):
                key = tuple(np.rint(places[k] / (PLANE_TOLERANCE * (self.radius or terrain.size))).tolist())
                gap = float(distances[k]) - self.radius
                found.setdefault(key, ContactPoint(gap, other.x + other.R @ places[k], other.R @ up))
        return _chosen(list(found.values()), self.radius or terrain.size, other.R)


def nearest_places(point: np.ndarray, triangles: Triangles, cell: np.ndarray) -> np.ndarray:
    """Place (m, 3) of each triangle that is nearest to a point, given the edges (2,) of a cell [m]."""
    corners = triangles.points
    edges, out = corners[:, [1, 2, 0]] - corners, point - corners
    share = ((out * edges).sum(axis=2) / (edges * edges).sum(axis=2)).clip(0.0, 1.0)
    on_edges = corners + share[..., None] * edges
    away = point - on_edges
    best = (away * away).sum(axis=2).argmin(axis=1)
    foot = point - (out[:, 0] * triangles.normals).sum(axis=1)[:, None] * triangles.normals
    u, v = ((foot - corners[:, 0])[:, :2] / cell).T
    low, high = np.where(triangles.is_upper, u, v), np.where(triangles.is_upper, v, u)
    within = (low >= 0.0) & (high >= low) & (high <= 1.0)
    return np.where(within[:, None], foot, on_edges[np.arange(len(best)), best])


class SolidOnTerrain:
    """Contact points of a convex solid and a height field."""

    def __init__(self, first: Solid, terrain: Terrain):
        self.first, self.terrain = first, terrain
        self.farthest = LOOKED_AT * first.size
        self.prisms: dict[tuple[int, ...], tuple[SolidPair, np.ndarray]] = {}

    def may_touch(self, one: list[float], other: list[float], reach: float) -> bool:
        """Whether the balls around both, at centres (3,), are nearer than ``reach`` [m]."""
        return dist(one, other) <= self.first.size + self.terrain.size + reach

    def points(self, one: SolidPose, other: SolidPose, reach: float) -> list[ContactPoint]:
        """Contact points nearer than ``reach`` [m]: places on the field, normals out of it.

        ArithmeticError if coal finds no nearest points.
        """
        R, x = other.R.T @ one.R, other.R.T @ (one.x - other.x)
        extents = self.first.extent(np.concatenate([R, -R]))
        near = self.terrain.under(x - extents[3:] - reach, x + extents[:3] + reach)
        if not len(near.corners):
            return []
        heights = np.einsum("ij,ij->i", near.normals, x - near.points[:, 0]) - self.first.extent(-near.normals @ R)
        near = near.where(heights <= reach)
        found: list[ContactPoint] = []
        within: list[ContactPoint] = []
        for corners, points, normal in zip(near.corners, near.points, near.normals, strict=True):
            pair, middle = self._prism(corners, points)
            pose = SolidPose(other.R, other.x + other.R @ middle)
            nearest = pair.nearest(one, pose)
            if nearest.gap > reach:
                continue
            place, direction = other.R.T @ (nearest.place - other.x), other.R.T @ nearest.normal
            if self.terrain.has_normal(corners, points, normal, place, direction):
                found += _beside(pair.around(nearest, one, pose, reach), nearest, min(reach, DISTANCE * self.first.size))
            elif nearest.gap > 0.0:  # another triangle is nearer; the faces that meet here may touch next
                patch = pair.patch(one, pose, nearest.normal, reach)[0]
                found += [
                    p
                    for p in patch
                    if self.terrain.has_normal(
                        corners, points, normal, other.R.T @ (p.place - other.x), other.R.T @ p.normal
                    )
                ]
            elif self.terrain.margin(place) > NEAR_SIDE * self.first.size:
                within += pair.patch(one, pose, other.R @ normal, reach)[0]
        if all(point.gap > 0.0 for point in found):
            found += within
        return _chosen(_outlines(found, PLANE_TOLERANCE * self.first.size), self.first.size, other.R)

    def _prism(self, corners: np.ndarray, points: np.ndarray) -> tuple[SolidPair, np.ndarray]:
        """Solid and prism under a triangle, and the middle of the prism."""
        key = tuple(corners.tolist())
        if key not in self.prisms:
            if len(self.prisms) >= MOST_PRISMS:
                self.prisms.clear()
            bottom = max(self.terrain.base, float(points[:, 2].min()) - LEAST_DEPTH * self.first.size)
            lower = np.column_stack([points[:, :2], np.full(3, bottom)])
            middle = 0.5 * (points.mean(axis=0) + lower.mean(axis=0))
            self.prisms[key] = SolidPair(self.first, _prism(points - middle, lower - middle)), middle
        return self.prisms[key]


def _beside(points: list[ContactPoint], nearest: ContactPoint, near: float) -> list[ContactPoint]:
    """The nearest point and others, without those of other normals at its place: an edge on an edge has one normal."""
    flush = [p for p in points if p.normal @ nearest.normal >= FLUSH] or [nearest]
    return flush + [p for p in points if p.normal @ nearest.normal < FLUSH and dist(p.place, nearest.place) > near]


def _chosen(points: list[ContactPoint], size: float, axes: np.ndarray) -> list[ContactPoint]:
    """The nearest points, and those farthest out along the grid where there are too many, in the order of their places.

    Closed ones come first. So a contact keeps its number from step to step, whatever the distance up to which points are
    looked for.
    """
    near = sorted(points, key=lambda point: (round(point.gap / (CLOSED * size)), *point.place.tolist()))
    if len(near) <= SLOTS:
        return near
    half = SLOTS // 2
    angles = 2.0 * np.pi / half * np.arange(half)
    directions = np.outer(np.cos(angles), axes[:, 0]) + np.outer(np.sin(angles), axes[:, 1])
    far = (np.array([point.place for point in near[half:]]) @ directions.T).argmax(axis=0)
    return near[:half] + [near[half + k] for k in sorted(set(far.tolist()))]


def _prism(upper: np.ndarray, lower: np.ndarray) -> Polytope:
    """Prism between two triangles, both counterclockwise from above."""
    loops = [np.array(loop) for loop in ((0, 1, 2), (5, 4, 3), (3, 4, 1, 0), (4, 5, 2, 1), (5, 3, 0, 2))]
    vertices = np.concatenate([upper, lower])
    across = np.array(
        [np.cross(vertices[b] - vertices[a], vertices[c] - vertices[b]) for a, b, c in (loop[:3] for loop in loops)]
    )
    return Polytope(vertices, loops, across / np.linalg.norm(across, axis=1)[:, None])


def _outlines(points: list[ContactPoint], near: float) -> list[ContactPoint]:
    """Points without those that lie, in a plane of contact, between others of it: distances are linear there."""
    planes: dict[tuple, dict[tuple, ContactPoint]] = {}
    for point in points:
        key = *np.rint(point.normal / PLANE_TOLERANCE).tolist(), round(float(point.normal @ point.place) / near)
        planes.setdefault(key, {}).setdefault(tuple(np.rint(point.place / near).tolist()), point)
    return [point for plane in planes.values() for point in _outline(list(plane.values()), near)]


def _outline(points: list[ContactPoint], near: float) -> list[ContactPoint]:
    """Corners of the convex hull of points of a plane (Andrew, Inf. Process. Lett. 9, 1979)."""
    if len(points) < 3:
        return points
    normal = points[0].normal
    first = max((cross(normal, odd) for odd in ODD), key=lambda axis: axis @ axis)
    axes = np.array([first, cross(normal, first)]) / sqrt(first @ first)
    plane = (np.array([point.place for point in points]) @ axes.T).tolist()
    order = sorted(range(len(plane)), key=plane.__getitem__)
    chains = _chain(order, plane, near)[:-1] + _chain(order[::-1], plane, near)[:-1]
    return [points[k] for k in dict.fromkeys(chains)]


def _chain(order: list[int], plane: list[list[float]], near: float) -> list[int]:
    """Lower half of a hull; points nearer to its sides than ``near`` are left out."""
    kept: list[int] = []
    for k in order:
        is_within = False
        while len(kept) > 1 and not is_within:
            height, share = _seen(*(plane[i] for i in (kept[-2], kept[-1], k)))
            if height > near:
                break
            is_within = height >= -near and share > 1.0
            if not is_within:
                kept.pop()
        if not is_within:
            kept.append(k)
    return kept


def _seen(a: list[float], b: list[float], c: list[float]) -> tuple[float, float]:
    """Distance of b to the right of the line from a to c, and its share of the way; zero where b lies between equal ones."""
    x, y, u, v = c[0] - a[0], c[1] - a[1], b[0] - a[0], b[1] - a[1]
    square = x * x + y * y
    return ((u * y - v * x) / sqrt(square), (u * x + v * y) / square) if square else (0.0, 0.0)
