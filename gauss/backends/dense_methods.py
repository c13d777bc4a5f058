"""Dense methods for equality rows: of the whole KKT matrix, and of the rows of F2s."""

import warnings

import numpy as np
from scipy.linalg import LinAlgWarning, cho_factor, cho_solve, lapack, lu_factor, lu_solve, qr, solve_triangular

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import ROUNDED_STEP, scaled
from gauss.backends.full_factor import equilibrate
from gauss.backends.rank import ROWS_RANK, SCHUR_RANK, numerical_rank
from gauss.backends.solution import Answer, failure

# Reciprocal condition of the equilibrated matrix below which rows are redundant or motion is free.
SINGULAR_CONDITION = 1e-14
PROXIMAL_WEIGHT = 1e-8  # μ, for rows of unit length in the mass metric
MOST_ITERATIONS = 100  # steps


class KKT:
    """Dense LU of the whole KKT matrix of the full form F1: the plain statement of the problem. Refuses redundant rows.

    [Φ 0 Aᵀ; 0 0 Bᵀ; A B 0] (a, q̈, λ) = (Φ a_free, P, D)
    """

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


class Schur:
    """Range-space method: rank-revealing Cholesky factor of the Schur complement S = C Cᵀ of F2s, and one refinement.

    S y = C x_free − d,   x = x_free − Cᵀ y
    """

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


class NullSpace:
    """Null space by rank-revealing QR of the rows of F2s.

    Cᵀ Π = Q R: the first columns Q₁ of Q span the rows, the others the free motions. In the mass metric the reduced
    Hessian is the identity, so the free part of x_free is already the minimum:

        x = Q₁ R₁⁻ᵀ d + (1 − Q₁Q₁ᵀ) x_free
    """

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


class Pinv:
    """Mass-weighted pseudo-inverse by singular values (Udwadia and Kalaba, Analytical Dynamics, 1996, eq. 3.2).

    x = x_free + C⁺ (d − C x_free),   x = Φ^½ a

    Least norm for redundant, least squares for inconsistent rows.
    """

    name = "pinv"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        if not form.d.size:
            return form.answer(form.x_free, np.zeros(0))
        U, sigma, Vt = np.linalg.svd(form.C.toarray(), full_matrices=False)
        rank = numerical_rank(sigma, ROWS_RANK)
        U, sigma, Vt = U[:, :rank], sigma[:rank], Vt[:rank]
        shift = U.T @ form.d / sigma - Vt @ form.x_free
        return form.answer(form.x_free + Vt.T @ shift, -U @ (shift / sigma))


class Proximal:
    """Proximal method of multipliers (augmented Lagrangian) on F2s; the number of its iterations is reported.

        x = (1 + CᵀC/μ)⁻¹ (x_free − Cᵀ(y − d/μ)),   y ← y + (C x − d)/μ

    written through (C Cᵀ + μ) y⁺ = C x_free − d + μ y, which needs one Cholesky factor for all iterations (Rockafellar
    1976; Carpentier, Budhiraja, Mansard, RSS 2021). Harmless for redundant rows; inconsistent ones converge to least
    squares.
    """

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
