"""Terms on the constraint manifold: v = N ẏ for rates ẏ of independent coordinates, q̈ = N ÿ + b.

The response of the constrained mechanism to unit forces E along the independent coordinates is X = B (Bᵀ M B)⁻¹ Bᵀ E, B any
basis of the null space of K: N = X (Eᵀ X)⁻¹, Nᵀ M N = (Eᵀ X)⁻¹. No basis is chosen, and redundant rows do no harm. The
equations of motion are Nᵀ M N ÿ + Nᵀ (h + M b) = Nᵀ τ (projection onto the null space: Jain, Robot and Multibody Dynamics,
2011, ch. 12).
"""

from functools import cached_property

import numpy as np

from gauss.codegen import Scalar
from gauss.dynamics.aba import invert
from gauss.dynamics.mechanism import Mechanism, loop_constraints
from gauss.dynamics.state_terms import StateTerms
from gauss.system import System


class ConstrainedTerms(StateTerms):
    """Terms of one system in one state that meets its constraints, for k independent coordinates.

    ``system``, ``q``, ``v``, ``t``: as of :class:`StateTerms`. ``independent``: places of the independent rates in v.
    """

    def __init__(self, system: System, q, v, t: Scalar, independent):
        super().__init__(system, q, v, t)
        self.independent = list(independent)

    @cached_property
    def mechanism(self) -> Mechanism:
        """The constrained mechanism."""
        return Mechanism(self.system, self.q, self.v, self.t)

    @cached_property
    def responses(self) -> np.ndarray:
        """Response X (n_v, k) to unit forces along the independent coordinates."""
        rows = np.zeros(self.mechanism.scale.size)
        return np.array([self.mechanism.response(unit, rows)[0] for unit in np.eye(self.system.n_v)[self.independent]]).T

    @cached_property
    def mass_matrix(self) -> np.ndarray:
        """Nᵀ M N (k, k)."""
        return invert(self.responses[self.independent].astype(object))

    @cached_property
    def null_space(self) -> np.ndarray:
        """N (n_v, k), with rows of the unit matrix for the independent coordinates."""
        N = self.responses @ self.mass_matrix
        N[self.independent] = np.eye(len(self.independent))
        return N

    @cached_property
    def null_space_bias(self) -> np.ndarray:
        """Accelerations b (n_v,) at ÿ = 0."""
        mechanism, zeros = self.mechanism, np.zeros(self.system.n_v)
        found = mechanism.response(zeros, mechanism.acceleration_residual(zeros))[0]
        found = mechanism.dependent_accelerations(found)
        return found - self.null_space @ found[self.independent]

    def allowed_acceleration(self, acceleration) -> np.ndarray:
        """N ÿ + b (n_v,), with ÿ the accelerations of the independent coordinates."""
        return self.null_space @ acceleration[self.independent] + self.null_space_bias

    @cached_property
    def loop_constraints(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual c (r,), J N (r, k) and γ − J b (r,): J N ÿ = γ − J b; all three are zero but for round-off."""
        residual, J, bias = loop_constraints(self.system, self.q, self.v, self.t)
        return residual, J @ self.null_space, bias - J @ self.null_space_bias

    def along(self, tau) -> np.ndarray:
        """Nᵀ τ (k,): forces of the constraints drop out."""
        return self.null_space.T @ tau

    @cached_property
    def bias_forces(self) -> np.ndarray:
        """Nᵀ (h + M b) (k,)."""
        return self.null_space.T @ self.tree.inverse_dynamics(self.null_space_bias)

    @cached_property
    def gravity_forces(self) -> np.ndarray:
        """Nᵀ g (k,)."""
        return self.null_space.T @ self.tree_gravity_forces

    @cached_property
    def coriolis_matrix(self) -> np.ndarray:
        """Nᵀ (C N + M Ṅ) (k, k)."""
        N = self.null_space
        return N.T @ (self.tree_coriolis_matrix @ N + self.tree_mass_matrix @ self.rate(N))

    def jacobian(self, frame: str, reference: str) -> np.ndarray:
        """J N (6, k)."""
        return super().jacobian(frame, reference) @ self.null_space

    @cached_property
    def momentum_matrix(self) -> np.ndarray:
        """Centroidal momentum matrix for the independent rates (6, k)."""
        return self.tree_momentum_matrix @ self.null_space
