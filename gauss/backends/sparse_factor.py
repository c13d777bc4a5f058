"""Sparse LU of the KKT matrix of many loops, in whose rows outside the tree a little is given way.

    Φ a + Aᵀ λ = r1,   Bᵀ λ = r3,   A a + B q̈ − E λ = r2

Rows of the tree are independent, so E is zero there. Outside it may be that rows repeat others: with E > 0 the matrix can be
factored all the same, and iteration on the residual of the true rows, E = 0, undoes what was given way (the proximal method
of multipliers; Rockafellar, SIAM Journal on Control and Optimization 14, 1976). For loops that each touch few bodies the
factor has few entries per body, whereas :class:`gauss.backends.closure.Closure` fills the square of the number of rows.
"""

from functools import cached_property

import numpy as np

from gauss.backends.closure import outside
from gauss.backends.compulsion import Compulsion
from gauss.backends.refining import PROBES, Refining
from gauss.errors import BackendError

GIVEN_WAY = 1e-10  # E, of the square of the length that a row would have if its bodies were free
ROUNDS = 3  # of iteration: rows that bind by √GIVEN_WAY lose a factor of two each time, others much more
FADING = 4  # rounds that tell multipliers that move nothing from those that move something
NOTHING = 1e-4  # of a random vector of length 1: a part in the null space that small is rounding


class SparseFactor(Refining):
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
        loose = np.ones(len(lengths), dtype=bool)
        loose[:r] = False
        loose[outside(compulsion.structure)[0]] = True
        # rows of a state off its constraints contradict each other by the gap: below it nothing is told apart
        self.way = np.where(loose, max(GIVEN_WAY, float(compulsion.gap)) * lengths, 0.0)
        inertia = sparse.diags_array(np.concatenate([compulsion.Phi, np.zeros(p)]))
        self.matrix = sparse.block_array([[inertia, rows.T], [rows, None]], format="csr")
        if not np.isfinite(self.matrix.data).all():
            raise BackendError("the KKT matrix has entries that are not finite.")
        way = sparse.diags_array(np.concatenate([np.zeros(n + p), self.way]))
        try:
            self.factor = splu((self.matrix - way).tocsc())
        except RuntimeError as error:
            raise BackendError(f"some acceleration is undetermined: the KKT matrix is singular ({error}).") from error

    def solve_columns(self, r1, r2, r3, r4):
        """Solve for (a, q̈, λ, μ) with the given right-hand sides; see :class:`Refining`."""
        right = np.concatenate([r1, r3, r2, r4])
        x = self.factor.solve(right)
        for _ in range(ROUNDS):
            x = x + self.factor.solve(right - self.matrix @ x)
        return tuple(np.split(x, self.sizes))

    @cached_property
    def _free(self) -> np.ndarray:
        random = np.random.default_rng(0).normal(size=(self.way.size, PROBES))
        found = self._faded(random * np.where(self.way > 0, 1.0, 0.0)[:, None])
        reach = np.linalg.norm(found * np.sqrt(self.way)[:, None], axis=0)
        given = np.linalg.norm(random * np.sqrt(self.way)[:, None], axis=0)
        return found[:, reach > NOTHING * given]

    def free_multipliers(self) -> np.ndarray:
        """Some random multipliers (r, k) that move nothing; k = 0 where there are none."""
        return self._free[: self.compulsion.D.size]

    def free_part(self, multipliers, mu):
        """Part of λ, and of the μ of active rows, that moves nothing."""
        if not self._free.size:
            return np.zeros_like(multipliers), np.zeros_like(mu)
        part = self._faded(np.concatenate([multipliers, mu])[:, None])[:, 0]
        return part[: multipliers.size], part[multipliers.size :]

    def _faded(self, multipliers):
        """What is left of multipliers (r + s, k) when those that move something have given way, row by row."""
        moved = np.zeros((self.sizes[1], multipliers.shape[1]))
        for _ in range(FADING):
            found = self.factor.solve(np.concatenate([moved, -self.way[:, None] * multipliers]))
            multipliers = found[self.sizes[1] :]
        return multipliers
