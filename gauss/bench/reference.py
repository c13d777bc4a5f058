"""References in extended precision: iterative refinement with residuals of 50 digits.

A double factorisation only steers; what it steers to is the solution of the compulsion whose entries are taken as exact
binary numbers (Weber, Sager, Gleixner 2019, for quadratic programmes in general). The active inequality rows are guessed by
an active-set method, and confirmed: multipliers that push, rows that are kept.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gauss.backends import make
from gauss.backends.active_set import ROUNDED_VIOLATION, active_rows
from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.backends.estimate import acceleration_errors
from gauss.backends.solution import Answer
from gauss.errors import BackendError

DIGITS = 50
CONVERGED = 1e-25  # correction relative to the answer, body by body
STAGNATED = 1e-18  # the same bound, where inconsistent redundant rows keep changing the last digits
STEPS = 60
GUESSES = ("daqp", "clarabel", "piqp")  # of the active rows, in turn until one is confirmed


@dataclass(frozen=True)
class ReferenceSolution:
    """Solution to far more digits than a double holds."""

    # a, qdd (6n,), (p,): accelerations, rounded to doubles
    a: np.ndarray
    qdd: np.ndarray
    active: np.ndarray  # independent inequality rows that hold
    last: float  # last correction, relative: what is still unknown
    # contradiction: largest residual of the rows that remains, relative: by so much redundant rows contradict each other
    contradiction: float
    # multipliers, inequality_multipliers (r,), (s,): multipliers, rounded to doubles; one choice of many where rows are
    # redundant
    multipliers: np.ndarray
    inequality_multipliers: np.ndarray

    def error(self, compulsion: Compulsion, answer: Answer) -> float:
        """Largest relative error of an answer over bodies and joints, measured as a certificate estimates it."""
        if not (np.isfinite(answer.a).all() and np.isfinite(answer.qdd).all()):
            return np.nan
        difference = answer.a - self.a, answer.qdd - self.qdd
        return float(acceleration_errors(compulsion, answer, difference).max())


def reference(compulsion: Compulsion) -> ReferenceSolution:
    """Solve a compulsion to 25 digits.

    BackendError if refinement does not converge, or no guess of the active rows is confirmed.
    """
    if not compulsion.h.size:
        return _refined(compulsion, np.zeros(0, dtype=int))
    reasons = []
    for guess in GUESSES:
        try:
            found = _refined(compulsion, active_rows(compulsion, make(guess)(compulsion)))
        except (BackendError, np.linalg.LinAlgError) as error:
            reasons.append(f"{guess}: {error}")
        else:
            return found
    raise BackendError(f"no reference: {'; '.join(reasons)}")


def _refined(compulsion: Compulsion, active: np.ndarray) -> ReferenceSolution:
    import mpmath  # only references need it

    with mpmath.workdps(DIGITS):
        exact = np.frompyfunc(mpmath.mpf, 1, 1)
        wide = _widened(compulsion, exact)
        factor = Factor(compulsion, active)
        sizes = compulsion.Phi.size, compulsion.P.size, compulsion.D.size, active.size
        a, qdd, multipliers, mu = (exact(np.zeros(size)) for size in sizes)
        G, h = wide.G[active], wide.h[active]
        last = np.inf
        for _ in range(STEPS):
            r1, r2, r3 = wide.residuals(a, qdd, multipliers)
            forces = G.T @ mu if active.size else exact(np.zeros(a.size + qdd.size))
            r1, r3 = r1 + forces[: a.size], r3 + forces[a.size :]
            r4 = G @ np.concatenate([a, qdd]) - h if active.size else np.zeros(0)
            step = factor.solve(*(np.array(r, dtype=float) for r in (r1, r2, r3, r4)))
            a, qdd, multipliers, mu = (old - exact(new) for old, new in zip((a, qdd, multipliers, mu), step, strict=True))
            answer = _rounded(a, qdd, multipliers, mu)
            before, last = last, float(acceleration_errors(compulsion, answer, step, suspicious=0.0).max(initial=0.0))
            if last <= CONVERGED or (last <= STAGNATED and last > before / 2):
                break
        else:
            raise BackendError(f"refinement stays at {last:.1e}; the rows are too close to dependent.")
        scale = max(np.abs(answer.a).max(), np.abs(compulsion.a_free).max(), np.abs(compulsion.D).max(initial=0.0))
        contradiction = float(np.abs(r2).max()) / scale if r2.size else 0.0
    _confirm(compulsion, answer, active)
    inequality_multipliers = np.zeros(compulsion.h.size)
    inequality_multipliers[active] = answer.inequality_multipliers
    return ReferenceSolution(answer.a, answer.qdd, active, last, contradiction, answer.multipliers, inequality_multipliers)


def _widened(compulsion: Compulsion, exact) -> Compulsion:
    """The same compulsion in wide numbers."""
    fields: dict[str, Any] = {name: exact(getattr(compulsion, name)) for name in ("Phi", "impressed", "P", "D", "G", "h")}
    fields |= {
        name: tuple(tuple(exact(block) for block in row) for row in getattr(compulsion, name))
        for name in ("A_blocks", "B_blocks")
    }
    return replace(compulsion, **fields)


def _rounded(a, qdd, multipliers, mu) -> Answer:
    a, qdd, multipliers, mu = (np.array(part, dtype=float) for part in (a, qdd, multipliers, mu))
    return Answer(a, qdd, multipliers, mu)


def _confirm(compulsion: Compulsion, answer: Answer, active: np.ndarray):
    """Raise a BackendError unless the active rows push and all others are kept."""
    if not compulsion.h.size:
        return
    excess = compulsion.G @ np.concatenate([answer.a, answer.qdd]) - compulsion.h
    acceleration = max(np.abs(answer.a).max(), np.abs(compulsion.a_free).max())
    if excess.max() > ROUNDED_VIOLATION * acceleration:
        raise BackendError(f"inequality row {int(excess.argmax())} is violated by {excess.max():.1e}.")
    force = max(np.abs(compulsion.impressed).max(), np.abs(compulsion.P).max(initial=0.0))
    if active.size and answer.inequality_multipliers.min() < -ROUNDED_VIOLATION * force:
        raise BackendError("an active inequality row would have to pull.")
