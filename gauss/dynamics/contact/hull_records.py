"""Records of convex hulls and of terrain in memory, for :mod:`gauss.codegen.kernels.hull_points` and ``terrain_surface``."""

from functools import lru_cache

import numpy as np

from gauss.codegen.kernels.hull_points import CORNER, MOST_CORNERS, RECORD
from gauss.codegen.kernels.terrain_surface import NUMBERS
from gauss.codegen.kernels.terrain_surface import RECORD as TERRAIN_RECORD
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.scene import Box, Capsule, ConvexMesh, HeightField, Sphere
from gauss.scene.contact_patch import solid_of
from gauss.scene.patch_distances import terrain_of
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
        self.address = self.record.ctypes.data


class TerrainRecord:
    """Record of a height field, and the arrays that it names.

    Parameters
    ----------
    field : HeightField
        The field.
    """

    def __init__(self, field: HeightField):
        terrain = terrain_of(field)
        self.numbers = np.array(
            [*terrain.start, *terrain.end, *terrain.edges, terrain.base, terrain.size, terrain.least], dtype=float
        )
        self.heights, self.tops = (np.ascontiguousarray(part, dtype=float) for part in (terrain.heights, terrain.tops))
        addresses = [array.ctypes.data for array in (self.numbers, self.heights, self.tops)]
        self.record = np.array([*self.heights.shape, *addresses], dtype=np.int64)
        assert self.record.size == TERRAIN_RECORD
        assert self.numbers.size == len(NUMBERS)
        self.address = self.record.ctypes.data


def shape_records(table: ShapeTable) -> list[HullRecord | TerrainRecord | None]:
    """Records of the parts of a table that are hulls of points or terrain; none at all where no part needs them."""
    if not any(part.kind in (ConvexMesh, HeightField) for part in table.parts):
        return [None] * len(table.parts)
    return [_record_of(table.scene.shapes[part.shape], part.kind) for part in table.parts]


def _record_of(shape, kind: type) -> HullRecord | TerrainRecord | None:
    """Record of the part of a shape."""
    if kind is HeightField:
        return _terrain_record(shape)
    solid = solid_of(shape) if kind in HULLS else None
    return _record(solid) if isinstance(solid, Polytope | Segment) else None


_record, _terrain_record = lru_cache(maxsize=KEPT)(HullRecord), lru_cache(maxsize=KEPT)(TerrainRecord)
