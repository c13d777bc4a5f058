"""Gradient search for the least compulsion: conjugate gradients on the rows of F2s, without any factorisation.

Starting at the free motion, every step moves along the rows' gradient, directions conjugate, so that the compulsion
of the deviation stays least for the rows met so far (Hestenes and Stiefel 1952, CGLS). At most rank(C) steps in exact
arithmetic, linear rate (√κ − 1)/(√κ + 1) with κ = cond(C Cᵀ). Rounding spoils conjugacy, so the search starts again
from where it is until nothing improves; the iterations are the steps of all rounds.
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import scaled
from gauss.backends.solution import Answer

ROUNDS = 20
CONVERGED = 1e-15  # residual relative to the right-hand side
STALLED = 0.5  # a round that does not halve the residual has reached rounding


class Gradient:
    """Conjugate gradient search; redundant rows are harmless, inconsistent ones give least squares."""

    name = "gradient"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        C = form.C.tocsr()
        y, total = np.zeros(form.d.size), 0
        residual = C @ form.x_free - form.d
        size = scale = np.linalg.norm(residual)
        for _ in range(ROUNDS):
            step, iterations = _search(C, residual, CONVERGED * scale)
            total += iterations
            trial = C @ (form.x_free - C.T @ (y + step)) - form.d
            improved = np.linalg.norm(trial)
            if improved >= size:
                break
            y, residual, last, size = y + step, trial, size, improved
            if size > STALLED * last or size <= CONVERGED * scale:
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
