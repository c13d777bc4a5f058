"""Dense LU of the whole KKT matrix of the full form F1: the plain statement of the problem.

[Φ 0 Aᵀ; 0 0 Bᵀ; A B 0] (a, q̈, λ) = (Φ a_free, P, D)
"""

import warnings

import numpy as np
from scipy.linalg import LinAlgWarning, lapack, lu_factor, lu_solve

from gauss.backends.compulsion import Compulsion
from gauss.backends.full_factor import equilibrate
from gauss.backends.solution import Answer, failure

SINGULAR_CONDITION = (
    1e-14  # reciprocal condition of the equilibrated matrix below which rows are redundant or motion is free
)


class KKT:
    """Dense KKT; refuses redundant rows."""

    name = "kkt"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        n, p = compulsion.Phi.size, compulsion.P.size
        A, B = compulsion.A, compulsion.B
        size = n + p + compulsion.D.size
        K = np.zeros((size, size))
        K[:n, :n] = np.diag(compulsion.Phi)
        K[n + p :, :n], K[n + p :, n : n + p] = A, B
        K[:n, n + p :], K[n : n + p, n + p :] = A.T, B.T
        scale = equilibrate(K)
        right = np.concatenate([compulsion.impressed, compulsion.P, compulsion.D]) * scale
        scaled = scale[:, None] * K * scale
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LinAlgWarning)  # singularity is reported below, in our words
            factors = lu_factor(scaled)
        condition = lapack.dgecon(factors[0], np.linalg.norm(scaled, 1))[0]
        if condition < SINGULAR_CONDITION:
            return failure(
                compulsion,
                f"the KKT matrix is singular (1/condition {condition:.0e}): redundant rows; use 'recursion' or 'nullspace'",
            )
        x = scale * lu_solve(factors, right)
        return Answer(x[:n], x[n : n + p], x[n + p :], np.zeros(0))
