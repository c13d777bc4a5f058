"""Patches of contact of two solids, in place of the kernels of a pair of shapes: by machine code, or called from there.

The distances of a pair are asked first; its patch is kept for the rows of its near points, which machine code writes next.
Patches of convex hulls are found by :mod:`gauss.codegen.kernels.hull_pairs`, those with terrain by
:mod:`gauss.codegen.kernels.terrain_points`; other ones, and what these leave, in Python.
Biases are zero: a point of a patch moves on both solids, and is found anew in each step.
"""

import _thread
import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np

from gauss.codegen import Kernel, from_disk, write
from gauss.codegen.kernel import SIGNATURE
from gauss.codegen.kernels.hull_pairs import HullDistances
from gauss.codegen.kernels.near_pairs import DISTANCE_INPUTS, FAR_AWAY
from gauss.codegen.kernels.patch_rows import PatchRows
from gauss.codegen.kernels.terrain_points import TerrainDistances, TerrainLaws
from gauss.dynamics.contact.hull_records import HULLS
from gauss.dynamics.contact.pair_kernels import Feature
from gauss.rotations import cross
from gauss.scene import Collider, HalfSpace, HeightField, Sphere, terrain, terrain_contact
from gauss.scene.contact import tangents
from gauss.scene.contact_patch import ACROSS, SAME_DEPTH, SLOTS, SolidPose
from gauss.scene.patch_distances import PairOfSolids, solid_pair


class PatchKernels:
    """Distances and rows of pairs of solids, in the form of :class:`gauss.dynamics.contact.pair_kernels.PairKernels`.

    Parameters
    ----------
    kinds : tuple of type
        Kinds of the two shapes.
    shapes : callable
        Number of a pair of the table → its shapes.
    count : ndarray of int64
        Its last entry is the number of the pair that is asked.
    settings : ndarray
        Its first entry is the reach [m].
    patch : ndarray, shape (16, 7)
        Points of the pair that was asked last: distances, places, normals.
    """

    guarded = False

    def __init__(
        self,
        kinds: tuple[type, type],
        shapes: Callable[[int], tuple[Collider, Collider]],
        count: np.ndarray,
        settings: np.ndarray,
        patch: np.ndarray,
    ):
        self.shapes, self.count, self.settings, self.patch = shapes, count, settings, patch
        self.pairs: dict[int, PairOfSolids] = {}
        self.features = [Feature(0, signs=(k, self.patch.ctypes.data)) for k in range(SLOTS)]
        unknown = np.array([-1.0, *[FAR_AWAY] * (SLOTS - 1)])  # a contact whose row, asked next, is NaN: refused by name
        self.distances: Kernel | _Entry = _Entry(self._distances, DISTANCE_INPUTS, unknown)
        self.otherwise: _Entry | None = None
        if kinds[0] in HULLS and kinds[1] in (*HULLS, HalfSpace):
            self.otherwise, self.distances = self.distances, hull_distances(kinds[1] is HalfSpace)
        elif kinds[0] in HULLS and kinds[1] is HeightField:
            self.otherwise, self.distances = self.distances, terrain_distances(kinds[0] is Sphere)
        self.rows = [patch_rows()]

    def _distances(self, given: np.ndarray, found: np.ndarray):
        found[:] = FAR_AWAY
        self.patch[0] = np.nan
        number = int(self.count[3])
        if number not in self.pairs:
            self.pairs[number] = solid_pair(*self.shapes(number))
        pair, reach, places = self.pairs[number], float(self.settings[0]), given.tolist()
        if not pair.may_touch(places[9:12], places[25:28], reach):
            return
        given = given.copy()  # machine code writes over it
        one, other = SolidPose(given[:9].reshape(3, 3), given[9:12]), SolidPose(given[16:25].reshape(3, 3), given[25:28])
        points = pair.points(one, other, reach)
        if points:
            self.patch[: len(points)] = [(point.gap, *point.place.tolist(), *point.normal.tolist()) for point in points]
            found[: len(points)] = self.patch[: len(points), 0]


@cache
def hull_distances(on_plane: bool) -> Kernel:
    """Machine code of the distances of two hulls, or of a hull and a half-space, made once on a machine."""
    laws = None if on_plane else (ACROSS, SAME_DEPTH)
    return from_disk((HullDistances, laws), lambda: Kernel(HullDistances(SLOTS, laws), batch=False))


@cache
def terrain_distances(is_ball: bool) -> Kernel:
    """Machine code of the distances of a hull, or of a ball, and terrain, made once on a machine."""
    laws = TerrainLaws(
        same=terrain_contact.PLANE_TOLERANCE,
        tiny=terrain_contact.CENTRE_DISTANCE,
        least_depth=terrain_contact.LEAST_DEPTH,
        near_side=terrain_contact.NEAR_SIDE,
        beside=terrain_contact.DISTANCE,
        flush=terrain_contact.FLUSH,
        closed=terrain_contact.CLOSED,
        odd=tuple(map(tuple, terrain_contact.ODD.tolist())),
        aligned=terrain.ALIGNED,
        on_edge=terrain.ON_EDGE,
        across=ACROSS,
        same_depth=SAME_DEPTH,
        slots=SLOTS,
    )
    return from_disk((TerrainDistances, laws, is_ball), lambda: Kernel(TerrainDistances(laws, is_ball), batch=False))


@cache
def patch_rows() -> Kernel:
    """Machine code of the row of a point, made once on a machine."""

    def row(gap, place, normal, centre, other):
        J = [
            [*(sign * cross(arm, axis)), *(sign * axis), 0.0, 0.0]
            for sign, arm in ((1.0, place - centre), (-1.0, place - other))
            for axis in (normal, *tangents(normal))
        ]
        return [*gap, *place, *np.ravel(J), 0.0, 0.0, 0.0]

    return from_disk((PatchRows,), lambda: Kernel(PatchRows(write(row, 1, 3, 3, 3, 3, name="patch_row")), batch=False))


class _Entry:
    """A Python function that machine code calls by its address.

    Parameters
    ----------
    function : callable
        (inputs, results) → fills the results.
    n_in : int
        Number of inputs.
    failed : ndarray
        Results where the function raises: machine code cannot pass that on.
    """

    def __init__(self, function: Callable[[np.ndarray, np.ndarray], None], n_in: int, failed: np.ndarray):
        kinds = ctypes.c_double * n_in, ctypes.c_double * failed.size
        views: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

        def called(n, given, stride, found, other_stride):
            key = given, found
            if key not in views:  # machine code has few places for them
                views.clear()
                of_inputs, of_results = (kind.from_address(at) for kind, at in zip(kinds, key, strict=True))
                views[key] = np.ctypeslib.as_array(of_inputs), np.ctypeslib.as_array(of_results)
            inputs, results = views[key]
            try:
                function(inputs, results)
            except KeyboardInterrupt:
                results[:] = failed
                _thread.interrupt_main()  # raised again once machine code has returned
            except Exception:  # results say so
                results[:] = failed

        self.code = SIGNATURE(called)

    def address(self) -> int:
        """Address for machine code."""
        found = ctypes.cast(self.code, ctypes.c_void_p).value
        assert found is not None
        return found
