"""Surface of a height field in machine code: its triangles under a box, and which normals it has at a place.

The same as :class:`gauss.scene.terrain.Terrain`. A field has a record of integers: rows and columns of vertices, then the
addresses of its numbers (:data:`NUMBERS`), heights and highest heights of the cells.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, name_with, subroutine
from gauss.codegen.kernels.hull_points import put, vector

RECORD = 5  # integers of a record
NUMBERS = "left", "front", "right", "back", "along x", "along y", "base", "size", "least"  # sides, edges of a cell, …


class Triangle(NamedTuple):
    """One triangle, counterclockwise from above: rows and columns of its vertices, these (3, 3), and its normal."""

    rows: list[Value]
    columns: list[Value]
    points: np.ndarray
    normal: np.ndarray


class Surface:
    """View of a height field by its record."""

    def __init__(self, r: Routine, record: Array):
        self.r, self.record, self.rows, self.columns = r, record, record[0], record[1]
        numbers, self.heights, self.tops = (Array(r.b, r.b.inttoptr(record[k].value, POINTER)) for k in (2, 3, 4))
        values = [numbers[k] for k in range(len(NUMBERS))]
        self.start, self.end, self.edges = values[:2], values[2:4], values[4:6]
        self.base, self.size, self.least = values[6:]

    def vertex(self, row: Value, column: Value) -> np.ndarray:
        """Place of a vertex."""
        x, y = (self.start[k] + self.r.as_double(n) * self.edges[k] for k, n in enumerate((column, row)))
        return np.array([x, y, self.heights[row * self.columns + column]])

    def cell(self, place) -> tuple[Value, Value]:
        """Row and column of the cell of a place, or of the nearest one."""
        r, found = self.r, []
        for k, count in ((1, self.rows), (0, self.columns)):
            last = r.as_double(count - 2)
            number = r.maximum((place[k] - self.start[k]) / self.edges[k], r.number(0.0))
            found.append(r.floor(r.choose(number < last, number, last)))
        return found[0], found[1]

    def is_over(self, place) -> Value:
        """Whether a place is over or under the field."""
        inside = [(place[k] >= self.start[k]) & (place[k] <= self.end[k]) for k in (0, 1)]
        return inside[0] & inside[1]

    def height(self, place) -> Value:
        """Height of the surface over or under a place [m], which is that of the plane of a triangle beside the field."""
        i, j = self.cell(place)
        (a, b), (d, c) = ([self.heights[(i + di) * self.columns + j + dj] for dj in (0, 1)] for di in (0, 1))
        u, v = ((place[k] - self.start[k]) / self.edges[k] - self.r.as_double(n) for k, n in ((0, j), (1, i)))
        return self.r.choose(u >= v, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d))

    def margin(self, place) -> Value:
        """Distance of a place of the solid from its sides and its bottom [m]."""
        least = self.base - place[2]
        for k in (0, 1):
            least = self.r.maximum(self.r.maximum(self.start[k] - place[k], place[k] - self.end[k]), least)
        return -least

    @contextmanager
    def under(self, low: list[Value], high: list[Value]) -> Iterator[Triangle]:
        """Write a loop over the triangles of the cells that a box overlaps from above, by its corners."""
        r = self.r
        is_near = high[2] >= self.base
        for k in (0, 1):
            is_near = is_near & (high[k] >= self.start[k]) & (low[k] <= self.end[k])
        (front, left), (back, right) = self.cell(low), self.cell(high)
        with r.when(is_near), r.each(back + 1, front) as i, r.each(right + 1, left) as j:
            with r.when(self.tops[i * (self.columns - 1) + j] >= low[2]), r.each(2) as upper:
                yield self._triangle(i, j, upper)

    def _triangle(self, i: Value, j: Value, upper: Value) -> Triangle:
        rows, columns = [i, i + upper, i + 1], [j, j + 1, j + 1 - upper]
        points = np.array([self.vertex(*corner) for corner in zip(rows, columns, strict=True)])
        a, b, c = points[:, 2]  # the edge along x is from a to b, of an upper triangle from c to b
        along = [self.r.choose(upper > 0, c - b, a - b), self.r.choose(upper > 0, a - c, b - c)]
        up = [slope / edge for slope, edge in zip(along, self.edges, strict=True)]
        length = self.r.square_root(up[0] * up[0] + up[1] * up[1] + 1.0)
        return Triangle(rows, columns, points, np.array([*up, self.r.number(1.0)]) / length)


class _NormalWriter:
    """Writer of ``has_normal``.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Where code is emitted.
    name : str
        Name of the function there.
    aligned, on_edge : float
        Angle [rad] of normals that are the same; share of a corner below which a place is on the opposite edge.
    """

    def __init__(self, module: ir.Module, name: str, aligned: float, on_edge: float):
        r = self.r = subroutine(module, name, [INTEGERS, INTEGERS, POINTER, POINTER, POINTER, INTEGERS])
        self.surface, self.vertices, self.points = Surface(r, r.arrays[0]), r.arrays[1], r.arrays[2]
        self.place, self.direction, self.result = vector(r.arrays[3]), vector(r.arrays[4]), r.arrays[5]
        self.aligned, self.on_edge = aligned, on_edge

    def write(self) -> ir.Function:
        r, direction, normal = self.r, self.direction, vector(self.points, 9)
        is_same = direction @ normal >= 1.0 - 0.5 * self.aligned**2
        self.result[0] = r.as_integer(is_same)
        with r.when(~is_same & (direction[2] > 0.0)):
            self._look_around(self._shares())
        return r.done()

    def _shares(self) -> list[Value]:
        """Shares of the corners in the place, seen from above."""
        a, b, c = (vector(self.points, 3 * k) for k in range(3))
        (p, q), (s, t) = (b - a)[:2], (c - a)[:2]
        x, y = (self.place - a)[:2]
        area = p * t - q * s
        one, other = (x * t - y * s) / area, (p * y - q * x) / area
        return [-(one + other) + 1.0, one, other]

    def _look_around(self, shares: list[Value]):
        """The normals of an edge or a corner leave the vertices around below."""
        r, on = self.r, [share > self.on_edge for share in shares]
        with r.when(~(on[0] & on[1] & on[2])):
            vertices = [[self.vertices[2 * k], self.vertices[2 * k + 1]] for k in range(3)]
            first = [r.choose(on[0], a, r.choose(on[1], b, c)) for a, b, c in zip(*vertices, strict=True)]
            last = [r.choose(on[2], c, r.choose(on[1], b, a)) for a, b, c in zip(*vertices, strict=True)]
            above = r.variable(0, INTEGER)
            with r.each(3) as di, r.each(3) as dj:
                row, column = first[0] + di - 1, first[1] + dj - 1
                counts = (row >= 0) & (row < self.surface.rows) & (column >= 0) & (column < self.surface.columns)
                counts = counts & ((di - 1) * (dj - 1) >= 0) & _are_neighbours(row - last[0], column - last[1])
                with r.when(counts):
                    out = self.surface.vertex(row, column) - self.place
                    length = r.square_root(r.maximum(out @ out, self.surface.least))
                    above[0] = above[0] + r.as_integer(~(out @ self.direction <= length * self.aligned))
            self.result[0] = r.as_integer(above[0] < 1)


def _are_neighbours(di: Value, dj: Value) -> Value:
    """Whether vertices share a triangle or are the same, by their difference in rows and columns."""
    return (di * di <= 1) & (dj * dj <= 1) & (di * dj >= 0)


class TriangleMemory:
    """Triangle in memory, as ``has_normal`` takes it.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    surface : Surface
        The field.
    laws : tuple of float
        As of :class:`_NormalWriter`.
    """

    def __init__(self, r: Routine, surface: Surface, laws: tuple[float, float]):
        self.r, self.surface = r, surface
        self.vertices, self.points = r.buffer(6, INTEGER), r.buffer(12)
        self.given, self.result = r.buffer(6), r.buffer(1, INTEGER)
        name = name_with("has_normal", *laws)
        self.function = r.module.globals.get(name) or _NormalWriter(r.module, name, *laws).write()

    def put(self, triangle: Triangle):
        """Store a triangle."""
        put(self.points, [*triangle.points.ravel(), *triangle.normal])
        for k, (row, column) in enumerate(zip(triangle.rows, triangle.columns, strict=True)):
            put(self.vertices, [row, column], 2 * k)

    def has_normal(self, place: np.ndarray, direction: np.ndarray) -> Value:
        """Whether a direction is one of the normals of the surface at a place of the triangle."""
        put(self.given, [*place, *direction])
        given = self.given, self.given.after(3)
        self.r.call(self.function, self.surface.record, self.vertices, self.points, *given, self.result)
        return self.result[0] > 0
