"""Surface of a height field in numbers: its triangles under a box, and which normals it has at a place.

At an edge or corner the surface has the normals of all planes through it that leave the triangles around it below. An edge
between triangles of one plane, or of a valley, has none: nothing catches on it.
"""

from typing import NamedTuple

import numpy as np

from gauss.scene.height_field import HeightField

NEIGHBOURS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1))  # rows and columns to the neighbours of a vertex
ROWS = np.array([[0, 0, 1], [0, 1, 1]])  # of the corners of the lower and the upper triangle of a cell
COLUMNS = np.array([[0, 1, 1], [0, 1, 0]])
ON_EDGE = 1e-5  # share of a corner in a place of a triangle below which the place is on the opposite edge
ALIGNED = 1e-4  # rad: angle of two normals that are the same, above the errors of iterated ones


class Triangles(NamedTuple):
    """Triangles of a surface, counterclockwise from above."""

    corners: np.ndarray  # (m, 3) numbers of their vertices, row by row of the grid
    points: np.ndarray  # (m, 3, 3) these vertices [m]
    normals: np.ndarray  # (m, 3) unit normals, upward
    is_upper: np.ndarray  # (m,) whether it is the one of its cell at the greater y

    def where(self, kept: np.ndarray) -> "Triangles":
        """Those of a mask."""
        return Triangles(*(part[kept] for part in self))


NO_TRIANGLES = Triangles(np.zeros((0, 3), dtype=int), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0, dtype=bool))


class Terrain:
    """Height field in its own axes around the middle of its box."""

    def __init__(self, field: HeightField):
        x, y, z = field.grid
        self.start, self.end = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
        self.edges = np.array([x[1] - x[0], y[1] - y[0]])  # of a cell [m]
        half = field.half_edges
        self.heights, self.base = z - (z.max() - half[2]), -float(half[2])
        high = np.maximum(self.heights[:-1], self.heights[1:])
        self.tops = np.maximum(high[:, :-1], high[:, 1:])  # of cells
        self.size = float(np.linalg.norm(half))  # radius of the ball around it [m]
        self.least = float(self.edges.min() ** 2)  # square of the shorter edge of a cell [m²]

    def under(self, low: np.ndarray, high: np.ndarray) -> Triangles:
        """Triangles of the cells that a box overlaps from above, by its lowest and highest corners (3,) [m]."""
        if (high[:2] < self.start).any() or (low[:2] > self.end).any() or high[2] < self.base:
            return NO_TRIANGLES
        (left, front), (right, back) = self._cell(low), self._cell(high)
        i, j = np.nonzero(self.tops[front : back + 1, left : right + 1] >= low[2])
        if not i.size:
            return NO_TRIANGLES
        rows, columns = ((part[:, None, None] + of).reshape(-1, 3) for part, of in ((i + front, ROWS), (j + left, COLUMNS)))
        points, is_upper = self._places(rows, columns), np.arange(len(rows)) % 2 > 0
        a, b, c = points[:, :, 2].T  # the edge along x is from a to b, of an upper triangle from c to b
        up = np.ones((len(rows), 3))
        up[:, 0] = np.where(is_upper, c - b, a - b) / self.edges[0]
        up[:, 1] = np.where(is_upper, a - c, b - c) / self.edges[1]
        up /= np.sqrt((up * up).sum(axis=1))[:, None]
        return Triangles(rows * self.heights.shape[1] + columns, points, up, is_upper)

    def _cell(self, place: np.ndarray) -> tuple[int, int]:
        """Column and row of the cell of a place, or of the nearest one."""
        column, row = ((place[:2] - self.start) / self.edges).tolist()
        rows, columns = self.tops.shape
        return min(max(int(column), 0), columns - 1), min(max(int(row), 0), rows - 1)

    def _places(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Places of vertices by their rows and columns [m]."""
        found = np.empty((*rows.shape, 3))
        found[..., 0] = self.start[0] + columns * self.edges[0]
        found[..., 1] = self.start[1] + rows * self.edges[1]
        found[..., 2] = self.heights[rows, columns]
        return found

    def vertices(self, numbers: np.ndarray) -> np.ndarray:
        """Places of vertices by their numbers [m]."""
        return self._places(*np.divmod(numbers, self.heights.shape[1]))

    def height(self, place: np.ndarray) -> float:
        """Height of the surface over or under a place [m]; −inf beside the field."""
        if (place[:2] < self.start).any() or (place[:2] > self.end).any():
            return -np.inf
        j, i = self._cell(place)
        u, v = (place[:2] - self.start) / self.edges - (j, i)
        (a, b), (d, c) = self.heights[i : i + 2, j : j + 2].tolist()
        return float(a + u * (b - a) + v * (c - b) if u >= v else a + v * (d - a) + u * (c - d))

    def margin(self, place: np.ndarray) -> float:
        """Distance of a place of the solid from its sides and its bottom, which nothing touches [m]."""
        return float(min((place[:2] - self.start).min(), (self.end - place[:2]).min(), place[2] - self.base))

    def has_normal(
        self, corners: np.ndarray, points: np.ndarray, normal: np.ndarray, place: np.ndarray, direction: np.ndarray
    ) -> bool:
        """Whether a direction (3,), a unit vector, is one of the normals of the surface at a place (3,) of a triangle [m].

        The triangle by numbers of its vertices (3,), these vertices (3, 3), and its normal (3,).
        """
        if direction @ normal >= 1.0 - 0.5 * ALIGNED**2:
            return True
        if direction[2] <= 0.0:
            return False
        (a, b), (c, d) = (points[1:, :2] - points[0, :2]).tolist()
        x, y = (place[:2] - points[0, :2]).tolist()
        shares = (x * d - y * c) / (a * d - b * c), (a * y - b * x) / (a * d - b * c)
        on = [k for k, share in zip(corners.tolist(), (1.0 - sum(shares), *shares), strict=True) if share > ON_EDGE]
        if len(on) == len(corners):  # within the triangle there is one normal
            return False
        near = set(on).union(set.intersection(*map(self._around, on)))
        out = self.vertices(np.array(sorted(near))) - place
        return bool((out @ direction <= ALIGNED * np.sqrt(np.maximum((out * out).sum(axis=1), self.least))).all())

    def _around(self, number: int) -> set[int]:
        """Neighbours of a vertex."""
        rows, columns = self.heights.shape
        i, j = divmod(number, columns)
        around = ((i + di, j + dj) for di, dj in NEIGHBOURS)
        return {k * columns + m for k, m in around if 0 <= k < rows and 0 <= m < columns}
