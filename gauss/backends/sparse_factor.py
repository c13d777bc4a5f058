"""Sparse LU of the KKT matrix of many loops, with regularised rows outside the tree.

    Φ a + Aᵀ λ = r1,   Bᵀ λ = r3,   A a + B q̈ − E λ = r2

Rows of the tree are independent, so E is zero there. Rows outside it may be redundant: with E > 0 the matrix can be factored
all the same, and iteration on the residual of the true rows, E = 0, removes the error (the proximal method of multipliers;
Rockafellar, SIAM Journal on Control and Optimization 14, 1976). For loops that each touch few bodies the
factor has few entries per body, whereas :class:`gauss.backends.closure.Factor` fills the square of the number of rows.
"""

from functools import cached_property

import numpy as np

from gauss.backends.closure import outside
from gauss.backends.compulsion import Compulsion
from gauss.backends.kkt_factor import RANDOM_ROUNDINGS as RANDOM_VECTORS
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.errors import BackendError

REGULARISATION = 1e-10  # E, relative to the square of the length of a row if its bodies were free
PROXIMAL_STEPS = 3  # each halves the residual of rows with a singular value of √REGULARISATION, and that of others much more
NULL_SPACE_STEPS = 4  # proximal steps after which the null space alone is left of multipliers
LEAST_NULL_PART = 1e-4  # of a random vector of length 1: a smaller part in the null space is round-off


class SparseFactor(KKTFactor):
    """Sparse factorisation of the whole KKT system.

    Parameters
    ----------
    compulsion : Compulsion
        Source of all matrices.
    active : ndarray of int, optional
        Inequality rows that are held as equalities.

    Raises
    ------
    BackendError
        If some acceleration is undetermined.
    """

    def __init__(self, compulsion: Compulsion, active=()):
        from scipy import sparse  # takes as long to import as all of gauss; small scenes need no sparse matrix
        from scipy.sparse.linalg import splu

        self.compulsion, self.active = compulsion, np.asarray(active, dtype=int)
        n, p, r = compulsion.Phi.size, compulsion.P.size, compulsion.D.size
        held = sparse.csc_array(compulsion.G[self.active])
        rows = sparse.vstack([sparse.hstack([compulsion.A_sparse, compulsion.B_sparse]), held]).tocsc()
        self.sizes = np.cumsum([n, p, r])
        weights = np.divide(1.0, compulsion.Phi, out=np.zeros(n), where=compulsion.Phi > 0)
        lengths = (rows**2) @ np.concatenate([weights, np.zeros(p)])
        lengths = np.where(lengths > 0, lengths, 1.0)
        outside_tree = np.ones(len(lengths), dtype=bool)
        outside_tree[:r] = False
        outside_tree[outside(compulsion.structure)[0]] = True
        # rows of a state with residuals contradict each other by as much: smaller regularisation tells nothing apart
        self.E = np.where(outside_tree, max(REGULARISATION, compulsion.violation) * lengths, 0.0)
        inertia = sparse.diags_array(np.concatenate([compulsion.Phi, np.zeros(p)]))
        self.matrix = sparse.block_array([[inertia, rows.T], [rows, None]], format="csr")
        if not np.isfinite(self.matrix.data).all():
            raise BackendError("the KKT matrix has entries that are not finite.")
        E = sparse.diags_array(np.concatenate([np.zeros(n + p), self.E]))
        try:
            self.factor = splu((self.matrix - E).tocsc())
        except RuntimeError as error:
            raise BackendError(f"some acceleration is undetermined: the KKT matrix is singular ({error}).") from error

    def solve_columns(self, r1, r2, r3, r4) -> Correction:
        """Solve for (a, q̈, λ, μ) with the given right-hand sides; see :class:`KKTFactor`."""
        right = np.concatenate([r1, r3, r2, r4])
        x = self.factor.solve(right)
        for _ in range(PROXIMAL_STEPS):
            x = x + self.factor.solve(right - self.matrix @ x)
        a, qdd, multipliers, mu = np.split(x, self.sizes)
        return a, qdd, multipliers, mu

    @cached_property
    def _free(self) -> np.ndarray:
        random = np.random.default_rng(0).normal(size=(self.E.size, RANDOM_VECTORS))
        found = self._null_part(random * np.where(self.E > 0, 1.0, 0.0)[:, None])
        reach = np.linalg.norm(found * np.sqrt(self.E)[:, None], axis=0)
        given = np.linalg.norm(random * np.sqrt(self.E)[:, None], axis=0)
        return found[:, reach > LEAST_NULL_PART * given]

    def free_multipliers(self) -> np.ndarray:
        """Random vectors (r, k) of the null space of [A B]ᵀ; k = 0 where it is empty."""
        return self._free[: self.compulsion.D.size]

    def free_part(self, multipliers, mu) -> tuple[np.ndarray, np.ndarray]:
        """Projection of λ, and of the μ of active rows, on this null space."""
        if not self._free.size:
            return np.zeros_like(multipliers), np.zeros_like(mu)
        part = self._null_part(np.concatenate([multipliers, mu])[:, None])[:, 0]
        return part[: multipliers.size], part[multipliers.size :]

    def _null_part(self, multipliers):
        """Part of multipliers (r + s, k) in the null space of [A B]ᵀ, by proximal steps without any load."""
        moved = np.zeros((self.sizes[1], multipliers.shape[1]))
        for _ in range(NULL_SPACE_STEPS):
            found = self.factor.solve(np.concatenate([moved, -self.E[:, None] * multipliers]))
            multipliers = found[self.sizes[1] :]
        return multipliers
