"""Sparse QR of columns scaled to unit length, by modified Gram–Schmidt; linearly dependent columns are left out.

Only R is kept, RᵀR = WᵀW. Its small pivots are accurate to round-off, those of WᵀW only to its square root
(Björck, Numerical Methods for Least Squares Problems, 1996, sec. 2.4 and 6.6.5).
"""

from typing import Any

import numpy as np

from gauss import math
from gauss.codegen import as_number

SMALLEST_DIVISOR = 1e-300


class QR:
    """Triangular factor of a matrix of numbers or expressions, for solving WᵀW y = b.

    ``least_length``: columns below this length are left out. ``cut``: rank tolerance: columns with less than this share of
    their length outside the span of the earlier ones are left out.
    """

    def __init__(self, W: np.ndarray, least_length: float, cut):
        m = W.shape[1]
        self.scale, self.inverse_pivots = [], []
        self.above: list[dict[int, Any]] = [{} for _ in range(m)]  # of each column, entries of R above its pivot
        directions: list[dict[int, Any]] = []
        for j in range(m):
            column = {i: entry for i, entry in enumerate(W[:, j]) if as_number(entry) != 0}
            length = _length(column)
            self.scale.append(math.where(length > least_length, 1.0 / math.maximum(length, SMALLEST_DIVISOR), 0.0))
            column = {i: entry * self.scale[j] for i, entry in column.items()}
            self._orthogonalise(j, column, directions)
            pivot = _length(column)
            self.inverse_pivots.append(math.where(pivot > cut, 1.0 / math.maximum(pivot, SMALLEST_DIVISOR), 0.0))
            directions.append({i: entry * self.inverse_pivots[j] for i, entry in column.items()})

    def _orthogonalise(self, j: int, column: dict[int, Any], directions: list[dict[int, Any]]):
        """Subtract the components along earlier directions from column j, in place."""
        for k, direction in enumerate(directions):
            shared = [i for i in direction if i in column]
            if not shared:
                continue
            self.above[j][k] = sum(direction[i] * column[i] for i in shared)
            for i, entry in direction.items():
                column[i] = column.get(i, 0.0) - self.above[j][k] * entry

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution y (m,) of WᵀW y = b; 0 for columns that are left out."""
        m = len(self.above)
        y = [b[j] * self.scale[j] for j in range(m)]
        for j in range(m):
            y[j] = (y[j] - sum(entry * y[k] for k, entry in self.above[j].items())) * self.inverse_pivots[j]
        for j in reversed(range(m)):
            y[j] = y[j] * self.inverse_pivots[j]
            for k, entry in self.above[j].items():
                y[k] = y[k] - entry * y[j]
        return np.array([*(y[j] * self.scale[j] for j in range(m)), None], dtype=object)[:-1]


def _length(column: dict):
    return np.sqrt(sum(entry * entry for entry in column.values())) if column else 0.0
