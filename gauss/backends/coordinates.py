"""F3: the compulsion in the joint accelerations of the spanning tree alone.

With a = J q̈ + γ along the tree, M = JᵀΦJ:

    ½ q̈ᵀ M q̈ − (P + Jᵀ(Φ a_free − Φ γ))ᵀ q̈ → min,   (K_a J + K_q) q̈ = d − K_a γ

Fewest unknowns, but the condition of M grows with the length of the tree and with the ratio of its masses.
"""

import numpy as np

from gauss.backends.closure import outside_rows
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Answer
from gauss.backends.tree_factor import TreeFactor


class Coordinates:
    """The form F3 of a compulsion.

    Attributes
    ----------
    M : ndarray, shape (f, f)
        Inertia matrix of the f coordinates of the tree.
    force : ndarray, shape (f,)
        Generalised forces along them.
    C, d : ndarray, shape (m, f), (m,)
        Rows outside the tree, the coordinates of joints that close loops eliminated.
    K, k : ndarray, shape (s, f), (s,)
        Inequality rows.

    Raises
    ------
    BackendError
        If a joint of the tree moves no inertia.
    """

    def __init__(self, compulsion: Compulsion):
        self.compulsion, tree = compulsion, TreeFactor(compulsion)
        self.tree = tree
        structure = compulsion.structure
        self.rows, self.loops, K_a, K_q = outside_rows(compulsion, np.arange(compulsion.h.size))
        self.columns = np.array([j for c in tree.columns for j in range(c.start, c.stop)], dtype=int)
        units = np.zeros((structure.n_columns, self.columns.size))
        units[self.columns, range(self.columns.size)] = 1.0
        self.J = tree.carried(units)
        self.gamma = self._bias()
        self.M = self.J.T @ (compulsion.Phi[:, None] * self.J)
        self.force = compulsion.P[self.columns] + self.J.T @ (compulsion.impressed - compulsion.Phi * self.gamma)
        N = K_q[: self.rows.size, self.loops]
        Q, R = np.linalg.qr(N, mode="complete") if self.loops.size else (np.eye(self.rows.size), N)
        self.R: np.ndarray = R[: self.loops.size]
        self.held, self.rest = Q[:, : self.loops.size], Q[:, self.loops.size :]
        self.K_a, all_rows = K_a, K_a @ self.J + K_q[:, self.columns]
        right = np.concatenate([compulsion.D[self.rows], compulsion.h]) - K_a @ self.gamma
        m = self.rows.size
        self.in_tree, self.right = all_rows[:m], right[:m]
        if self.loops.size:  # drives of joints that close loops act through the loop constraints
            held = self.held @ np.linalg.solve(self.R.T, compulsion.P[self.loops])
            self.force = self.force - self.in_tree.T @ held
        self.C, self.d = self.rest.T @ all_rows[:m], self.rest.T @ right[:m]
        # inequality rows on joints that close loops: q̈_loop = R⁻¹ heldᵀ (right − rows q̈)
        follow = np.linalg.solve(self.R, self.held.T) if self.loops.size else np.zeros((0, m))
        G_loop = K_q[m:, self.loops] @ follow
        self.K, self.k = all_rows[m:] - G_loop @ all_rows[:m], right[m:] - G_loop @ right[:m]
        self.G_loop = K_q[m:, self.loops]

    def _bias(self) -> np.ndarray:
        """Accelerations γ (6n,) when no joint of the tree accelerates."""
        gamma = np.zeros(self.compulsion.Phi.size)
        for edge, step, rows in zip(self.compulsion.structure.tree, self.tree.steps, self.tree.rows, strict=True):
            here = slice(6 * edge.outer, 6 * edge.outer + 6)
            gamma[here] = step.A_inverse @ self.compulsion.D[rows]
            if step.X is not None:
                gamma[here] += step.X @ gamma[6 * edge.inner : 6 * edge.inner + 6]
        return gamma

    def answer(self, x, y, z, **outcome) -> Answer:
        """Accelerations and multipliers of the full form from q̈ of the tree and the multipliers y, z."""
        compulsion = self.compulsion
        qdd = np.zeros(compulsion.structure.n_columns)
        qdd[self.columns] = x
        a = self.J @ x + self.gamma
        y_outside = self.rest @ y
        if self.loops.size:
            qdd[self.loops] = np.linalg.solve(self.R, self.held.T @ (self.right - self.in_tree @ x))
            y_outside = y_outside + self.held @ np.linalg.solve(self.R.T, compulsion.P[self.loops] - self.G_loop.T @ z)
        multipliers = np.zeros(compulsion.structure.n_rows)
        multipliers[self.rows] = y_outside
        self._tree_multipliers(a, z, multipliers)
        return Answer(a, qdd, multipliers, z, **outcome)

    def _tree_multipliers(self, a, z, multipliers):
        """Add the multipliers of the tree, from the leaves inwards, by the residual force of each body."""
        compulsion, structure = self.compulsion, self.compulsion.structure
        residual = compulsion.residuals(a, np.zeros(structure.n_columns), multipliers)[0]
        residual += compulsion.G[:, : a.size].T @ z
        for edge, step, rows in reversed(list(zip(structure.tree, self.tree.steps, self.tree.rows, strict=True))):
            here = slice(6 * edge.outer, 6 * edge.outer + 6)
            multipliers[rows] = -step.A_inverse.T @ residual[here]
            if step.X is not None:  # A_i = −A_o X
                residual[6 * edge.inner : 6 * edge.inner + 6] += step.X.T @ residual[here]
