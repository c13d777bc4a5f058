"""Sparse methods for equality rows of F2s: one factors, the other only multiplies."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import ROUNDED_STEP, scaled
from gauss.backends.solution import Answer

REGULARISATION = 1e-9  # ε, for rows of unit length in the mass metric
MOST_REFINEMENTS = 30  # steps
STALLED_STEP = 1e-10  # relative to x: a smaller step that is not half the last one is round-off
MOST_RESTARTS = 20  # rounds
STALLED_RATIO = 0.5  # of residuals after and before a round: above it, round-off is reached


class Sparse:
    """Sparse LU of the regularised KKT matrix of F2s, refined towards the unregularised one.

    [1 Cᵀ; C −ε] is quasi-definite: it can be factored in any order, also with redundant rows (Vanderbei 1995). Refinement
    on the residual of the true system is the proximal iteration; it converges in a few steps when the rows are consistent.
    The iterations count refinement steps.
    """

    name = "sparse"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        C = form.C.csc()
        n, m = form.x_free.size, form.d.size
        one = sparse.eye_array(n)
        matrix = sparse.block_array([[one, C.T], [C, -REGULARISATION * sparse.eye_array(m)]], format="csc")
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        x, y = np.zeros(n), np.zeros(m)
        last = float(np.inf)
        steps = 0
        for _ in range(MOST_REFINEMENTS):
            residual = np.concatenate([form.x_free - x - C.T @ y, form.d - C @ x])
            step = factor.solve(residual)
            x, y = x + step[:n], y + step[n:]
            steps += 1
            size, scale = float(np.linalg.norm(step[:n])), np.linalg.norm(x)
            if size <= ROUNDED_STEP * scale or (size < STALLED_STEP * scale and size > last / 2):
                break
            last = size
        return form.answer(x, y, iterations=steps)


class Gradient:
    """Conjugate gradients on the rows of F2s, C Cᵀ y = C x_free − d, without any factorisation.

    From the free motion, every step goes along a conjugate direction of the gradient of the rows, so that the compulsion
    is least in the space of all directions so far (Hestenes and Stiefel 1952, CGLS). At most rank(C) steps in exact
    arithmetic, linear rate (√κ − 1)/(√κ + 1) with κ = cond(C Cᵀ). Round-off spoils conjugacy, so the search is
    restarted until the residual no longer halves; the iterations are the steps of all rounds. Redundant rows are
    harmless, inconsistent ones give least squares.
    """

    name = "gradient"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        C = form.C.csc().tocsr()
        y, total = np.zeros(form.d.size), 0
        residual = C @ form.x_free - form.d
        size = scale = np.linalg.norm(residual)
        for _ in range(MOST_RESTARTS):
            step, iterations = _search(C, residual, ROUNDED_STEP * scale)
            total += iterations
            trial = C @ (form.x_free - C.T @ (y + step)) - form.d
            improved = np.linalg.norm(trial)
            if improved >= size:
                break
            y, residual, last, size = y + step, trial, size, improved
            if size > STALLED_RATIO * last or size <= ROUNDED_STEP * scale:
                break
        return form.answer(form.x_free - C.T @ y, y, iterations=total)


def _search(C, right, goal):
    """Conjugate gradients for C Cᵀ y = right by the normal equations; y and the number of steps."""
    y, x, residual = np.zeros_like(right), np.zeros(C.shape[1]), right.copy()
    direction = residual.copy()
    square = residual @ residual
    for step in range(4 * right.size + 1):
        if np.sqrt(square) <= goal:
            return y, step
        p = C.T @ direction
        curvature = p @ p
        if curvature == 0:
            return y, step
        alpha = square / curvature
        y += alpha * direction
        x += alpha * p
        residual -= alpha * (C @ p)
        last, square = square, residual @ residual
        direction = residual + square / last * direction
    return y, step
