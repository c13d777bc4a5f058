"""Sparse LU of the regularised KKT matrix of F2s, refined towards the unregularised one.

[1 Cᵀ; C −ε] is quasi-definite: it can be factored in any order, also with redundant rows (Vanderbei 1995). Refinement
on the residual of the true system is the proximal iteration; it converges in a few steps when the rows are consistent.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import ROUNDED_STEP, scaled
from gauss.backends.solution import Answer

REGULARISATION = 1e-9  # ε, for rows of unit length in the mass metric
MOST_REFINEMENTS = 30  # steps
STALLED_STEP = 1e-10  # relative to x: a smaller step that is not half the last one is round-off


class Sparse:
    """Quasi-definite sparse LU with refinement; the iterations count refinement steps."""

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
