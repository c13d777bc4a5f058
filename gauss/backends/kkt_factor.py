"""A factorisation of the KKT system, and the error of an answer by it: from residuals, and beyond them.

    Φ a + Aᵀ λ + G_aᵀ μ = r1,   A a + B q̈ = r2,   Bᵀ λ + G_qᵀ μ = r3,   G (a, q̈) = r4 (active rows)

Solved for the residuals of an answer it gives the correction, whose size is the error of the answer (iterative refinement;
Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 12); solved for random residuals of the size of their own
round-off it bounds what they may hide.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from functools import lru_cache

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.estimate import acceleration_errors
from gauss.backends.solution import Answer

Correction = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # what is subtracted from (a, q̈, λ, μ of active rows)
EPSILON = float(np.finfo(float).eps)
RANDOM_ROUNDINGS = 8  # number of random residuals of the size of round-off
KEPT_SIZES = 32  # sizes of problems whose random roundings are kept
MOST_REFINEMENTS = 30  # steps
REFINED_ERROR = 1e-14  # relative error of accelerations at which refinement has reached round-off
ROUNDING_MARGIN = 4.0  # times the root mean square of their effects: a bound of the effect of one rounding


@lru_cache(maxsize=KEPT_SIZES)
def _noise(size: int) -> np.ndarray:
    """Random roundings (size, :data:`RANDOM_ROUNDINGS`) of numbers of size 1, the same each time; read-only."""
    noise = EPSILON * np.random.default_rng(0).uniform(-1.0, 1.0, (size, RANDOM_ROUNDINGS))
    noise.flags.writeable = False
    return noise


class KKTFactor(ABC):
    """Factorisation of the KKT system of a compulsion.

    Attributes
    ----------
    compulsion : Compulsion
        What was factored.
    active : ndarray of int
        Indices of the inequality rows that hold as equalities.
    """

    compulsion: Compulsion
    active: np.ndarray

    @abstractmethod
    def solve_columns(self, r1, r2, r3, r4) -> Correction:
        """Solve for (a, q̈, λ, μ), many right-hand sides at once: one in each column."""

    @abstractmethod
    def free_multipliers(self) -> np.ndarray:
        """Basis (r, k) of the null space of [A B]ᵀ: reactions that redundant rows leave undetermined."""

    @abstractmethod
    def free_part(self, multipliers, mu) -> tuple[np.ndarray, np.ndarray]:
        """Projection of λ (r,), and of the μ of active rows, on this null space."""

    def solve(self, r1, r2, r3, r4=None) -> Correction:
        """Solve for (a, q̈, λ, μ) with one right-hand side; the letters are those at the head of this file."""
        r4 = np.zeros(self.active.size) if r4 is None else r4
        a, qdd, multipliers, mu = self.solve_columns(*(r[:, None] for r in (r1, r2, r3, r4)))
        return a[:, 0], qdd[:, 0], multipliers[:, 0], mu[:, 0]

    def refined(self) -> tuple[Answer, Correction]:
        """Solution of the equality rows, and its last correction.

        Refinement goes on until the correction is at round-off or no longer halves. One step does unless masses differ by
        nine orders or more: there the factorisation itself has lost digits, and each step brings some of them back.
        """
        compulsion = self.compulsion
        shifted = compulsion.about_free()
        a, qdd, multipliers, _ = self.solve(shifted.impressed, shifted.D, shifted.P)
        deviation = Answer(a, qdd, multipliers, np.zeros(0))
        correction, size = self.correction(shifted, deviation), np.inf
        for step in range(MOST_REFINEMENTS):
            deviation = self.less(deviation, correction)
            correction = self.correction(shifted, deviation)
            answer = replace(deviation, a=compulsion.a_free + deviation.a, iterations=step + 1)
            last, size = size, acceleration_errors(compulsion, answer, correction).max()
            if size <= REFINED_ERROR or size > last / 2:
                break
        return answer, correction

    def without_free(self, answer: Answer) -> Answer:
        """Answer without the part of its multipliers that redundant rows leave undetermined, which may be of any size.

        Near a singular configuration, where a row counts as redundant, the little that it still moved is taken off, too.
        """
        multipliers, mu = self.free_part(answer.multipliers, answer.inequality_multipliers[self.active])
        held = answer.inequality_multipliers.copy()
        held[self.active] -= mu
        return replace(answer, multipliers=answer.multipliers - multipliers, inequality_multipliers=held)

    def correction(self, compulsion: Compulsion, answer: Answer) -> Correction:
        """Solution for the residuals of an answer, to be subtracted from it: its size is the error of the answer.

        Multipliers of inactive inequality rows count as zero. ``compulsion`` is the one that was factored, or the same about
        its free motion.
        """
        r1, r2, r3 = compulsion.residuals(answer.a, answer.qdd, answer.multipliers)
        if not self.active.size:
            return self.solve(r1, r2, r3)
        G, h = compulsion.G[self.active], compulsion.h[self.active]
        force = G.T @ answer.inequality_multipliers[self.active]
        r4 = G @ np.concatenate([answer.a, answer.qdd]) - h
        return self.solve(r1 + force[: r1.size], r2, r3 + force[r1.size :], r4)

    def less(self, answer: Answer, correction: Correction) -> Answer:
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

    def rounding(self, answer: Answer) -> Correction:
        """Bound of the error of every number of an answer that the round-off of its residuals hides.

        It is the root mean square of the effects of random residuals, with a margin. Near a singular configuration it is
        much larger than round-off.
        """
        compulsion = self.compulsion
        r1, r2, r3 = compulsion.magnitudes(answer.a, answer.qdd, answer.multipliers)
        G, h = compulsion.G[self.active], compulsion.h[self.active]
        r4 = np.abs(G) @ np.abs(np.concatenate([answer.a, answer.qdd])) + np.abs(h)
        sizes = np.cumsum([r1.size, r2.size, r3.size])
        parts = zip((r1, r2, r3, r4), np.split(_noise(int(sizes[-1]) + r4.size), sizes), strict=True)
        changes = self.solve_columns(*(size[:, None] * share for size, share in parts))
        a, qdd, multipliers, mu = (ROUNDING_MARGIN * np.sqrt((change**2).mean(axis=1)) for change in changes)
        return a, qdd, multipliers, mu
