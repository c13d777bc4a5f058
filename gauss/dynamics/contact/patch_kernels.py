"""Patches of contact of two solids, called from machine code in place of the kernels of a pair of shapes.

The distances of a pair are asked first; its patch is kept for the rows of its near points, which machine code writes next.
Biases are zero: a point of a patch moves on both solids, and is found anew in each step.
"""

import _thread
import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np

from gauss.codegen import Kernel, from_disk, write
from gauss.codegen.kernel import SIGNATURE
from gauss.codegen.kernels.near_pairs import DISTANCE_INPUTS
from gauss.codegen.kernels.patch_rows import POINT, PatchRows
from gauss.dynamics.contact.pair_kernels import Feature
from gauss.rotations import cross
from gauss.scene import Collider
from gauss.scene.contact import tangents
from gauss.scene.contact_patch import SLOTS, SolidPose
from gauss.scene.patch_distances import PairOfSolids, solid_pair

FAR = 1e300  # distance of a point that a patch has not [m]


class PatchKernels:
    """Distances and rows of pairs of solids, in the form of :class:`gauss.dynamics.contact.pair_kernels.PairKernels`.

    Parameters
    ----------
    shapes : list of (Collider, Collider)
        The shapes of each pair of the table.
    count : ndarray of int64
        Its last entry is the number of the pair that is asked.
    settings : ndarray
        Its first entry is the reach [m].
    """

    guarded = False

    def __init__(self, shapes: Callable[[int], tuple[Collider, Collider]], count: np.ndarray, settings: np.ndarray):
        self.shapes, self.count, self.settings = shapes, count, settings
        self.pairs: dict[int, PairOfSolids] = {}
        self.patch = np.full((SLOTS, POINT), np.nan)  # points of the pair that was asked last; NaN: refused by name
        self.features = [Feature(0, signs=(k, self.patch.ctypes.data)) for k in range(SLOTS)]
        unknown = np.array([-1.0, *[FAR] * (SLOTS - 1)])  # a contact whose row, asked next, is NaN
        self.distances = _Entry(self._distances, DISTANCE_INPUTS, unknown)
        self.rows = [patch_rows()]

    def _distances(self, given: np.ndarray, found: np.ndarray):
        found[:] = FAR
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
