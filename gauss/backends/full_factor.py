"""Singular value decomposition of the whole KKT matrix of the full form F1, equilibrated.

    [Φ 0 Aᵀ; 0 0 Bᵀ; A B 0] = U σ Vᵀ

It is the slowest method, and takes most: redundant rows, bodies without mass, joints that move no inertia. Its null space
tells undetermined multipliers from undetermined accelerations.
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.rank import KKT_RANK, numerical_rank
from gauss.errors import BackendError

UNDETERMINED_MOTION = 1e-6  # accelerations in a null vector of length 1 that are more than round-off


class FullFactor(KKTFactor):
    """Singular value decomposition of the KKT matrix, as a factorisation of it.

    Parameters
    ----------
    compulsion : Compulsion
        Source of all matrices.
    active : ndarray of int, optional
        Inequality rows that are held as equalities.

    Raises
    ------
    BackendError
        If neither inertia nor rows determine some acceleration.
    """

    def __init__(self, compulsion: Compulsion, active=()):
        self.compulsion, self.active = compulsion, np.asarray(active, dtype=int)
        rows = np.concatenate([np.hstack([compulsion.A, compulsion.B]), compulsion.G[self.active]])
        n, p = compulsion.Phi.size, compulsion.P.size
        K = np.zeros((n + p + len(rows),) * 2)
        K[:n, :n] = np.diag(compulsion.Phi)
        K[n + p :, : n + p], K[: n + p, n + p :] = rows, rows.T
        self.scale = equilibrate(K)
        U, sigma, Vt = np.linalg.svd(self.scale[:, None] * K * self.scale)
        rank = numerical_rank(sigma, KKT_RANK)
        self.U, self.sigma, self.Vt, self.null = U[:, :rank], sigma[:rank], Vt[:rank], Vt[rank:].T
        self._refuse_free_motion(n + p)

    def _refuse_free_motion(self, size: int):
        moving = np.linalg.norm(self.null[:size], axis=1)
        if moving.max(initial=0.0) > UNDETERMINED_MOTION:
            structure, k = self.compulsion.structure, int(moving.argmax())
            n = self.compulsion.Phi.size
            name = structure.bodies[k // 6] if k < n else structure.coordinates[k - n]
            raise BackendError(f"neither inertia nor constraints determine the acceleration of {name!r}.")

    def solve_columns(self, r1, r2, r3, r4) -> Correction:
        """Solve with the given right-hand sides, least norm where rows are redundant."""
        scale = self.scale[:, None]
        right = np.concatenate([r1, r3, r2, r4]) * scale
        x = scale * (self.Vt.T @ ((self.U.T @ right) / self.sigma[:, None]))
        a, qdd, multipliers, mu = np.split(x, np.cumsum([len(r1), len(r3), len(r2)]))
        return a, qdd, multipliers, mu

    def free_multipliers(self) -> np.ndarray:
        """Basis (r, k) of the null space of [A B]ᵀ."""
        start = self.compulsion.Phi.size + self.compulsion.P.size
        return (self.scale[:, None] * self.null)[start : start + self.compulsion.D.size]

    def free_part(self, multipliers, mu) -> tuple[np.ndarray, np.ndarray]:
        """Projection of λ, and of the μ of active rows, on this null space."""
        start = self.scale.size - multipliers.size - mu.size
        z = np.concatenate([multipliers, mu]) / self.scale[start:]
        part = self.scale[start:] * (self.null[start:] @ (self.null[start:].T @ z))
        return part[: multipliers.size], part[multipliers.size :]


def equilibrate(K: np.ndarray, sweeps: int = 3) -> np.ndarray:
    """Symmetric scaling that brings the largest entry of each row near 1 (Ruiz, RAL-TR-2001-034)."""
    scale = np.ones(len(K))
    for _ in range(sweeps):
        largest = np.abs(scale[:, None] * K * scale).max(axis=1)
        scale /= np.sqrt(np.where(largest > 0, largest, 1.0))
    return scale
