"""Compliance of a mechanism: accelerations H τ by generalised forces τ that its couplings and loops allow.

    H = M⁻¹ (1 − Gᵀ (G M⁻¹ Gᵀ)⁺ G M⁻¹),   or H = N (Nᵀ M N)⁻¹ Nᵀ with independent rates, v = N ẏ

Rows of loops G may be redundant, hence the pseudo-inverse. Coordinates with constant sums alone are made independent.
"""

from copy import copy
from typing import cast

import numpy as np

from gauss.dynamics.contact.mechanism_kernels import MechanismTerms, is_coupled_tree
from gauss.scene import LinearCoupling
from gauss.system import System

REDUNDANT_LOOPS = 1e-10  # eigenvalue of the scaled G M⁻¹ Gᵀ, relative to the largest one: smaller ones are redundant rows
REPEATED_COUPLING = 1e-12  # of the sum of coefficients: what other couplings leave of one that they imply


class Compliance:
    """Compliance of one system.

    Parameters
    ----------
    smooth : System
        The system without unilateral and set-valued elements.

    Attributes
    ----------
    free_columns : ndarray, shape (n_v, k), or None
        Rates N of independent coordinates; None with loops.
    """

    def __init__(self, smooth: System):
        self.free_columns = _null_space(smooth) if is_coupled_tree(smooth) else None
        self.still = np.zeros(smooth.n_v, dtype=bool)  # rates of bodies asleep

    def without(self, rates: np.ndarray) -> "Compliance":
        """The compliance while some rates (n_v,) stay zero; no constraint couples them with others."""
        made = copy(self)
        made.still = rates
        if self.free_columns is not None:
            made.free_columns = self.free_columns[:, ~self.free_columns[rates].any(axis=0)]
        return made

    def of(self, terms: MechanismTerms) -> tuple[np.ndarray, np.ndarray]:
        """Compliance H (n_v, n_v), and accelerations (n_v,) by the biases of loops."""
        H, offset = self._of_all(terms)
        H[self.still], H[:, self.still], offset[self.still] = 0.0, 0.0, 0.0
        return H, offset

    def _of_all(self, terms: MechanismTerms) -> tuple[np.ndarray, np.ndarray]:
        M = terms.M
        if self.free_columns is not None:
            N = self.free_columns
            return N @ np.linalg.inv(N.T @ M @ N) @ N.T, np.zeros(len(M))
        tree = M.diagonal() > 0.0
        H = np.zeros_like(M)
        if not tree.any():  # nothing in the tree moves, and so no joint that closes a loop
            return terms.B @ H @ terms.B.T, terms.beta
        H[np.ix_(tree, tree)] = np.linalg.inv(M[np.ix_(tree, tree)])
        Y = H @ terms.G.T
        S = terms.G @ Y
        sizes = S.diagonal()
        scale = 1.0 / np.sqrt(np.maximum(sizes, REDUNDANT_LOOPS * sizes.max()))
        P = scale[:, None] * np.linalg.pinv(scale[:, None] * S * scale, rcond=REDUNDANT_LOOPS, hermitian=True) * scale
        return terms.B @ (H - Y @ P @ Y.T) @ terms.B.T, terms.B @ (Y @ (P @ terms.gamma)) + terms.beta


def _null_space(system: System) -> np.ndarray:
    """Rates (n_v, k) of independent coordinates: v = N ẏ for the couplings of a tree."""
    ratios, dependent = np.eye(system.n_v), set[int]()
    for terms in _sums(system):
        columns, factors = [system.column(joint) for joint in terms], np.array([*terms.values()])
        row = factors @ ratios[columns]
        if np.abs(row).max() <= REPEATED_COUPLING * np.abs(factors).sum():
            continue
        pivot = int(np.argmax(np.abs(row) * (np.arange(row.size) == columns[0]) * 2.0 + np.abs(row)))
        ratios = ratios - np.outer(ratios[:, pivot], row) / row[pivot]
        dependent.add(pivot)
    return ratios[:, [k for k in range(system.n_v) if k not in dependent]]


def _sums(system: System) -> list[dict[str, float]]:
    """Sums of rates that are zero, coefficients by joint."""
    couplings = [{one.driven: 1.0, one.driver: -one.ratio} for one in system.scene.couplings.values()]
    relations = [cast(LinearCoupling, relation) for relation in system.scene.relations.values()]
    return couplings + [dict(zip(one.coupled, one.coefficients, strict=True)) for one in relations]
