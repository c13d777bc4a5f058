"""Patches of contact of two solids, called from machine code in place of the kernels of a pair of shapes.

The distances of a pair are asked first; its patch is kept for the rows of its near points, which are asked next. The biases
of rows are zero: a point of a patch moves on both solids, and is found anew in each step.
"""

import _thread
import ctypes
from collections.abc import Callable
from math import sqrt

import numpy as np

from gauss.codegen.kernel import SIGNATURE
from gauss.codegen.kernels.near_pairs import DISTANCE_INPUTS, MOVED, ROW_INPUTS
from gauss.dynamics.contact.pair_kernels import ROWS, Feature
from gauss.scene import Collider
from gauss.scene.contact import STEEP_NORMAL
from gauss.scene.contact_patch import SLOTS, ContactPoint, SolidPose
from gauss.scene.solid_pairs import PairOfSolids, solid_pair

COM = 28  # first place of the centre of mass in a column of a shape
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
        self.patch: list[ContactPoint] = []
        self.features = [Feature(0, signs=(k,)) for k in range(SLOTS)]
        unknown = np.array([-1.0, *[FAR] * (SLOTS - 1)])  # a contact whose row, asked next, is NaN: it is refused by name
        self.distances = _Entry(self._distances, DISTANCE_INPUTS, unknown)
        self.rows = [_Entry(self._rows, ROW_INPUTS, np.full(ROWS, np.nan))]

    def _distances(self, given: np.ndarray, found: np.ndarray):
        found[:], self.patch = FAR, []
        number = int(self.count[3])
        if number not in self.pairs:
            self.pairs[number] = solid_pair(*self.shapes(number))
        pair, reach, places = self.pairs[number], float(self.settings[0]), given.tolist()
        if not pair.may_touch(places[9:12], places[25:28], reach):
            return
        given = given.copy()  # machine code writes over it
        one, other = (SolidPose(own[:9].reshape(3, 3), own[9:12]) for own in (given[:16], given[16:32]))
        self.patch = pair.points(one, other, reach)
        for k, point in enumerate(self.patch):
            found[k] = point.gap

    def _rows(self, given: np.ndarray, found: np.ndarray):
        gap, place, normal = self.patch[int(given[2 * MOVED + 1])]
        px, py, pz = place.tolist()
        row = [gap, px, py, pz]
        axes = axes_of_contact(*normal.tolist())
        for sign, start in ((1.0, COM), (-1.0, MOVED + COM)):
            x, y, z = given[start : start + 3].tolist()
            x, y, z = sign * (px - x), sign * (py - y), sign * (pz - z)
            for a, b, c in axes:
                row += [y * c - z * b, z * a - x * c, x * b - y * a, sign * a, sign * b, sign * c, 0.0, 0.0]
        found[:] = [*row, 0.0, 0.0, 0.0]


def axes_of_contact(x: float, y: float, z: float) -> tuple[tuple[float, float, float], ...]:
    """Normal and the two tangents of :func:`gauss.scene.contact.tangents`, in plain numbers."""
    a, b, c = (-z, 0.0, x) if x * x > STEEP_NORMAL else (0.0, z, -y)
    size = sqrt(a * a + b * b + c * c)
    a, b, c = a / size, b / size, c / size
    return (x, y, z), (a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a)


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
