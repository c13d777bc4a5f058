"""Collision shape of points: their convex hull, with the faces of a mesh where these are given."""

from collections.abc import Sized
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.curved_shapes import ConvexCollider

LEAST_EXTENT = 1e-9  # least extent of a solid, relative to its largest
MESHES = 256  # hulls that are kept
COPLANAR = 1e-7  # difference of normals and of relative distances of two triangles of one face


@dataclass(frozen=True)
class ConvexMesh(ConvexCollider):
    """Convex hull of points around ``at``.

    Parameters
    ----------
    vertices : sequence of array_like, shape (3,)
        The points, from ``at`` [m].
    rotation : array_like
        Of their axes, from the frame of the body.
    faces : sequence of array_like, shape (3,)
        Triangles of a mesh, three numbers of vertices each. They are checked only: the mesh is to be closed; the shape is
        the hull in any case.
    """

    vertices: tuple = ()
    rotation: tuple = (0.0, 0.0, 0.0)
    faces: tuple = ()

    kind: ClassVar[str] = "mesh"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, rotation=values.rotation(self.rotation, f"{self.what}: rotation"))
        points = _table(self.vertices, f"{self.what}: vertices", "points [m]", float)
        if not np.isfinite(points).all():
            raise SceneError(f"{self.what}: vertices are to be finite; point {_first(~np.isfinite(points))} is not.")
        values.keep(self, vertices=tuple(map(tuple, points.tolist())))
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) if len(points) > 3 else np.zeros(3)
        if spread[2] <= LEAST_EXTENT * spread[0]:
            raise SceneError(
                f"{self.what}: its {len(points)} vertices lie in one plane, line or point; a solid needs four that do not."
            )
        faces = _table(self.faces, f"{self.what}: faces", "triples of numbers of vertices", int) if self._has_faces else None
        if faces is not None:
            self._require_closed(faces, len(points))
            values.keep(self, faces=tuple(map(tuple, faces.tolist())))

    @property
    def _has_faces(self) -> bool:
        return not isinstance(self.faces, Sized) or len(self.faces) > 0

    def _require_closed(self, faces: np.ndarray, count: int):
        """Refuse faces without area, of vertices that do not exist, or that leave holes."""
        if faces.min() < 0 or faces.max() >= count:
            raise SceneError(
                f"{self.what}: face {_first((faces < 0) | (faces >= count))} names a vertex beyond {count - 1}."
            )
        p = np.array(self.vertices)[faces]
        double = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
        if (double <= LEAST_EXTENT * np.ptp(np.array(self.vertices), axis=0).max() ** 2).any():
            raise SceneError(f"{self.what}: face {int(np.argmin(double))} has no area; leave it out.")
        _, first, same = np.unique(np.array(self.vertices), axis=0, return_index=True, return_inverse=True)
        faces = first[same.ravel()][faces]  # one number of vertices that are given several times
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        pairs, uses = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        if (uses != 2).any():
            one, other = pairs[int(np.flatnonzero(uses != 2)[0])]
            raise SceneError(
                f"{self.what}: the mesh is open, {int((uses != 2).sum())} edges are not those of two faces, the first "
                f"between vertices {one} and {other}; close it, or give no faces to take the hull of its vertices."
            )

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from the axes of the vertices to the frame of the body."""
        return values.rotation_matrix(self.rotation)

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        points = np.array(self.vertices)
        return points.min(axis=0), points.max(axis=0)

    @property
    def half_edges(self) -> np.ndarray:
        """Half edges (3,) of the box around it [m]."""
        return 0.5 * (self._bounds[1] - self._bounds[0])

    @property
    def centre(self) -> np.ndarray:
        """Middle (3,) of that box, in the frame of the body [m]."""
        return np.array(self.at) + self.axes @ (0.5 * (self._bounds[0] + self._bounds[1]))

    @property
    def corners(self) -> np.ndarray:
        """Vertices of the hull in the frame of the body [m]."""
        return self.centre + self.hull[0] @ self.axes.T

    @cached_property
    def hull(self) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        """Vertices (k, 3) of the hull from its centre [m], its faces as loops of them, and their normals (f, 3)."""
        return hull_of(self.vertices)


@lru_cache(maxsize=MESHES)
def hull_of(vertices: tuple) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Hull of points, as of :attr:`ConvexMesh.hull`; copies of a mesh share it."""
    from scipy.spatial import ConvexHull  # few scenes need it

    points = np.array(vertices)
    points = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    found = ConvexHull(points / np.abs(points).max())
    number = np.empty(len(points), dtype=int)
    number[found.vertices] = np.arange(len(found.vertices))
    own, triangles = points[found.vertices], number[found.simplices]
    a, b, c = (own[triangles[:, k]] for k in range(3))
    is_turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0.0
    triangles[is_turned] = triangles[is_turned][:, [0, 2, 1]]
    planes, owner = _planes(found.equations, found.neighbors)
    order = np.argsort(owner, kind="stable")
    parts = np.split(triangles[order], np.flatnonzero(np.diff(owner[order])) + 1)
    loops = [part[0] if len(part) == 1 else _loop(own, part, plane[:3]) for part, plane in zip(parts, planes, strict=True)]
    return own, loops, planes[:, :3]


def _loop(own: np.ndarray, triangles: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Corners of a face in order, counterclockwise seen from outside."""
    members = np.unique(triangles)
    around = own[members] @ rotations.along(normal)
    middle = around - around.mean(axis=0)
    return members[np.argsort(np.arctan2(middle[:, 1], middle[:, 0]))]


def _planes(equations: np.ndarray, neighbours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Planes of the faces of a hull, and the face of each of its triangles: neighbours in one plane are of one face."""
    near = (np.abs(equations[:, None] - equations[neighbours]).max(axis=2) <= COPLANAR).tolist()
    owner, beside = np.full(len(equations), -1), neighbours.tolist()
    first: list[int] = []
    for k in range(len(equations)):
        if owner[k] >= 0:
            continue
        owner[k], waiting = len(first), [k]
        while waiting:
            i = waiting.pop()
            for j, is_same in zip(beside[i], near[i], strict=True):
                if is_same and owner[j] < 0 and np.abs(equations[j] - equations[k]).max() <= COPLANAR:
                    owner[j] = owner[k]
                    waiting.append(j)
        first.append(k)
    return equations[first], owner


def _table(entries, what: str, of: str, kind: type) -> np.ndarray:
    """Array (k, 3) of what was given."""
    try:
        found: np.ndarray = np.array(entries, dtype=kind)
    except (TypeError, ValueError, OverflowError):
        found = np.zeros(0)
    if found.ndim != 2 or found.shape[1] != 3 or (kind is int and not np.array_equal(found, np.array(entries))):
        raise SceneError(f"{what} are a list of {of}, each with three entries, got {_short(entries)}.")
    return found


def _short(entries) -> str:
    text = repr(entries)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _first(wrong: np.ndarray) -> int:
    return int(np.flatnonzero(wrong.any(axis=1))[0])
