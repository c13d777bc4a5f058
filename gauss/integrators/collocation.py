"""Coefficients of methods that are symplectic with and without constraints: Gauss–Legendre with Lobatto nodes, RATTLE.

Velocities V_i at s stages, constraints at r + 1 nodes c̃ from 0 to 1:
    Θ_i = h Σ a_ij V_j,  P_i = p₀ + h Σ â_ij F_j − h Σ ã_ij K(Θ̃_j)ᵀ Λ_j,  Θ̃_k = h Σ ā_kj V_j,  g(Θ̃_k) = 0.
Symplectic are â_ij = b_j (1 − a_ji / b_i) and ã_ij = b̃_j (1 − ā_ji / b_i)
(Jay, Specialized partitioned additive Runge–Kutta methods for systems of overdetermined DAEs with holonomic constraints,
SIAM J. Numer. Anal. 45, 2007; Hairer, Lubich, Wanner, Geometric Numerical Integration, VI.4 and VII.1.4).
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SymplecticTableau:
    """Coefficients of a symplectic method."""

    a: np.ndarray  # a (s, s), b (s,), c (s,): coefficients, weights and nodes of the positions
    b: np.ndarray
    c: np.ndarray
    a_nodes: np.ndarray  # (r, s) coefficients ā of the constraint nodes but the first
    b_nodes: np.ndarray  # b_nodes, c_nodes (r + 1,): weights and times of all constraint nodes
    c_nodes: np.ndarray

    @property
    def a_momenta(self) -> np.ndarray:
        """Coefficients â (s, s) of the forces."""
        return self.b * (1.0 - self.a.T / self.b[:, None])

    @property
    def a_reactions(self) -> np.ndarray:
        """Coefficients ã (s, r) of the reactions at all nodes but the last, which acts on the end alone."""
        nodes = np.concatenate([np.zeros((1, self.b.size)), self.a_nodes[:-1]])
        return self.b_nodes[:-1] * (1.0 - nodes.T / self.b[:, None])


def gauss_legendre(stages: int) -> SymplecticTableau:
    """Gauss–Legendre collocation with constraints at Lobatto nodes, order 2 s."""
    x, w = np.polynomial.legendre.leggauss(stages)
    c, b = (x + 1.0) / 2.0, w / 2.0
    ends = np.polynomial.legendre.Legendre.basis(stages).deriv().roots()
    nodes = np.concatenate([[0.0], (ends.real + 1.0) / 2.0, [1.0]])
    return SymplecticTableau(_integrals(c, c), b, c, _integrals(c, nodes[1:]), _integrals(nodes, np.ones(1))[0], nodes)


def _integrals(c: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Integrals (len(ends), len(c)) from 0 to each end of the polynomials that are 1 at one node and 0 at the others."""
    found = np.empty((ends.size, c.size))
    for j in range(c.size):
        others = np.delete(c, j)
        polynomial = np.polynomial.Polynomial.fromroots(others) if others.size else np.polynomial.Polynomial([1.0])
        found[:, j] = (polynomial / polynomial(c[j])).integ()(ends)
    return found


RATTLE = SymplecticTableau(
    np.array([[0.0, 0.0], [0.5, 0.5]]),
    np.array([0.5, 0.5]),
    np.array([0.0, 1.0]),
    np.array([[0.5, 0.5]]),
    np.array([0.5, 0.5]),
    np.array([0.0, 1.0]),
)
