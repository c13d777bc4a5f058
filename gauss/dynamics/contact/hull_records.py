"""Records of the convex hulls of shapes in memory, for :mod:`gauss.codegen.kernels.hull_points`."""

from functools import lru_cache

import numpy as np

from gauss.codegen.kernels.hull_points import CORNER, MOST_CORNERS, RECORD
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.scene import Box, Capsule, ConvexMesh, Sphere
from gauss.scene.contact_patch import solid_of
from gauss.scene.support_faces import Polytope, Segment

KEPT = 1024  # records: copies of a mesh share theirs
HULLS = Sphere, Capsule, Box, ConvexMesh  # of points, thickened by a radius


class HullRecord:
    """Record of a solid, and the arrays that it names.

    Parameters
    ----------
    solid : Polytope or Segment
        The solid; one with faces of too many corners has no vertices here, and is left to other methods.
    """

    def __init__(self, solid: Polytope | Segment):
        if isinstance(solid, Polytope):
            radius, vertices, normals, first, corners = 0.0, solid.vertices, solid.normals, solid.first_corner, solid.corners
        else:
            radius, vertices, normals = solid.radius, solid.points, np.zeros((0, 3))
            first, corners = np.zeros(1), np.zeros((0, CORNER))
        self.numbers = np.array([radius, solid.size])
        self.vertices, self.normals, self.corners = (
            np.ascontiguousarray(x, dtype=float) for x in (vertices, normals, corners)
        )
        self.first_corner = np.ascontiguousarray(first, dtype=np.int64)
        is_small = np.diff(self.first_corner).max(initial=0) <= MOST_CORNERS
        arrays = self.numbers, self.vertices, self.normals, self.first_corner, self.corners
        counts = len(self.vertices) if is_small else 0, len(self.normals)
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
    return [_record(solid) if isinstance(solid, Polytope | Segment) else None for solid in solids]


_record = lru_cache(maxsize=KEPT)(HullRecord)
