"""Null spaces of the constraints: motions that meet all rows, and multipliers that exert nothing.

The recursion brings the inertia of the tree to the form M⁻¹ = HᵀH, H_k = S_k^{-½} u_k for unit drives. In coordinates z with
q̈ = Hᵀz the kinetic energy is that of a unit mass, the rows outside the tree are Wᵀz, and its complement holds all motions.
"""

from dataclasses import dataclass

import numpy as np

from gauss.backends.closure import Factor, half_factors
from gauss.shapes import Shaped


@dataclass(frozen=True)
class Allowed:
    """Null spaces of the rows of one instant.

    Parameters
    ----------
    a : ndarray, shape (6n, f)
        Quasi-velocities of f independent motions, orthonormal in the mass metric.
    rates : ndarray, shape (p, f)
        Their joint rates.
    redundancies : ndarray, shape (r, k)
        Basis of the multipliers λ that exert nothing: Aᵀλ = 0, Bᵀλ = 0.
    """

    a: Shaped[np.ndarray, "n6 f"]
    rates: Shaped[np.ndarray, "p f"]
    redundancies: Shaped[np.ndarray, "r k"]


def allowed(factor: Factor) -> Allowed:
    """Motions that the rows of a factorised compulsion allow, and multipliers that are redundant."""
    tree, structure = factor.tree, factor.compulsion.structure
    columns = [j for places in tree.columns for j in range(places.start, places.stop)]
    drives = np.zeros((structure.n_columns, len(columns)))
    drives[columns, range(len(columns))] = 1.0
    none_a, none_r = np.zeros((6 * structure.n_bodies, len(columns))), np.zeros((structure.n_rows, len(columns)))
    H = half_factors(tree, tree.solve(none_a, none_r, drives)[3], len(columns))
    z = np.eye(H.shape[0])
    if factor.size and factor.rank:
        taken = factor.W @ (factor.rest @ (factor.scale[:, None] * factor.Z))
        z = np.linalg.qr(taken / factor.sigma, mode="complete")[0][:, factor.rank :]
    rates = np.zeros((structure.n_columns, z.shape[1]))
    rates[columns] = H.T @ z
    a = tree.carried(rates)
    if factor.size and factor.R.size:
        rates[factor.loop_columns] = -np.linalg.solve(factor.R, factor.held.T @ (factor.K_a @ a + factor.K_tree @ rates))
    return Allowed(a, rates, factor.free_multipliers())
