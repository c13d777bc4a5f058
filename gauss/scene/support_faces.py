"""Convex solids in numbers: the face, edge or point by which each touches in a direction, and its geometry in coal.

A solid lies in its own axes around its centre. Its face of a direction is a polygon with an outward normal, an edge or a
point without one, thickened by a radius.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

RIM_POINTS = 8  # of a flat end: corners of the polygon that stands for it
TINY = 1e-30


class Face(NamedTuple):
    """Polygon, edge or point of a solid."""

    points: np.ndarray  # (k, 3) its corners in order, counterclockwise seen from outside [m]
    normal: np.ndarray | None  # outward normal of a polygon
    # inward normals of its sides in its plane, and their distances from the centre of the solid [m]: n · p + d ≥ 0 inside
    sides: np.ndarray | None = None
    radius: float = 0.0  # thickness around it [m]


def polygon(points: np.ndarray, normal: np.ndarray) -> Face:
    """Face with its sides."""
    return Face(points, normal, sides_of(points, np.roll(points, -1, axis=0), normal))


def sides_of(points: np.ndarray, following: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Sides (k, 4), as of :class:`Face`, from corners (k, 3) to the following ones, of faces with outward normals."""
    inward = np.cross(normals, following - points)
    inward = inward / np.linalg.norm(inward, axis=1)[:, None]
    return np.column_stack([inward, -np.einsum("ij,ij->i", inward, points)])


class Polytope:
    """Hull of points: vertices, loops and normals as of :attr:`gauss.scene.ConvexMesh.hull`."""

    def __init__(self, vertices: np.ndarray, loops: list[np.ndarray], normals: np.ndarray):
        self.vertices, self.normals = vertices, normals
        self.size = float(np.linalg.norm(vertices, axis=1).max())  # radius of the ball around it [m]
        counts = np.array([len(loop) for loop in loops])
        self.first_corner = np.append(0, counts.cumsum())  # of each face, among all corners; their number at the end
        following = np.arange(1, self.first_corner[-1] + 1)
        following[self.first_corner[1:] - 1] = self.first_corner[:-1]
        points = vertices[np.concatenate(loops)]
        self.corners = np.column_stack([points, sides_of(points, points[following], np.repeat(normals, counts, axis=0))])

    def face(self, direction: np.ndarray) -> Face:
        """Face most nearly across a direction."""
        return self.faces(int(self.normals.dot(direction).argmax()))

    def faces(self, k: int) -> Face:
        """Face by its number."""
        corners = self.corners[self.first_corner[k] : self.first_corner[k + 1]]
        return Face(corners[:, :3], self.normals[k], corners[:, 3:])

    def extent(self, directions: np.ndarray) -> np.ndarray:
        """Farthest that it reaches along directions (k, 3) from its centre [m]."""
        return (directions @ self.vertices.T).max(axis=1)

    def in_coal(self, coal):
        """Convex hull of its vertices."""
        points = coal.StdVec_Vec3s()
        for vertex in self.vertices:
            points.append(vertex)
        return coal.Convex.convexHull(points, True, "Qt")


class Segment:
    """Ball or capsule: a point or edge along the last axis with a radius."""

    def __init__(self, half: float, radius: float):
        self.half, self.radius, self.size = half, radius, half + radius
        ends = (-half, half) if half else (0.0,)
        self.points = np.array([[0.0, 0.0, z] for z in ends])

    def face(self, direction: np.ndarray) -> Face:
        """The edge or point itself."""
        return Face(self.points, None, radius=self.radius)

    def extent(self, directions: np.ndarray) -> np.ndarray:
        """Farthest that it reaches along unit vectors (k, 3) from its centre [m]."""
        return self.half * np.abs(directions[:, 2]) + self.radius

    def in_coal(self, coal):
        """Sphere or capsule."""
        return coal.Capsule(self.radius, 2.0 * self.half) if self.half else coal.Sphere(self.radius)


class Oval:
    """Ellipsoid."""

    def __init__(self, radii: np.ndarray):
        self.radii, self.size = radii, float(radii.max())

    def face(self, direction: np.ndarray) -> Face:
        """Farthest point along the direction."""
        stretched = self.radii * direction
        return Face((self.radii * stretched / np.sqrt(stretched @ stretched + TINY))[None], None)

    def extent(self, directions: np.ndarray) -> np.ndarray:
        """Farthest that it reaches along directions (k, 3) from its centre [m]."""
        return np.linalg.norm(self.radii * directions, axis=1)

    def in_coal(self, coal):
        """Ellipsoid."""
        return coal.Ellipsoid(*map(float, self.radii))


class Revolved:
    """Cylinder or cone: flat ends, and an edge of its side; a pointed one has its apex on the positive side."""

    def __init__(self, radius: float, half: float, pointed: bool):
        self.radius, self.half, self.pointed, self.size = radius, half, pointed, float(np.hypot(radius, half))
        steep = np.hypot(2.0 * half, radius)
        self.slope = (2.0 * half / steep, radius / steep) if pointed else (1.0, 0.0)

    def face(self, direction: np.ndarray) -> Face:
        """The flat end or the edge of the side most nearly across the direction; an end has a corner along it."""
        x, y, z = direction
        across = np.hypot(x, y)
        out = np.array([x, y, 0.0]) / across if across > TINY else np.array([1.0, 0.0, 0.0])
        side = self.slope[0] * across + self.slope[1] * z
        if (-z if self.pointed else abs(z)) <= side:
            top = np.zeros(3) if self.pointed else self.radius * out
            return Face(np.array([self.radius * out - [0.0, 0.0, self.half], top + [0.0, 0.0, self.half]]), None)
        end = -1.0 if self.pointed or z < 0.0 else 1.0
        turn = np.array([[out[0], out[1], 0.0], [-end * out[1], end * out[0], 0.0], [0.0, 0.0, end]])
        sides = np.column_stack([self.end.sides[:, :3] @ turn, self.end.sides[:, 3]])  # type: ignore[index]
        return Face(self.end.points @ turn, turn[2], sides)

    def extent(self, directions: np.ndarray) -> np.ndarray:
        """Farthest that it reaches along directions (k, 3) from its centre [m]."""
        along, rim = self.half * directions[:, 2], self.radius * np.hypot(directions[:, 0], directions[:, 1])
        return np.maximum(along, rim - along) if self.pointed else np.abs(along) + rim

    @cached_property
    def end(self) -> Face:
        """Flat end on the positive side, with a corner on the first axis."""
        angles = 2.0 * np.pi / RIM_POINTS * np.arange(RIM_POINTS)
        points = [self.radius * np.cos(angles), self.radius * np.sin(angles), np.full(RIM_POINTS, self.half)]
        return polygon(np.array(points).T, np.array([0.0, 0.0, 1.0]))

    def in_coal(self, coal):
        """Cylinder or cone."""
        return (coal.Cone if self.pointed else coal.Cylinder)(self.radius, 2.0 * self.half)
