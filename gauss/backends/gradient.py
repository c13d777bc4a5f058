"""Conjugate gradients on the rows of F2s, C Cᵀ y = C x_free − d, without any factorisation.

From the free motion, every step goes along a conjugate direction of the gradient of the rows, so that the compulsion
is least in the space of all directions so far (Hestenes and Stiefel 1952, CGLS). At most rank(C) steps in exact
arithmetic, linear rate (√κ − 1)/(√κ + 1) with κ = cond(C Cᵀ). Round-off spoils conjugacy, so the search is
restarted until the residual no longer halves; the iterations are the steps of all rounds.
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import ROUNDED_STEP, scaled
from gauss.backends.solution import Answer

MOST_RESTARTS = 20  # rounds
STALLED_RATIO = 0.5  # of residuals after and before a round: above it, round-off is reached


class Gradient:
    """Conjugate gradient search; redundant rows are harmless, inconsistent ones give least squares."""

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
