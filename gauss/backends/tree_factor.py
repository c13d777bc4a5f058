"""Dynamic programming on the compulsion along the spanning tree (Vereshchagin 1974; Featherstone 2008, ch. 7).

Each body is reached through six rows A_o a_o + A_i a_i + B q̈ = D, hence a_o = X a_i + E q̈ + c with X = −A_o⁻¹A_i,
E = −A_o⁻¹B, c = A_o⁻¹D. The cost-to-go of a subtree is ½ aᵀ Î a + p̂ᵀ a. Inward, from the leaves:

    S = Eᵀ Î E,   u = P − Eᵀ p̂,   Î_i += Xᵀ (Î − Î E S⁻¹ Eᵀ Î) X,   p̂_i += Xᵀ (p̂ + Î_a c + Î E S⁻¹ u)

outward: q̈ = S⁻¹ (u − Eᵀ Î (X a_i + c)) and a. It is the elimination of the KKT system leaf by leaf, in O(n).
Multipliers of the rows outside the tree (loops, couplings, active inequalities) follow from a small system, see ``closure``.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.errors import BackendError

SINGULAR_PIVOT = 1e-15  # of the inertia that a joint moves, with ones on its diagonal: no more than round-off


class EliminatedBody(NamedTuple):
    """Matrices of the elimination of one body, in the letters at the head of this file."""

    A_inverse: np.ndarray
    X: np.ndarray | None  # None for a body reached from the ground
    E: np.ndarray
    U: np.ndarray
    S_inverse: np.ndarray
    projected: np.ndarray
    inertia: np.ndarray


class TreeFactor:
    """Factorisation of the spanning tree: solves for any right-hand side, many at once.

    Parameters
    ----------
    compulsion : Compulsion
        Source of Φ, A and B.

    Raises
    ------
    BackendError
        If a joint moves no inertia.
    """

    def __init__(self, compulsion: Compulsion):
        structure = compulsion.structure
        self.structure = structure
        inertia = [np.diag(compulsion.Phi[6 * i : 6 * i + 6]) for i in range(structure.n_bodies)]
        self.columns = [structure.constraints[e.constraint].columns[0] for e in structure.tree]
        self.rows = [structure.constraints[e.constraint].rows for e in structure.tree]
        inward: list[EliminatedBody] = []
        for k in range(len(structure.tree) - 1, -1, -1):
            edge = structure.tree[k]
            bodies = structure.constraints[edge.constraint].bodies
            blocks = compulsion.A_blocks[edge.constraint]
            A_inverse = np.linalg.inv(blocks[bodies.index(edge.outer)])
            E = -A_inverse @ compulsion.B_blocks[edge.constraint][0]
            inertia_here = inertia[edge.outer]
            U = inertia_here @ E
            S_inverse = self._invert(E.T @ U, edge)
            free = np.eye(6) - E @ (S_inverse @ U.T)
            projected = free.T @ inertia_here @ free  # Î − U S⁻¹ Uᵀ cancels to noise when something heavy hangs here
            X = None
            if edge.inner >= 0:
                X = -A_inverse @ blocks[bodies.index(edge.inner)]
                inertia[edge.inner] = inertia[edge.inner] + X.T @ projected @ X
            inward.append(EliminatedBody(A_inverse, X, E, U, S_inverse, projected, inertia_here))
        self.steps = inward[::-1]

    def _invert(self, S, edge):
        if not S.size:
            return S
        diagonal = S.diagonal()
        if (diagonal > 0).all():
            if S.size == 1:
                return 1.0 / S
            scale = 1.0 / np.sqrt(diagonal)
            scaled = scale[:, None] * S * scale
            if _least_pivot(scaled) > SINGULAR_PIVOT:
                return scale[:, None] * np.linalg.inv(scaled) * scale
        name = self.structure.constraints[edge.constraint].name
        raise BackendError(f"joint {name!r} moves no inertia: its acceleration is undetermined; give mass to what it moves.")

    def solve(self, f, D, P):
        """Solve for a (6n, m), q̈ (p, m), λ (r, m) given right-hand sides of the same shapes.

        Rows and columns outside the tree stay untouched (zero). Also returns u, the drive force less the load of the
        subtree along the freedoms of each joint, joint by joint.
        """
        n = self.structure.n_bodies
        p = [-f[6 * i : 6 * i + 6] for i in range(n)]
        c, u = [None] * len(self.steps), [None] * len(self.steps)
        for k in range(len(self.steps) - 1, -1, -1):
            edge, step = self.structure.tree[k], self.steps[k]
            c[k] = step.A_inverse @ D[self.rows[k]]
            u[k] = P[self.columns[k]] - step.E.T @ p[edge.outer]
            if step.X is not None:
                carried = p[edge.outer] + step.projected @ c[k] + step.U @ (step.S_inverse @ u[k])
                p[edge.inner] = p[edge.inner] + step.X.T @ carried
        a, qdd, multipliers = np.empty_like(f), np.zeros_like(P), np.zeros_like(D)
        for k, edge in enumerate(self.structure.tree):
            step = self.steps[k]
            carried = c[k] if step.X is None else step.X @ a[6 * edge.inner : 6 * edge.inner + 6] + c[k]
            rates = step.S_inverse @ (u[k] - step.U.T @ carried)
            here = carried + step.E @ rates
            qdd[self.columns[k]] = rates
            a[6 * edge.outer : 6 * edge.outer + 6] = here
            multipliers[self.rows[k]] = -step.A_inverse.T @ (step.inertia @ here + p[edge.outer])
        return a, qdd, multipliers, u

    def carried(self, rates):
        """Quasi-velocities (6n, m) of the bodies when the joints move with the given rates (p, m)."""
        a = np.zeros((6 * self.structure.n_bodies, rates.shape[1]))
        for k, edge in enumerate(self.structure.tree):
            step, here = self.steps[k], slice(6 * edge.outer, 6 * edge.outer + 6)
            a[here] = step.E @ rates[self.columns[k]]
            if step.X is not None:
                a[here] += step.X @ a[6 * edge.inner : 6 * edge.inner + 6]
        return a


def _least_pivot(S) -> float:
    """Smallest pivot of a symmetric matrix; 0 if it is not positive definite."""
    try:
        return float(np.linalg.cholesky(S).diagonal().min()) ** 2
    except np.linalg.LinAlgError:
        return 0.0
