"""Choice of the contact points with terrain in machine code: outlines, their order, and the ones that are kept of many.

The rules are those of ``chosen`` in :mod:`gauss.scene.terrain_contact`.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Value, name_with, subroutine
from gauss.codegen.kernels.hull_points import vector
from gauss.codegen.kernels.patch_rows import POINT
from gauss.codegen.kernels.terrain_outline import MOST_RAW, write_outlines


class _ChoiceWriter:
    def __init__(self, module: ir.Module, name: str, laws):
        r = self.r = subroutine(module, name, [POINTER, INTEGER, POINTER, INTEGERS, INTEGERS])
        (self.total,), (self.points, self.settings, self.chosen, self.count) = r.integers, r.arrays
        self.laws, self.kept, self.order = laws, r.buffer(MOST_RAW, INTEGER), r.buffer(MOST_RAW, INTEGER)
        self.level, self.number = r.buffer(MOST_RAW), r.variable(0, INTEGER)

    def write(self) -> ir.Function:
        r, slots = self.r, self.laws.slots
        r.call(write_outlines(r.module, self.laws.same, self.laws.odd), self.points, self.total, self.settings, self.kept)
        self.number[0], self.count[0] = 0, 0
        with r.each(self.total) as i, r.when(self.kept[i] > 0):
            self._insert(i)
        with r.each(self.number[0]) as k:
            self.kept[k] = r.as_integer((self.number[0] <= slots) | (k < slots // 2))
        with r.when(self.number[0] > slots):
            for angle in 2.0 * np.pi / (slots // 2) * np.arange(slots // 2):
                self._keep_farthest(vector(self.settings, 2) * np.cos(angle) + vector(self.settings, 5) * np.sin(angle))
        with r.each(self.number[0]) as k, r.when((self.kept[k] > 0) & (self.count[0] < slots)):
            self.chosen[self.count[0]] = self.order[k]
            self.count[0] = self.count[0] + 1
        return r.done()

    def _insert(self, i: Value):
        """Put a point in its place of the order by gaps, then by places."""
        r = self.r
        self.level[i] = r.as_double(r.floor(self._bounded(self.points[i * POINT] / self.settings[1]) + 0.5))
        place = r.variable(0, INTEGER)
        place[0] = self.number[0]
        with r.loop() as leave_if:
            leave_if(place[0] < 1)
            before = self.order[place[0] - 1]
            leave_if(self._is_before(before, i))
            self.order[place[0]] = before
            place[0] = place[0] - 1
        self.order[place[0]] = i
        self.number[0] = self.number[0] + 1

    def _bounded(self, x: Value) -> Value:
        """A double that an integer holds."""
        r, most = self.r, self.r.number(2.0**60)
        return r.maximum(-r.maximum(-x, -most), -most)

    def _is_before(self, k: Value, i: Value) -> Value:
        """Whether a point comes before another one, or is equal."""
        (a, *p), (b, *q) = ([self.level[n], *vector(self.points, n * POINT + 1)] for n in (k, i))
        found = p[2] <= q[2]
        for one, other in ((p[1], q[1]), (p[0], q[0]), (a, b)):
            found = (one < other) | ((one <= other) & found)
        return found

    def _keep_farthest(self, direction: np.ndarray):
        """Keep the one of the later points that is farthest in a direction."""
        r, most, place = self.r, self.r.variable(-np.inf), self.r.variable(0, INTEGER)
        with r.each(self.number[0], self.laws.slots // 2) as k:
            height = vector(self.points, self.order[k] * POINT + 1) @ direction
            with r.when(height > most[0]):
                most[0], place[0] = height, k
        self.kept[place[0]] = 1


def write_choice(module: ir.Module, laws) -> ir.Function:
    """Emit ``choice(double* points, i64 total, double* settings, i64* chosen, i64* count)``.

    Settings are the distance of places that are the same, and of gaps that have one place in the order; two axes (3,) of the
    field along its grid.
    """
    name = name_with("choice", laws.same, laws.odd, laws.slots)
    return module.globals.get(name) or _ChoiceWriter(module, name, laws).write()
