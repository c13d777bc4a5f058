"""The active set of an answer: which inequality rows of G (a, q̈) ≤ h hold as equalities.

The active set of an answer is a guess. The corrected answer must satisfy the inactive rows and have non-negative multipliers
on the active ones; rows are exchanged until it does (Nocedal and Wright, Numerical Optimization, 2006, ch. 16.5).
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.factorisation import factored
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.solution import Answer
from gauss.errors import BackendError

MOST_EXCHANGES = 10  # of active rows, before the search is given up
ACTIVE_MULTIPLIER = 1e-9  # relative to the largest force: multiplier above which an answer holds a row as an equality
ROUNDED_VIOLATION = (
    1e-11  # of a row, or size of a negative multiplier, that is round-off; relative to the largest acceleration or force
)


def active_set(
    compulsion: Compulsion, answer: Answer, factor: KKTFactor | None = None
) -> tuple[KKTFactor, Answer, Correction]:
    """Factorisation with the active rows, the answer without its undetermined multipliers, and its correction.

    BackendError if the exchange of rows does not end.
    """
    G, h, sizes = compulsion.G, compulsion.h, compulsion.row_scales
    factor = factor or factored(compulsion, active_rows(compulsion, answer))
    force = ROUNDED_VIOLATION * largest_force(compulsion)
    for _ in range(MOST_EXCHANGES):
        unique = factor.without_free(answer)
        correction = factor.correction(compulsion, unique)
        if not h.size:
            return factor, unique, correction
        a, qdd = unique.a - correction[0], unique.qdd - correction[1]
        push = answer.inequality_multipliers[factor.active] - correction[3]
        held = set(factor.active[sizes[factor.active] * push >= -force])
        fast = compulsion.acceleration_scale(a, qdd)
        held |= set(np.flatnonzero(G @ np.concatenate([a, qdd]) - h > ROUNDED_VIOLATION * fast * sizes))
        if held == set(factor.active):
            return factor, unique, correction
        factor = factored(compulsion, sorted(held))
    raise BackendError("the active set of the inequality rows is not found.")


def active_rows(compulsion: Compulsion, answer: Answer) -> np.ndarray:
    """Indices of the inequality rows that the answer holds as equalities."""
    if not compulsion.h.size:
        return np.zeros(0, dtype=int)
    force = compulsion.row_scales * answer.inequality_multipliers
    return np.flatnonzero(force > ACTIVE_MULTIPLIER * largest_force(compulsion))


def has_negative_multiplier(compulsion: Compulsion, answer: Answer) -> bool:
    """Whether the multiplier of an inequality row is below zero by more than round-off."""
    if not compulsion.h.size:
        return False
    force = compulsion.row_scales * answer.inequality_multipliers
    return bool((force < -ROUNDED_VIOLATION * largest_force(compulsion)).any())


def largest_force(compulsion: Compulsion) -> float:
    """Largest work [J] of an impressed or drive force along one of the units."""
    return compulsion.work(compulsion.impressed, compulsion.P)
