"""Records of the convex hulls of shapes in memory, for :mod:`gauss.codegen.kernels.hull_points`."""

import numpy as np

from gauss.codegen.kernels.hull_points import MOST_CORNERS, RECORD
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.scene import Box, Capsule, ConvexMesh, Sphere
from gauss.scene.contact_patch import solid_of
from gauss.scene.support_faces import Polytope, Segment

HULLS = Sphere, Capsule, Box, ConvexMesh  # of points, thickened by a radius


class HullRecord:
    """Record of a solid, and the arrays that it names.

    Parameters
    ----------
    solid : Polytope or Segment
        The solid; one with faces of too many corners has no vertices here, and is left to other methods.
    """

    def __init__(self, solid: Polytope | Segment):
        faces = solid.faces if isinstance(solid, Polytope) else []
        vertices = solid.vertices if isinstance(solid, Polytope) else solid.points
        is_small = max((len(face.points) for face in faces), default=0) <= MOST_CORNERS
        corners = [np.column_stack([face.points, face.sides]) for face in faces if face.sides is not None]
        self.numbers = np.array([0.0 if faces else solid.radius, solid.size])  # type: ignore[union-attr]
        self.vertices = np.ascontiguousarray(vertices, dtype=float)
        self.normals = np.array([face.normal for face in faces], dtype=float).reshape(-1, 3)
        self.first_corner = np.cumsum([0, *(len(face.points) for face in faces)], dtype=np.int64)
        self.corners = np.concatenate([np.zeros((0, 7)), *corners])
        arrays = self.numbers, self.vertices, self.normals, self.first_corner, self.corners
        counts = len(self.vertices) if is_small else 0, len(faces)
        self.record = np.array([*counts, *(array.ctypes.data for array in arrays)], dtype=np.int64)
        assert self.record.size == RECORD

    @property
    def address(self) -> int:
        """Address of the record."""
        return self.record.ctypes.data


def hull_records(table: ShapeTable) -> list[HullRecord | None]:
    """Records of the parts of a table; none where no part is a hull of points, or where a part is no hull."""
    if not any(part.kind is ConvexMesh for part in table.parts):
        return [None] * len(table.parts)
    solids = (solid_of(table.scene.shapes[part.shape]) if part.kind in HULLS else None for part in table.parts)
    return [HullRecord(solid) if isinstance(solid, Polytope | Segment) else None for solid in solids]
