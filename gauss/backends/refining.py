"""What any factorisation of the KKT system does with an answer: says what is wrong with it, and what rounding may hide."""

from abc import ABC, abstractmethod

import numpy as np

from gauss.compulsion import Answer, Compulsion

UNIT = float(np.finfo(float).eps)


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
    def solve(self, r1, r2, r3, r4=None):
        """Solve for (a, q̈, λ, μ): Φ a + Aᵀλ + Gᵀμ = r1, A a + B q̈ = r2, Bᵀλ + Gᵀμ = r3, G (a, q̈) = r4 (active rows)."""

    @abstractmethod
    def free_multipliers(self) -> np.ndarray:
        """Basis (r, k) of multipliers that move nothing: reactions that redundant rows leave open."""

    def correction(self, compulsion: Compulsion, answer: Answer):
        """Solve for the residuals of an answer: what must be subtracted from it, and its size is its error.

        ``compulsion`` is the one that was factored, or the same about its free motion.
        """
        r1, r2, r3 = compulsion.residuals(answer.a, answer.qdd, answer.multipliers)
        if not self.active.size:
            return self.solve(r1, r2, r3)
        pull = compulsion.G.T @ answer.inequality_multipliers
        G, h = compulsion.G[self.active], compulsion.h[self.active]
        gap = G @ np.concatenate([answer.a, answer.qdd]) - h
        return self.solve(r1 + pull[: r1.size], r2, r3 + pull[r1.size :], gap)

    def rounding(self, answer: Answer):
        """Change of the answer under residuals of the size of rounding, which no residual can show.

        Near a configuration where rows lose rank it is much larger than rounding.
        """
        compulsion = self.compulsion
        r1, r2, r3 = compulsion.magnitudes(answer.a, answer.qdd, answer.multipliers)
        G, h = compulsion.G[self.active], compulsion.h[self.active]
        r4 = np.abs(G) @ np.abs(np.concatenate([answer.a, answer.qdd])) + np.abs(h)
        sizes = np.cumsum([r1.size, r2.size, r3.size])
        noise = UNIT * np.random.default_rng(0).uniform(-1.0, 1.0, sizes[-1] + r4.size)  # equal sizes could cancel
        return self.solve(*(r * n for r, n in zip((r1, r2, r3, r4), np.split(noise, sizes), strict=True)))
