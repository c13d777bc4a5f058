"""Targets of several levels by least squares, one level after the other in the null space of those before, within bounds.

    |W (A y − b)|² + μ |y|² → min,   y = y_before + Z z,   A_before Z = 0,   G y ≤ h

for level 0, 1, … (Siciliano and Slotine, 1991; Kanoun, Lamiraux, Wieber, IEEE Trans. Robotics 27, 2011; Escande, Mansard,
Wieber, Int. J. Robotics Research 33, 2014). Targets of a level have no influence on those before: the minimum is
lexicographic. A level whose least squares stay within the bounds calls no QP solver.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from gauss.backends import make
from gauss.backends.programme import Programme
from gauss.backends.programmed import Programmed, attempt
from gauss.errors import BackendError, SimulationError

NEAR_SINGULAR = 1e-8  # singular values of a level relative to its largest, below which it leaves a direction free
CONVEX = 1e-12  # part of the Hessian, relative to its trace, that makes a rank-deficient one strictly convex
ROUNDED_BOUND = 1e-12  # violation of a bound that is round-off, in units of the unknowns


class LevelRows(NamedTuple):
    """Weighted rows of the targets of one level: A y ≈ b."""

    A: np.ndarray  # (m, k) weighted Jacobian along the independent directions
    b: np.ndarray  # (m,) weighted errors or rates


def solver_of(backend: str):
    """QP solver of a name; BackendError if there is no QP solver of this name."""
    method = make(backend)
    if not isinstance(method, Programmed):
        raise BackendError(f"backend {backend!r} solves no QP with inequality rows; name a QP solver, for instance 'daqp'.")
    return method.solver


def lexicographic(levels: Sequence[LevelRows], G: np.ndarray, h: np.ndarray, damping: float, solver) -> np.ndarray:
    """Unknowns (k,) of the lexicographic least squares.

    SimulationError if no unknowns are within the bounds, or the solver finds none.

    Parameters
    ----------
    levels : sequence of LevelRows
        Levels in the order of their priority.
    G, h : ndarray, shape (s, k), (s,)
        Bounds G y ≤ h.
    damping : float
        μ ≥ 0: directions that the rows do not determine stay at rest.
    solver : object
        From :func:`solver_of`.
    """
    y, Z = np.zeros(G.shape[1]), np.eye(G.shape[1])
    for rows in levels:
        if not Z.shape[1]:
            break
        y = y + Z @ _least_squares(rows.A @ Z, rows.b - rows.A @ y, G @ Z, h - G @ y, damping, solver)
        Z = Z @ _null_space(rows.A @ Z)
    return y


def _null_space(A: np.ndarray) -> np.ndarray:
    """Orthonormal null space (n, k)."""
    _, sizes, Vt = np.linalg.svd(A, full_matrices=True)
    return Vt[int((sizes > NEAR_SINGULAR * sizes.max(initial=0.0)).sum()) :].T


def _least_squares(A, b, G, h, damping: float, solver) -> np.ndarray:
    """Least squares within bounds."""
    n = A.shape[1]
    whole = np.concatenate([A, np.sqrt(damping) * np.eye(n)])
    free = np.linalg.lstsq(whole, np.concatenate([b, np.zeros(n)]), rcond=NEAR_SINGULAR)[0]
    if (G @ free <= h + ROUNDED_BOUND).all():
        return free
    H = A.T @ A
    H += (damping + CONVEX * max(np.trace(H), 1e-300)) * np.eye(n)
    no_rows, size = sparse.csc_matrix((0, n)), H.diagonal().max()  # solvers stop at absolute tolerances
    programme = Programme(
        "rates", sparse.csc_matrix(H / size), -A.T @ b / size, no_rows, np.zeros(0), sparse.csc_matrix(G), h, lambda *_: None
    )
    outcome = attempt(solver, programme.with_rows_of_unit_length())
    if outcome.x is None:
        raise SimulationError(
            f"no rates are within the limits: {outcome.message}. The constraints or prescribed drives move a coordinate "
            "beyond its limit, or the limits contradict each other."
        )
    return outcome.x
