"""References of quadratic programmes: the active set, confirmed, and its equations solved to some thirty digits.

A guess gives the active rows. With these rows as equations the answer is that of one linear system, refined with
residuals of twice the precision, so that the double factorisation only steers (Wilkinson 1963; Gleixner, Steffy, Wolter
2016). Then all conditions are checked in twice the precision: rows with multipliers of the wrong sign leave, violated rows
enter, until the active set is confirmed (Hintermüller, Ito, Kunisch 2002).
"""

from typing import NamedTuple

import numpy as np
from scipy import linalg, optimize, sparse
from scipy.sparse.linalg import splu

from gauss.bench.suite.doubled import Doubled, product, taken, zeros
from gauss.bench.suite.guess import guessed
from gauss.bench.suite.instance import SuiteInstance, SuiteReference
from gauss.bench.suite.optimality import LEAST_SIZE, largest_multiplier, residuals, sizes
from gauss.errors import BackendError

ACTIVE = 1e-7  # relative: slack of the guess below which a row may be active, multiplier of it below which it may not
STRICT = 1e-24  # relative: largest violation of a row, and multiplier of the wrong sign, where the rows are independent
ROUNDED = 1e-13  # the same, where rows are dependent to the round-off of their entries
DEPENDENT = 1e-11  # relative pivot of rows that are dependent to round-off; the next ones are at 1e-7
LITTLE = 1e-14  # of entries near one: less than dependent
CHANGES, STEPS = 40, 60
CONVERGED, STAGNATED = 1e-31, 1e-20  # last correction, relative: target, and limit where the refinement stagnates


class Held(NamedTuple):
    """Answer x (n,) with rows held: multipliers of the equality rows (m,) and of the plain rows, digits, and the rows."""

    x: Doubled
    y: Doubled
    plain: Doubled
    digits: float
    rows: np.ndarray


def refined(instance: SuiteInstance) -> SuiteReference:
    """Solution of a quadratic programme without cones.

    BackendError if no active set is confirmed, or refinement does not converge.
    """
    rows, right = instance.plain_rows()
    x, _, plain, _ = guessed(instance) if right.size else (np.zeros(instance.n), None, np.zeros(0), None)
    share = np.abs(right - rows @ x) / np.maximum(abs(rows) @ sizes(instance, x) + np.abs(right), LEAST_SIZE)
    push = plain / largest_multiplier(instance, plain, abs(instance.P) @ np.abs(x) + np.abs(instance.q))
    equal, nothing = np.arange(instance.b.size), np.zeros(0, dtype=int)
    if not _is_regular(instance, equal, nothing):
        equal = _first_independent(instance.A.toarray(), 0)
    pushed = np.flatnonzero(push > share)
    if not _is_regular(instance, equal, pushed):
        pushed = _pushing(instance, equal, rows, np.flatnonzero((share <= ACTIVE) | (push > ACTIVE)), x)
    return _reference(instance, _confirmed(instance, equal, pushed), equal)


def _confirmed(instance: SuiteInstance, equal: np.ndarray, active: np.ndarray) -> Held:
    """Answer that violates no row, with multipliers of the right sign on the active ones."""
    rows, right = instance.plain_rows()
    best, least = None, float("inf")
    for changes in range(CHANGES):
        held = hold(instance, equal, active)
        reach = abs(rows) @ sizes(instance, held.x.hi) + np.abs(right)
        crossing = -(right - product(rows, held.x)).rounded() / np.maximum(reach, LEAST_SIZE)
        crossing[active] = 0.0
        pull = -held.plain.rounded() / max(np.abs(held.plain.hi).max(initial=0.0), LEAST_SIZE)
        worst = max(pull.max(initial=0.0), crossing.max(initial=0.0))
        if worst <= STRICT:
            return held
        if worst < least:
            best, least = held, worst
        least_taken = (
            worst / 2 if changes >= CHANGES // 2 else STRICT
        )  # all of them at first, then the worst: that ends cycles
        entering, leaving = (np.flatnonzero(off > max(least_taken, STRICT)) for off in (crossing, pull))
        active = np.setdiff1d(np.union1d(active, entering), leaving)
        if not _is_regular(instance, equal, active):
            active = _kept(instance, equal, rows, active)
    if best is not None and least <= ROUNDED:
        return best
    raise BackendError(f"{instance.name}: no active set is confirmed; the best one is off by {least:.1e}.")


def hold(instance: SuiteInstance, equal: np.ndarray, active: np.ndarray) -> Held:
    """Answer with the equality rows ``equal`` and the plain rows ``active`` as equations.

    BackendError if refinement does not converge.
    """
    right = instance.plain_rows()[1]
    K = _equations(instance, equal, active)
    target = np.concatenate([-instance.q, instance.b[equal], right[active]])
    unknown, last = solve_wide(K, target, instance.name)
    n, m = instance.n, equal.size
    y, plain = zeros(instance.b.size), zeros(right.size)
    y.hi[equal], y.lo[equal] = unknown.hi[n : n + m], unknown.lo[n : n + m]
    plain.hi[active], plain.lo[active] = unknown.hi[n + m :], unknown.lo[n + m :]
    return Held(taken(unknown, slice(n)), y, plain, -np.log10(last), active)


