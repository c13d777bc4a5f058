"""Numerical rank: how many singular values, or pivots, of a matrix are more than round-off.

Rows are scaled to unit length first. Redundant rows of consistent scenes then lie near 10⁻¹⁵ of the largest value,
independent ones seldom below 10⁻⁶: each tolerance lies between, where its matrix keeps the two apart best.
"""

import numpy as np

ROWS_RANK = 1e-10  # relative, of the rows of F2s
SCHUR_RANK = 1e-13  # pivot of their Schur complement C Cᵀ, whose diagonal is one: its values are squares
KKT_RANK = 1e-13  # relative, of the equilibrated KKT matrix, whose values range wider than those of the rows
LOOP_RANK = 1e-9  # relative, of the projected rows outside the tree, in a state that meets its constraints
COARSEST_LOOP_RANK = 1e-3  # relative: a state with large residuals still has independent rows


def numerical_rank(values: np.ndarray, tolerance: float) -> int:
    """Number of values above a tolerance relative to the first, which is the largest.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Singular values, or absolute pivots of a factorisation with pivoting.
    tolerance : float
        Relative tolerance.
    """
    return int((values > tolerance * values[:1].max(initial=0.0)).sum())
