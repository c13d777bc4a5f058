"""Broad phase in machine code: pairs of parts whose boxes along the axes are near, by a uniform grid of cells.

A part whose box fits into half a cell is near parts of its own cell and of the 26 around it alone; larger ones and planes
are compared with all. Cells are kept in a hash table, without bounds (Teschner et al., Optimized spatial hashing
for collision detection of deformable objects, 2003). Cost grows with the number of parts and of near pairs.
"""

from collections.abc import Callable

import numpy as np

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Array, Routine, Value

CELLS = 2.0 + 1e-6  # edge of a cell over the largest half edge of boxes in it; more than 2 by rounding of places
OUTLIER = 4.0  # times the mean size: larger boxes are compared with all others
FARTHEST = 2.0**31  # cells from the origin: farther ones count as the last
HASH = 73856093, 19349663, 83492791  # primes, of Teschner et al.
TABLE, NONE = 1, -1  # first entry of the hash table in its array, end of a list


def grid_room(parts: int) -> np.ndarray:
    """Working memory of a grid: mask of the hash table, table, and for each part its successor, its cell and two lists."""
    size = 1 << max(2 * parts - 1, 1).bit_length()
    memory = np.zeros(TABLE + size + 6 * parts, dtype=np.int64)
    memory[0] = size - 1
    return memory


class GridWriter:
    """Emitter of the grid.

    Parameters
    ----------
    r : Routine
        Routine of the code.
    parts : Value
        Number of parts.
    memory : Array
        Integers, as of :func:`grid_room`.
    place, extent : callable
        (part, axis) → centre of its box, half its edge.
    is_plane : callable
        Part → whether it has no box.
    is_near : callable
        (first, second) → whether the boxes of two parts of a pair are near each other.

    Attributes
    ----------
    near, count : Array
        Parts that are near the one that was looked at last, and their number.
    """

    def __init__(
        self,
        r: Routine,
        parts: Value,
        memory: Array,
        place: Callable[[Value, int], Value],
        extent: Callable[[Value, int], Value],
        is_plane: Callable[[Value], Value],
        is_near: Callable[[Value, Value], Value],
    ):
        self.r, self.parts, self.mask, self.table = r, parts, memory[0], memory.after(TABLE)
        self.place, self.extent, self.is_plane, self.is_near = place, extent, is_plane, is_near
        lists = self.table.after(self.mask + 1)
        self.next, self.cell, self.large, self.near = (lists.after(parts * k) for k in (0, 1, 4, 5))
        self.larger, self.count = r.variable(0, INTEGER), r.variable(0, INTEGER)

    def fill(self):
        """Emit the cells of all parts."""
        r = self.r
        half = self._half_edge()
        edge = half * CELLS
        with r.each(self.mask + 1) as k:
            self.table[k] = NONE
        self.larger[0] = 0
        with r.each(self.parts) as k:
            self._insert(k, half, edge)

    def collect(self, first: Value):
        """Emit the list ``near`` of the later parts that are near one, in their order, and its length ``count``."""
        r = self.r
        self.count[0] = 0
        is_small = self.next[first] >= NONE
        with r.when(is_small):
            self._look_around(first)
        length = r.variable(self.larger[0], INTEGER)
        with r.when(~is_small):
            length[0] = self.parts - first - 1
        with r.each(length[0]) as x:
            second = r.variable(first + 1 + x, INTEGER)
            with r.when(is_small):
                second[0] = self.large[x]
            self._compare(first, second[0])

    def _size(self, k: Value) -> Value:
        """Largest half edge of the box of a part."""
        one, two, three = (self.extent(k, i) for i in range(3))
        return self.r.maximum(self.r.maximum(one, two), three)

    def _half_edge(self) -> Value:
        """Largest half edge of all boxes but outliers."""
        r, total, number, largest = self.r, self.r.variable(0.0), self.r.variable(0.0), self.r.variable(0.0)
        with r.each(self.parts) as k, r.when(~self.is_plane(k)):
            total[0], number[0] = total[0] + self._size(k), number[0] + 1.0
        limit = OUTLIER * total[0] / r.maximum(number[0], r.number(1.0))
        with r.each(self.parts) as k, r.when(~self.is_plane(k) & (self._size(k) <= limit)):
            largest[0] = r.maximum(self._size(k), largest[0])
        return largest[0]

    def _insert(self, k: Value, half: Value, edge: Value):
        """Put a part at the head of the list of its cell, or among the large ones, whose successor is below NONE."""
        r = self.r
        is_small = ~self.is_plane(k) & (self._size(k) <= half) & (half > 0.0)
        with r.when(is_small):
            cell = [self._cell(self.place(k, i) / edge) for i in range(3)]
            for i, number in enumerate(cell):
                self.cell[k * 3 + i] = number
            head = self._hash(cell)
            self.next[k], self.table[head] = self.table[head], k
        with r.when(~is_small):
            self.next[k] = NONE - 1
            self.large[self.larger[0]] = k
            self.larger[0] = self.larger[0] + 1

    def _cell(self, x: Value) -> Value:
        r = self.r
        return r.floor(-r.maximum(-r.maximum(x, r.number(-FARTHEST)), r.number(-FARTHEST)))

    def _hash(self, cell: list[Value]) -> Value:
        one, two, three = (number * prime for number, prime in zip(cell, HASH, strict=True))
        return (one + two + three) & self.mask

    def _look_around(self, first: Value):
        """Compare a part with those of the cells around it."""
        r, own, place = self.r, [self.cell[first * 3 + i] for i in range(3)], self.r.variable(NONE, INTEGER)
        three = Value(r.b, INTEGER(3))
        with r.each(three) as i, r.each(three) as j, r.each(three) as k:
            cell = [number + step - 1 for number, step in zip(own, (i, j, k), strict=True)]
            place[0] = self.table[self._hash(cell)]
            with r.loop() as leave_if:
                second = place[0]
                leave_if(second < 0)
                apart = [self.cell[second * 3 + i] - number for i, number in enumerate(cell)]
                is_there = (apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]) < 1  # cells share a hash
                with r.when(is_there):
                    self._compare(first, second)
                place[0] = self.next[second]

    def _compare(self, first: Value, second: Value):
        """Put the second part in its place of the list of near ones, if it is later than the first and near it."""
        r = self.r
        with r.when(second > first), r.when(self.is_near(first, second)):
            x = r.variable(0, INTEGER)
            x[0] = self.count[0]
            with r.loop() as leave_if:
                leave_if(x[0] < 1)
                leave_if(self.near[x[0] - 1] < second)
                self.near[x[0]] = self.near[x[0] - 1]
                x[0] = x[0] - 1
            self.near[x[0]] = second
            self.count[0] = self.count[0] + 1