def solve_wide(K, target: np.ndarray, name: str) -> tuple[Doubled, float]:
    """Solution of the symmetric system K u = target, and its last relative correction.

    BackendError if the system is singular to working precision.
    """
    scale = _equilibrated(K)
    D = sparse.diags_array(scale)
    try:
        factor = splu(sparse.csc_matrix(D @ K @ D))
    except RuntimeError as error:
        raise BackendError(f"{name}: the equations of the rows that hold are singular ({error}).") from error
    unknown, before = zeros(target.size), np.inf
    for _ in range(STEPS):
        rest = (target - product(K, unknown)).rounded()
        step = scale * factor.solve(scale * rest)
        unknown = unknown + step
        size = np.abs(unknown.hi / scale).max(initial=0.0)
        last = float(np.abs(step / scale).max(initial=0.0) / size) if size else CONVERGED
        if not np.isfinite(last):
            break
        if last <= CONVERGED or (last <= STAGNATED and last > before / 2):
            return unknown, max(last, CONVERGED)
        before = last
    raise BackendError(f"{name}: refinement stays at {last:.1e}; the rows that hold are too close to dependent.")


def _equilibrated(K) -> np.ndarray:
    """Scales (n,) that bring the largest entries of the rows and columns of a symmetric matrix near one (Ruiz 2001)."""
    scale, size = np.ones(K.shape[0]), abs(sparse.csr_array(K))
    for _ in range(8):
        largest = (sparse.diags_array(scale) @ size @ sparse.diags_array(scale)).max(axis=1).toarray().ravel()
        scale /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return 2.0 ** np.round(np.log2(scale))


def _is_regular(instance: SuiteInstance, equal: np.ndarray, active: np.ndarray) -> bool:
    """Whether rows that are held are clearly independent, by the pivots of their equations."""
    K = _equations(instance, equal, active)
    D = sparse.diags_array(_equilibrated(K))
    signs = np.where(np.arange(K.shape[0]) < instance.n, 1.0, -1.0)
    little = sparse.diags_array(LITTLE * signs)  # a factorisation that meets an exact zero stops with noise on the terminal
    try:
        pivots = np.abs(splu(sparse.csc_matrix(D @ K @ D + little)).U.diagonal())
    except RuntimeError:
        return False
    return bool(pivots.min() > DEPENDENT * pivots.max())


def _equations(instance: SuiteInstance, equal: np.ndarray, active: np.ndarray) -> sparse.csr_array:
    """Matrix of the conditions with the equality rows ``equal`` and the plain rows ``active`` held."""
    C = sparse.vstack([sparse.csr_array(instance.A)[equal], instance.plain_rows()[0][active]], format="csr")
    return sparse.csr_array(sparse.block_array([[instance.P, C.T], [C, sparse.csr_array((C.shape[0],) * 2)]]))


def _first_independent(dense: np.ndarray, kept: int) -> np.ndarray:
    """Independent rows, the first ``kept`` among them, which are independent."""
    lengths = np.linalg.norm(dense, axis=1)
    dense = dense / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    first, rest = dense[:kept], dense[kept:]
    if not rest.size:
        return np.arange(kept)
    if kept:
        Q = linalg.qr(first.T, mode="economic")[0]
        rest = rest - (rest @ Q) @ Q.T
        rest = rest - (rest @ Q) @ Q.T
    _, R, order = linalg.qr(rest.T, mode="economic", pivoting=True)
    rank = int((np.abs(R.diagonal()) > DEPENDENT).sum())
    return np.concatenate([np.arange(kept), kept + np.sort(order[:rank])])


def _kept(instance: SuiteInstance, equal, rows, active) -> np.ndarray:
    """Of active rows those that are independent of each other and of the equality rows."""
    both = np.vstack([sparse.csr_array(instance.A)[equal].toarray(), rows[active].toarray()])
    return active[_first_independent(both, equal.size)[equal.size :] - equal.size]


def _pushing(instance: SuiteInstance, equal, rows, candidates, x: np.ndarray) -> np.ndarray:
    """Independent rows, of the candidates, whose multipliers balance the gradient at x (non-negative least squares)."""
    if not candidates.size:
        return candidates
    A, R = sparse.csr_array(instance.A)[equal].toarray(), rows[candidates].toarray()
    need = -(instance.P @ x + instance.q)
    if equal.size:  # the part in their span is balanced by the equality rows
        Q = linalg.qr(A.T, mode="economic")[0]
        R, need = R - (R @ Q) @ Q.T, need - Q @ (Q.T @ need)
    lengths = np.maximum(np.linalg.norm(R, axis=1), LEAST_SIZE)
    if not np.abs(need).max(initial=0.0) or not R.any():
        return candidates[:0]
    push = optimize.nnls((R / lengths[:, None]).T, need, maxiter=30 * candidates.size)[0]
    return _kept(instance, equal, rows, candidates[push > ACTIVE * push.max(initial=0.0)])


def held_rows(instance: SuiteInstance, x: Doubled) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plain rows that hold with equality at x; those of them that are rows of G, and the variables at a bound."""
    rows, right = instance.plain_rows()
    slack = np.abs((right - product(rows, x)).rounded())
    holds = np.flatnonzero(slack <= ROUNDED * (abs(rows) @ sizes(instance, x.hi) + np.abs(right)))
    bounds = np.concatenate([np.flatnonzero(np.isfinite(instance.ub)), np.flatnonzero(np.isfinite(instance.lb))])
    return holds, holds[holds < instance.orthant], np.unique(bounds[holds[holds >= instance.orthant] - instance.orthant])


def _reference(instance: SuiteInstance, held: Held, equal: np.ndarray) -> SuiteReference:
    z, z_box = instance.multipliers(held.plain)
    found = residuals(instance, held.x, held.y, z, z_box)
    holds, active, bounds = held_rows(instance, held.x)
    contradiction = max(found.primal, found.complementarity)
    known = held.digits if contradiction <= STRICT else min(held.digits, -np.log10(contradiction))
    unique = equal.size == instance.b.size and _is_regular(instance, equal, holds)
    return SuiteReference(
        held.x,
        held.y,
        z,
        z_box,
        active,
        bounds,
        max(found),
        float(known),
        contradiction if contradiction > STRICT else 0.0,
        bool(unique),
    )
