"""Sparse block LDLᵀ as a sequence of recorded calls: order and fill are fixed by symbolic analysis.

Right-looking elimination by minimum degree, as :class:`gauss.codegen.LDLT` for scalars; here each product of dense blocks
is a call of one of a few functions, whatever the size of the matrix.
"""

import numpy as np

from gauss.codegen import LDLT, least_degree
from gauss.codegen.kernels.call_recorder import CallRecorder, Operand


class BlockLDLT:
    """Factorisation of S + μ 1, S symmetric and positive semidefinite.

    Parameters
    ----------
    cells : CallRecorder
        Recorder of the calls.
    blocks : dict
        Blocks of S on its diagonal and on one side of it, {(i, j): block}, indexed by block rows.
    mu : float
        Regularisation μ.

    Attributes
    ----------
    columns : dict
        Blocks of L below the diagonal, {j: {i: block}}, in the order of elimination.
    inverse : dict
        Blocks of D⁻¹.
    """

    def __init__(self, cells: CallRecorder, blocks: dict, mu: float):
        self.cells = cells
        rows = [i for i, j in blocks if i == j]
        number = {i: k for k, i in enumerate(rows)}
        order = [rows[k] for k in least_degree(len(rows), [(number[i], number[j]) for i, j in blocks])]
        place = {i: k for k, i in enumerate(order)}
        pivots = {i: blocks[i, i] for i in rows}
        rest: dict = {i: {} for i in rows}  # blocks of each column in rows of later elimination
        for (i, j), block in blocks.items():
            if place[i] > place[j]:
                rest[j][i] = block
            elif place[i] < place[j]:
                rest[i][j] = self._call("transposed", lambda A: A.T, block)
        self.columns, self.inverse = {}, {}
        for j in order:
            below = rest.pop(j)
            self.inverse[j] = self._call(("inverse", mu), lambda A: _inverse(A, mu), pivots[j])
            self.columns[j] = {
                i: self._call("column", lambda A, D: A @ D, block, self.inverse[j]) for i, block in below.items()
            }
            for i, L in self.columns[j].items():
                pivots[i] = self._call("update", _update, pivots[i], L, below[i])
                for k, block in below.items():
                    if place[k] < place[i]:
                        known = rest[k][i] if i in rest[k] else np.zeros((L.shape[0], block.shape[0]))
                        rest[k][i] = self._call("update", _update, known, L, block)

    def solve(self, parts: dict) -> dict:
        """Record the solution of a right-hand side; both are dicts by block row."""
        parts = dict(parts)
        for j, column in self.columns.items():
            for i, L in column.items():
                parts[i] = self._call("forward", lambda x, L, y: x - L @ y, parts[i], L, parts[j])
        for j, column in reversed(self.columns.items()):
            parts[j] = self._call("times", lambda D, x: D @ x, self.inverse[j], parts[j])
            for i, L in column.items():
                parts[j] = self._call("backward", lambda x, L, y: x - L.T @ y, parts[j], L, parts[i])
        return parts

    def _call(self, name, function, *blocks) -> Operand:
        (found,) = self.cells.call(name, lambda *given: (function(*given),), *blocks)
        return found


def _update(known, L, block):
    return known - L @ block.T


def _inverse(A: np.ndarray, mu: float) -> np.ndarray:
    """Inverse of A + μ 1; only the lower triangle of A is read."""
    n = len(A)
    factor = LDLT(A + mu * np.eye(n))
    return np.array([factor.solve(unit) for unit in np.eye(n)], dtype=object).T
