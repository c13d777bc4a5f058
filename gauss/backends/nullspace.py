"""Null space by rank-revealing QR of the rows of F2s.

Cᵀ Π = Q R: the first columns Q₁ of Q span the rows, the others the free motions. In the mass
metric the reduced Hessian is the identity, so the free part of x_free is already the minimum:

    x = Q₁ R₁⁻ᵀ d + (1 − Q₁Q₁ᵀ) x_free
"""

import numpy as np
from scipy.linalg import qr, solve_triangular

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import scaled
from gauss.backends.rank import ROWS_RANK, numerical_rank
from gauss.backends.solution import Answer


class NullSpace:
    """Null-space method with column-pivoted QR."""

    name = "nullspace"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        if not form.d.size:
            return form.answer(form.x_free, np.zeros(0))
        Q, R, pivots = qr(form.C.toarray().T, mode="economic", pivoting=True)
        rank = numerical_rank(np.abs(np.diag(R)), ROWS_RANK)
        Q, R, kept = Q[:, :rank], R[:rank, :rank], pivots[:rank]
        particular = solve_triangular(R, form.d[kept], trans="T")
        y = np.zeros(form.d.size)
        y[kept] = solve_triangular(R, Q.T @ form.x_free - particular)
        return form.answer(form.x_free + Q @ (particular - Q.T @ form.x_free), y)
