"""Rows outside the spanning tree: loop constraints, couplings, active inequalities; their multipliers y from a small system.

With the rows K_a a + K_q q̈_tree + N q̈_loop = d and their multipliers y, the tree answers affinely:
a = a₀ − (tree) K_aᵀ y. Hence the small system

    W_ᵀW y − N q̈_loop = K_a a₀ + K_q q̈₀ − d,   Nᵀ y = P_loop,      WᵀW = K M⁻¹ Kᵀ

in which W, half a factor, comes out of the recursion: W_k = S_k^{-½} u_k for each joint. N is eliminated by an
orthogonal split of the rows, and the rank is decided on W, whose condition is the root of that of WᵀW, by its singular
values: W = U σ Zᵀ, (WᵀW)⁺ = Z σ⁻² Zᵀ.
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.rank import COARSEST_LOOP_RANK, LOOP_RANK, numerical_rank
from gauss.backends.structure import Structure
from gauss.backends.tree_factor import TreeFactor

MET_BY_TREE = 1e-8  # √round-off, of the length of a row if its bodies were free: below it the tree alone meets the row


class Factor(KKTFactor):
    """Factorisation of the whole KKT system: the tree, then the rows outside it.

    Parameters
    ----------
    compulsion : Compulsion
        Source of all matrices.
    active : ndarray of int, optional
        Inequality rows that are held as equalities.
    """

    def __init__(self, compulsion: Compulsion, active=()):
        self.compulsion, self.active = compulsion, np.asarray(active, dtype=int)
        self.tree = tree = TreeFactor(compulsion)
        active, structure = self.active, compulsion.structure
        self.rows, self.loop_columns, self.K_a, self.K_q = outside_rows(compulsion, active)
        self.size = self.rows.size + active.size
        if not self.size:
            return
        N = self.K_q[:, self.loop_columns]
        K_tree = self.K_q.copy()
        K_tree[:, self.loop_columns] = 0.0
        zero = np.zeros((structure.n_rows, self.size))
        *self.response, short = tree.solve(self.K_a.T, zero, K_tree.T)
        self.K_tree = K_tree
        Q, R = np.linalg.qr(N, mode="complete") if N.shape[1] else (np.eye(self.size), N)
        self.held, self.rest = Q[:, : N.shape[1]], Q[:, N.shape[1] :]
        self.R = R[: N.shape[1]]
        self.W = half_factors(tree, short, self.size)
        # A residual η of the state makes redundant rows look independent by η and their answer wrong by η/σ; a rank
        # tolerance of √η balances that against the error of dropped rows.
        tolerance = float(np.clip(np.sqrt(compulsion.violation), LOOP_RANK, COARSEST_LOOP_RANK))
        self._decompose(self.unbound(compulsion), tolerance)

    def unbound(self, compulsion: Compulsion):
        """Lengths of the projected rows if no joint bound the bodies: their round-off is relative to these."""
        weights = np.divide(1.0, compulsion.Phi, out=np.zeros_like(compulsion.Phi), where=compulsion.Phi > 0)
        drives = half_factors(self.tree, [self.K_tree.T[c] for c in self.tree.columns], self.size)
        rows = np.concatenate([np.sqrt(weights)[:, None] * self.K_a.T, drives])
        return np.linalg.norm(rows @ self.rest, axis=0)

    def _decompose(self, unbound, tolerance: float):
        projected = self.W @ self.rest
        lengths = np.linalg.norm(projected, axis=0)
        binding = lengths > MET_BY_TREE * unbound
        projected[:, ~binding] = 0.0
        self.scale = 1.0 / np.where(binding, lengths, np.where(unbound > 0, unbound, 1.0))
        _, sigma, Z_transposed = np.linalg.svd(projected * self.scale, full_matrices=False)
        self.rank = numerical_rank(sigma, tolerance)
        # multipliers in the range of Z are those of least norm
        self.sigma, self.Z = sigma[: self.rank], Z_transposed[: self.rank].T

    def solve_columns(self, r1, r2, r3, r4) -> Correction:
        """Solve for (a, q̈, λ, μ) with the given right-hand sides; see :class:`KKTFactor`."""
        if not self.size:
            return *self.tree.solve(r1, r2, r3)[:3], r4
        tree_r2, tree_r3 = r2.copy(), r3.copy()
        tree_r2[self.rows], tree_r3[self.loop_columns] = 0.0, 0.0
        a, qdd, multipliers, _ = self.tree.solve(r1, tree_r2, tree_r3)
        target = np.concatenate([r2[self.rows], r4])
        residual = self.K_a @ a + self.K_tree @ qdd - target
        y = self.held @ np.linalg.solve(self.R.T, r3[self.loop_columns]) if self.R.size else np.zeros_like(residual)
        residual = residual - self._delassus(y)
        scale = self.scale[:, None]
        z = scale * (self.rest.T @ residual)
        z = scale * (self.Z @ ((self.Z.T @ z) / self.sigma[:, None] ** 2))
        y = y + self.rest @ z
        if self.R.size:
            right = self._delassus(self.rest @ z) - residual
            qdd[self.loop_columns] = np.linalg.solve(self.R, self.held.T @ right)
        da, dqdd, dmultipliers = self.response
        a, qdd, multipliers = a - da @ y, qdd - dqdd @ y, multipliers - dmultipliers @ y
        multipliers[self.rows] = y[: self.rows.size]
        return a, qdd, multipliers, y[self.rows.size :]

    def _delassus(self, y):
        """K M⁻¹ Kᵀ y."""
        return self.W.T @ (self.W @ y)

    def free_multipliers(self) -> np.ndarray:
        """Basis (r, k) of the null space of [A B]ᵀ: reactions that redundant rows leave undetermined."""
        y = self._free()
        return self._carried(y) if y.size else np.zeros((self.tree.structure.n_rows, 0))

    def free_active(self) -> np.ndarray:
        """Entries (s, k) of this basis for the active inequality rows."""
        return self._free()[self.size - self.active.size :]

    def free_part(self, multipliers, mu) -> tuple[np.ndarray, np.ndarray]:
        """Projection of λ, and of the μ of active rows, on this null space."""
        if not self.size or self.rank == self.rest.shape[1]:
            return np.zeros_like(multipliers), np.zeros_like(mu)
        z = (self.rest.T @ np.concatenate([multipliers[self.rows], mu])) / self.scale
        y = self.rest @ (self.scale * (z - self.Z @ (self.Z.T @ z)))
        return self._carried(y), y[self.rows.size :]

    def _carried(self, y):
        """Multipliers of all rows for y of those outside the tree, without any motion."""
        multipliers = -self.response[2] @ y
        multipliers[self.rows] = y[: self.rows.size]
        return multipliers

    def _free(self) -> np.ndarray:
        if not self.size or self.rank == self.rest.shape[1]:
            return np.zeros((self.size, 0))
        U = np.linalg.svd(self.Z, full_matrices=True)[0] if self.rank else np.eye(self.Z.shape[0])
        return self.rest @ (self.scale[:, None] * U[:, self.rank :])


def outside_rows(compulsion: Compulsion, active: np.ndarray):
    """Rows outside the tree and some inequality rows: their indices, the columns of joints that close loops, K_a and K_q."""
    rows, columns = outside(compulsion.structure)
    return rows, columns, *_dense_rows(compulsion, rows, active)


def outside(structure: Structure):
    """Rows outside the tree, and the columns of joints that close loops."""
    rows = [np.arange(structure.constraints[i].rows.start, structure.constraints[i].rows.stop) for i in structure.closures]
    tree = {edge.constraint for edge in structure.tree}
    in_tree = {j for i in tree for c in structure.constraints[i].columns for j in range(c.start, c.stop)}
    columns = [j for j in range(structure.n_columns) if j not in in_tree]
    return np.concatenate([np.zeros(0, int), *rows]), np.array(columns, dtype=int)


def _dense_rows(compulsion: Compulsion, rows: np.ndarray, active: np.ndarray):
    structure = compulsion.structure
    width = 6 * structure.n_bodies
    K_a, K_q = np.zeros((rows.size + active.size, width)), np.zeros((rows.size + active.size, structure.n_columns))
    start = 0
    for i in structure.closures:
        constraint = structure.constraints[i]
        here = slice(start, start + constraint.rows.stop - constraint.rows.start)
        for body, block in zip(constraint.bodies, compulsion.A_blocks[i], strict=True):
            K_a[here, 6 * body : 6 * body + 6] = block
        for columns, block in zip(constraint.columns, compulsion.B_blocks[i], strict=True):
            K_q[here, columns] = block
        start = here.stop
    K_a[start:], K_q[start:] = compulsion.G[active, :width], compulsion.G[active, width:]
    return K_a, K_q


def half_factors(tree, short, width: int) -> np.ndarray:
    """W_k = S_k^{-½} u_k of every joint of the tree, stacked."""
    parts = [
        np.linalg.cholesky(step.S_inverse).T @ u if step.S_inverse.size else u
        for step, u in zip(tree.steps, short, strict=True)
    ]
    return np.concatenate([np.zeros((0, width)), *parts])
