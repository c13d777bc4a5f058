"""What any factorisation of the KKT system does with an answer: says what is wrong with it, and what rounding may hide."""

from abc import ABC, abstractmethod
from dataclasses import replace

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Answer

UNIT = float(np.finfo(float).eps)
PROBES = 8  # random roundings that are tried
CAUTION = 4.0  # times their root mean square: what the rounding of one residual does lies below


class Refining(ABC):
    """Factorisation of the KKT system of a compulsion.

    Attributes
    ----------
    compulsion : Compulsion
        What was factored.
    active : ndarray of int
        Inequality rows that are held as equalities.
    """

    compulsion: Compulsion
    active: np.ndarray

    @abstractmethod
    def solve_columns(self, r1, r2, r3, r4):
        """Solve for (a, q̈, λ, μ), many right-hand sides at once: one each column."""

    @abstractmethod
    def free_multipliers(self) -> np.ndarray:
        """Basis (r, k) of multipliers that move nothing: reactions that redundant rows leave open."""

    @abstractmethod
    def free_part(self, multipliers, mu):
        """Part of λ (r,), and of the μ of active rows, that lies in this basis."""

    def solve(self, r1, r2, r3, r4=None):
        """Solve for (a, q̈, λ, μ): Φ a + Aᵀλ + Gᵀμ = r1, A a + B q̈ = r2, Bᵀλ + Gᵀμ = r3, G (a, q̈) = r4 (active rows)."""
        r4 = np.zeros(self.active.size) if r4 is None else r4
        return tuple(part[:, 0] for part in self.solve_columns(*(r[:, None] for r in (r1, r2, r3, r4))))

    def without_free(self, answer: Answer) -> Answer:
        """Answer without what redundant rows leave open in its multipliers, which may be as large as a backend likes.

        Where a row has nearly faded, and counts as redundant, this also takes away what it may still have moved.
        """
        multipliers, mu = self.free_part(answer.multipliers, answer.inequality_multipliers[self.active])
        held = answer.inequality_multipliers.copy()
        held[self.active] -= mu
        return replace(answer, multipliers=answer.multipliers - multipliers, inequality_multipliers=held)

    def correction(self, compulsion: Compulsion, answer: Answer):
        """Solve for the residuals of an answer: what must be subtracted from it, and its size is its error.

        Inequality rows that are not active have no multiplier, whatever the answer says.
        ``compulsion`` is the one that was factored, or the same about its free motion.
        """
        r1, r2, r3 = compulsion.residuals(answer.a, answer.qdd, answer.multipliers)
        if not self.active.size:
            return self.solve(r1, r2, r3)
        G, h = compulsion.G[self.active], compulsion.h[self.active]
        pull = G.T @ answer.inequality_multipliers[self.active]
        gap = G @ np.concatenate([answer.a, answer.qdd]) - h
        return self.solve(r1 + pull[: r1.size], r2, r3 + pull[r1.size :], gap)

    def less(self, answer: Answer, correction) -> Answer:
        """Answer less a correction."""
        a, qdd, multipliers, dmu = correction
        mu = np.zeros_like(answer.inequality_multipliers)
        mu[self.active] = answer.inequality_multipliers[self.active] - dmu
        return replace(
            answer,
            a=answer.a - a,
            qdd=answer.qdd - qdd,
            multipliers=answer.multipliers - multipliers,
            inequality_multipliers=mu,
        )

    def rounding(self, answer: Answer):
        """Change of the answer that residuals do not show: what their own rounding does, each number of it.

        Root mean square of what some random roundings do, with caution. Near a configuration where rows lose rank it
        is much larger than rounding.
        """
        compulsion = self.compulsion
        r1, r2, r3 = compulsion.magnitudes(answer.a, answer.qdd, answer.multipliers)
        G, h = compulsion.G[self.active], compulsion.h[self.active]
        r4 = np.abs(G) @ np.abs(np.concatenate([answer.a, answer.qdd])) + np.abs(h)
        sizes = np.cumsum([r1.size, r2.size, r3.size])
        noise = UNIT * np.random.default_rng(0).uniform(-1.0, 1.0, (sizes[-1] + r4.size, PROBES))
        parts = zip((r1, r2, r3, r4), np.split(noise, sizes), strict=True)
        changes = self.solve_columns(*(size[:, None] * share for size, share in parts))
        return tuple(CAUTION * np.sqrt((change**2).mean(axis=1)) for change in changes)
