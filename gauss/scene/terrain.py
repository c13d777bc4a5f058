"""Surface of a height field in numbers: its triangles under a box, and which normals it has at a place.

At an edge or corner the surface has the normals of all planes through it that leave the triangles around it below. An edge
between triangles of one plane, or of a valley, has none: nothing catches on it.
"""

from typing import NamedTuple

import numpy as np

from gauss.scene.height_field import HeightField

AROUND = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1))  # rows and columns to the neighbours of a vertex
ON_EDGE = 1e-5  # share of a corner in a place of a triangle below which the place is on the opposite edge
ALIGNED = 1e-4  # rad: angle of two normals that are the same, above the errors of iterated ones


class Triangles(NamedTuple):
    """Triangles of a surface, counterclockwise from above.

    Attributes
    ----------
    corners : ndarray of int, shape (m, 3)
        Numbers of their vertices, row by row of the grid.
    points : ndarray, shape (m, 3, 3)
        These vertices [m].
    normals : ndarray, shape (m, 3)
        Unit normals, upward.
    is_upper : ndarray of bool, shape (m,)
        Whether it is the one of its cell at the greater y.
    """

    corners: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    is_upper: np.ndarray

    def where(self, kept: np.ndarray) -> "Triangles":
        """Those of a mask."""
        return Triangles(*(part[kept] for part in self))


class Terrain:
    """Height field in its own axes around the middle of its box.

    Parameters
    ----------
    field : HeightField
        The shape.
    """

    def __init__(self, field: HeightField):
        x, y, z = field.grid
        self.start, self.end = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
        self.edges = np.array([x[1] - x[0], y[1] - y[0]])  # of a cell [m]
        half = field.half_edges
        self.heights, self.base = z - (z.max() - half[2]), -float(half[2])
        self.size = float(np.linalg.norm(half))  # radius of the ball around it [m]
        self.least = float(self.edges.min() ** 2)  # square of the shorter edge of a cell [m²]

    def under(self, low: np.ndarray, high: np.ndarray) -> Triangles:
        """Triangles of the cells that a box overlaps from above, by its lowest and highest corners (3,) [m]."""
        rows, columns = self.heights.shape
        (left, front), (right, back) = self._cells(low), self._cells(high)
        if (high[:2] < self.start).any() or (low[:2] > self.end).any() or high[2] < self.base:
            right = left - 1  # none
        i, j = (part.ravel() for part in np.mgrid[front : back + 1, left : right + 1])
        z = self.heights[front : back + 2, left : right + 2]
        if i.size:
            tops = np.maximum(np.maximum(z[:-1, :-1], z[1:, :-1]), np.maximum(z[:-1, 1:], z[1:, 1:])).ravel()
            i, j = i[tops >= low[2]], j[tops >= low[2]]
        first = (i * columns + j)[:, None]
        corners = np.concatenate([first + (0, 1, columns + 1), first + (0, columns + 1, columns)])
        points, is_upper = self.vertices(corners), np.repeat([False, True], i.size)
        a, b, c = points[:, :, 2].T  # the edge along x is from a to b, of an upper triangle from c to b
        slope_x = np.where(is_upper, b - c, b - a) / self.edges[0]
        slope_y = np.where(is_upper, c - a, c - b) / self.edges[1]
        up = np.column_stack([-slope_x, -slope_y, np.ones(len(corners))])
        return Triangles(corners, points, up / np.sqrt((up * up).sum(axis=1))[:, None], is_upper)

    def _cells(self, place: np.ndarray) -> np.ndarray:
        """Column and row of the cell of a place, or of the nearest one."""
        last = np.array(self.heights.shape[::-1]) - 2
        return np.clip(np.floor((place[:2] - self.start) / self.edges), 0, last).astype(int)

    def vertices(self, numbers: np.ndarray) -> np.ndarray:
        """Places of vertices by their numbers [m]."""
        i, j = np.divmod(numbers, self.heights.shape[1])
        return np.stack([self.start[0] + j * self.edges[0], self.start[1] + i * self.edges[1], self.heights[i, j]], axis=-1)

    def height(self, place: np.ndarray) -> float:
        """Height of the surface over or under a place [m]; −inf beside the field."""
        if (place[:2] < self.start).any() or (place[:2] > self.end).any():
            return -np.inf
        j, i = self._cells(place)
        u, v = (place[:2] - self.start) / self.edges - (j, i)
        (a, b), (d, c) = self.heights[i : i + 2, j : j + 2].tolist()
        return float(a + u * (b - a) + v * (c - b) if u >= v else a + v * (d - a) + u * (c - d))

    def margin(self, place: np.ndarray) -> float:
        """Distance of a place of the solid from its sides and its bottom, which nothing touches [m]."""
        return float(min((place[:2] - self.start).min(), (self.end - place[:2]).min(), place[2] - self.base))

    def has_normal(
        self, corners: np.ndarray, points: np.ndarray, normal: np.ndarray, place: np.ndarray, direction: np.ndarray
    ) -> bool:
        """Whether a direction is one of the normals of the surface at a place of a triangle.

        Parameters
        ----------
        corners, points, normal : ndarray, shape (3,), (3, 3), (3,)
            Numbers of its vertices, these vertices, and its normal.
        place, direction : ndarray, shape (3,)
            The place [m], and a unit vector.
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
        around = ((i + di, j + dj) for di, dj in AROUND)
        return {k * columns + m for k, m in around if 0 <= k < rows and 0 <= m < columns}
