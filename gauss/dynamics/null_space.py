"""Null space and pseudo-inverse of constraint rows, in shares of the units of the scene."""

from functools import cached_property

import numpy as np

from gauss.backends.rank import COARSEST_LOOP_RANK, numerical_rank

RANK_TOLERANCE = 1e-9  # singular values below this share of the largest are zero
ROUND_OFF = 1e-13  # rows below this share of the longest bind nothing
TIES = 1e-6  # share by which one of equally good coordinates is preferred to the next one


def row_lengths(rows: np.ndarray, residual: float = 0.0) -> np.ndarray:
    """Lengths (m,) by which rows (m, n) are divided, so that units do not decide on the rank; 1 for rows of round-off."""
    lengths = np.linalg.norm(rows, axis=1)
    return np.where(lengths > max(ROUND_OFF, residual) * lengths.max(initial=0.0), lengths, 1.0)


class RowSpace:
    """Constraint rows by their singular values.

    A residual η of the state makes redundant rows look independent by η, and the answer wrong by η/σ for the least singular
    value σ: a rank tolerance of √η balances the two.

    ``units`` (n,): units of the coordinates. ``residual``: residual η of the state, relative. ``held``: places of
    coordinates that further rows keep at their values.

    Attributes: ``rank``: number of independent rows.
    """

    def __init__(self, rows: np.ndarray, units: np.ndarray, residual: float = 0.0, held=()):
        bound = np.concatenate([rows * units, np.eye(units.size)[list(held)]])
        self.units, self.lengths = units, row_lengths(bound, residual)
        self.U, self.sizes, self.Vt = np.linalg.svd(bound / self.lengths[:, None], full_matrices=True)
        tolerance = float(np.clip(np.sqrt(residual), RANK_TOLERANCE, COARSEST_LOOP_RANK))
        self.rank = numerical_rank(self.sizes, tolerance)

    @property
    def condition(self) -> float:
        """Largest singular value over the least of the independent rows; 1 without rows."""
        return float(self.sizes[0] / self.sizes[self.rank - 1]) if self.rank else 1.0

    @cached_property
    def null_space(self) -> np.ndarray:
        """Null space (n, k), with unit rows at the places that pivoting in the units chooses as independent."""
        from scipy.linalg import qr  # takes long to import

        N, n = self.Vt[self.rank :].T, self.units.size
        if not N.shape[1]:
            return N
        _, _, order = qr(N.T * (1.0 - TIES * np.arange(n)), pivoting=True)
        chosen = np.sort(order[: N.shape[1]])
        N = np.linalg.solve(N[chosen].T, N.T).T
        N = self.units[:, None] * N / self.units[chosen]
        N[chosen] = np.eye(len(chosen))
        return N

    @cached_property
    def pseudo_inverse(self) -> np.ndarray:
        """Pseudo-inverse (n, m): of what meets the rows, the least in the units."""
        k = self.rank
        return self.units[:, None] * ((self.Vt[:k].T / self.sizes[:k]) @ self.U[:, :k].T) / self.lengths
