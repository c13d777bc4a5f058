"""Range-space method: rank-revealing Cholesky factor of the Schur complement S = C Cᵀ of F2s.

S y = C x_free − d,   x = x_free − Cᵀ y
"""

import numpy as np
from scipy.linalg import lapack, solve_triangular

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import scaled
from gauss.backends.rank import SCHUR_RANK
from gauss.backends.solution import Answer


class Schur:
    """Schur complement with pivoted Cholesky and one refinement."""

    name = "schur"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        C = form.C.csc()
        S = (C @ C.T).toarray()
        factor, pivots, rank, _ = lapack.dpstrf(S, tol=SCHUR_RANK, lower=0)
        kept = pivots[:rank] - 1
        U = np.triu(factor[:rank, :rank])
        y, x = np.zeros(len(S)), form.x_free.copy()
        for _ in range(2):
            right = (C @ x - form.d)[kept]
            y[kept] += solve_triangular(U, solve_triangular(U, right, trans="T"))
            x = form.x_free - C.T @ y
        return form.answer(x, y, iterations=1)
