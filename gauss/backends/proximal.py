"""Proximal method of multipliers (augmented Lagrangian) on F2s, dense.

    x = (1 + CᵀC/μ)⁻¹ (x_free − Cᵀ(y − d/μ)),   y ← y + (C x − d)/μ

written through (C Cᵀ + μ) y⁺ = C x_free − d + μ y, which needs one Cholesky factor for all iterations (Rockafellar
1976; Carpentier, Budhiraja, Mansard, RSS 2021). Harmless for redundant rows; inconsistent ones converge to least squares.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import ROUNDED_STEP, scaled
from gauss.backends.solution import Answer

PROXIMAL_WEIGHT = 1e-8  # μ, for rows of unit length in the mass metric
MOST_ITERATIONS = 100  # steps


class Proximal:
    """Proximal iterations on one Cholesky factor; their number is reported."""

    name = "proximal"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        C, m = form.C.csc(), form.d.size
        factor = cho_factor((C @ C.T).toarray() + PROXIMAL_WEIGHT * np.eye(m)) if m else None
        x, y = form.x_free, np.zeros(m)
        iterations = 0
        for _ in range(MOST_ITERATIONS):
            step = cho_solve(factor, C @ x - form.d) if m else y
            y = y + step
            iterations += 1
            moved = form.x_free - C.T @ y
            change = np.linalg.norm(moved - x)
            x = moved
            if change <= ROUNDED_STEP * np.linalg.norm(x):
                break
        return form.answer(x, y, iterations=iterations)
