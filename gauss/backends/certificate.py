"""Every answer is checked before it is believed: by its residuals, and one refinement step with the recursion as factor.

The residuals are those of the problem as it is assembled, whoever answered. The factorisation is made anew for the answers
of all backends but the recursion itself: its answers are refined with their own factor, and the last correction of the
refinement is the one that is judged, for another factorisation would take longer than the answer did. A factor that is
wrong is found by the second step, unless it is wrong in just the directions that it does not see; only a backend of another
kind, or :mod:`gauss.analysis.crosscheck`, would find that.

The same step corrects the multipliers, and these are returned: a backend need not give any. They are judged for themselves,
constraint by constraint: near a singular configuration reactions may lack the digits that all accelerations have.

The size of the step is the error of the answer (measured over a dozen backends: ratio to the true error 1.000 ± 0.0004), as
far as residuals show it. Added are the size of a second step, by which the factorisation itself is off, and what rounding of
the residuals may hide, found by steps for random residuals of that size: the sum is to bound the true error, which thousands
of random problems put to the test (``gauss bench fuzz``). All are judged body by body: residuals of rows, and norms over all
bodies, hide wrong answers of light bodies.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from gauss.backends.closure import outside
from gauss.backends.compulsion import Compulsion
from gauss.backends.dual_certificate import DualCertificate
from gauss.backends.estimate import HELD, SUSPICIOUS, acceleration_errors, pulled
from gauss.backends.recursion import Factor
from gauss.backends.refining import UNIT, Refining
from gauss.backends.solution import Answer, Certificate, Solution, Status
from gauss.backends.sparse_factor import SparseFactor
from gauss.backends.svd import FullFactor
from gauss.errors import BackendError

MANY = 150  # rows outside the tree from which on their dense factorisation takes longer than a sparse one of all rows
TOLERANCE = 1e-6  # relative error above which an answer is not called solved
OFF_CONSTRAINTS = 10.0  # times √gap: by so much may redundant rows contradict each other in a state that is off by the gap
OPEN = 1e-9  # share of the largest entry above which redundant rows leave a multiplier open
EXCHANGES = 10  # of rows that are held, before they count as unsettled
MET = 1e-11  # relative to the largest acceleration or force: by so much a row may be violated, or pull, by rounding
SUMMED = 1e-12  # relative: norms and sums of errors are rounded, too
SWAMPED = 1e3  # times the largest of those that are right: multipliers that large cost as many digits, and are left out
ACTIVE = 1e-9  # an inequality row is held when its multiplier exceeds this share of the largest force


def certify(compulsion: Compulsion, answer: Answer, factor: Refining | None = None, correction=None) -> Certificate:
    """Certificate of an answer.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.
    answer : Answer
        What a backend says.
    factor : Refining, optional
        Factorisation at hand; made anew when not given.
    correction : tuple, optional
        What this factorisation says must be subtracted from the answer, if that is known already.
    """
    numbers = np.concatenate([answer.a, answer.qdd, answer.multipliers, answer.inequality_multipliers])
    if not np.isfinite(numbers).all():
        unknown = np.full(compulsion.structure.n_bodies, np.nan)
        given, all_rows = (answer.multipliers, answer.inequality_multipliers), np.arange(compulsion.h.size)
        dual = DualCertificate(compulsion, *given, given, all_rows, (tuple(np.nan * part for part in given),))
        return Certificate(np.nan, unknown, "", np.nan, "", np.nan, dual)
    complementarity, given, its_own = _complementarity(compulsion, answer), answer, correction is not None
    own = given.multipliers, given.inequality_multipliers
    if not its_own:
        factor, answer, correction = settled(compulsion, answer, factor)
        own = answer.multipliers, answer.inequality_multipliers
        if _swamps(answer, factor.less(answer, correction)):
            given = replace(given, multipliers=0.0 * own[0], inequality_multipliers=0.0 * own[1])
            factor, answer, correction = settled(compulsion, given, factor)
    basis = factor.free_multipliers()
    refined = factor.less(answer, correction)
    if _pulls(compulsion, refined):  # of the forces that redundant rows allow, those of least norm; the given ones do not
        answer, refined = given, factor.less(given, correction)
    again = factor.correction(compulsion, refined)  # the factorisation is not exact, either
    again = tuple(2.0 * part for part in again)  # steps that halve each time add up to as much
    parts = correction, again, factor.rounding(answer)
    judged = replace(refined, a=answer.a, qdd=answer.qdd)  # wrong multipliers must not make accelerations look small
    errors = UNIT + (1.0 + SUMMED) * sum(acceleration_errors(compulsion, judged, part) for part in parts)
    n = compulsion.structure.n_bodies
    names = [*compulsion.structure.bodies, *compulsion.structure.coordinates]
    worst = int(np.argmax(errors))
    residual, worst_row = _row_residual(compulsion, judged, *correction[:2])
    loose, constraints = _loose(basis), compulsion.structure.constraints
    return Certificate(
        float(errors[worst]),
        errors[:n],
        names[worst],
        residual,
        worst_row,
        complementarity,
        _dual(factor, own, answer if its_own else judged, parts if its_own else parts[1:]),
        tuple(c.name for c in constraints if loose[c.rows].any()),
        loose,
    )


def _dual(factor: Refining, own, returned: Answer, parts) -> DualCertificate:
    """Certificate of the multipliers that are returned, with the parts of their error and those that the backend gave.

    Answers that were refined with this factor keep their own: to take off the last correction would change their rounding.
    """
    mu = np.maximum(returned.inequality_multipliers, 0.0)  # what pulls does so by rounding
    return DualCertificate(factor.compulsion, returned.multipliers, mu, own, factor.active, tuple(p[2:] for p in parts))


def settled(compulsion: Compulsion, answer: Answer, factor: Refining | None = None):
    """Factorisation with the inequality rows that hold, the answer without its free multipliers, and the correction.

    What an answer holds is a guess. Less its correction it must meet the other rows, too, and push where it holds: only
    then is that the solution, and the correction the error. Rows that would have to pull are let go, and rows that are
    violated are held, until that is so.

    Raises
    ------
    BackendError
        If it is never so.
    """
    G, h, sizes = compulsion.G, compulsion.h, compulsion.relation_scales
    factor = factor or factored(compulsion, active_rows(compulsion, answer))
    force = MET * _largest_force(compulsion)
    for _ in range(EXCHANGES):
        bare = factor.without_free(answer)
        correction = factor.correction(compulsion, bare)
        if not h.size:
            return factor, bare, correction
        a, qdd = bare.a - correction[0], bare.qdd - correction[1]
        push = answer.inequality_multipliers[factor.active] - correction[3]
        held = set(factor.active[sizes[factor.active] * push >= -force])
        fast = compulsion.acceleration_scale(a, qdd)
        held |= set(np.flatnonzero(G @ np.concatenate([a, qdd]) - h > MET * fast * sizes))
        if held == set(factor.active):
            return factor, bare, correction
        factor = factored(compulsion, sorted(held))
    raise BackendError("which of the one-sided rows hold is not settled.")


def factored(compulsion: Compulsion, active=()) -> Refining:
    """Factorisation of a compulsion made for its certificate: the recursion, or the whole matrix where the tree does not do.

    Raises
    ------
    BackendError
        If some acceleration is undetermined.
    """
    for factor in factors(compulsion):
        with suppress(BackendError):
            return factor(compulsion, active)
    return FullFactor(compulsion, active)


def factors(compulsion: Compulsion) -> tuple[type[Refining], ...]:
    """Factorisations by the tree, the one to be tried first in front: many loops are met by sparse matrices."""
    n_outside = outside(compulsion.structure)[0].size
    return (SparseFactor, Factor) if n_outside > MANY else (Factor,)


def judge(answer: Answer, certificate: Certificate, tolerance: float, row_tolerance: float) -> Status:
    """Return the status that the certificate allows, whatever the backend claims."""
    if np.isnan(certificate.error):
        claims = "the backend claims success, but its numbers are not finite"
        reason = claims if answer.found else answer.message or "the backend has no answer, and gives no reason"
    elif certificate.error > tolerance:
        reason = f"estimated relative error {certificate.error:.1e} of {certificate.worst!r} exceeds {tolerance:.0e}"
        reason += "" if answer.found else f" ({answer.message})"
    elif not certificate.row_residual <= row_tolerance:
        reason = (
            f"rows contradict each other: {certificate.worst_row!r} is violated by {certificate.row_residual:.1e} relative"
        )
    elif not certificate.complementarity <= tolerance:  # overflow of huge numbers leaves what compares to nothing
        reason = f"inequality rows violated or multipliers inconsistent by {certificate.complementarity:.1e} relative"
    else:
        reason = ""
    return Status(not reason, reason, answer.found, answer.message, dual=certificate.dual, tolerance=tolerance)


def conclude(compulsion: Compulsion, answer: Answer, certificate: Certificate, backend: str, tolerance: float) -> Solution:
    """Solution of an answer and its certificate: its accelerations, and its multipliers less their error."""
    status = judge(answer, certificate, tolerance, max(tolerance, OFF_CONSTRAINTS * np.sqrt(compulsion.gap)))
    fields = (answer.a, answer.qdd, certificate.dual.multipliers, certificate.dual.inequality_multipliers)
    return Solution(*fields, status, certificate, backend, answer.iterations, compulsion)


def active_rows(compulsion: Compulsion, answer: Answer) -> np.ndarray:
    """Inequality rows that the answer holds as equalities."""
    if not compulsion.h.size:
        return np.zeros(0, dtype=int)
    force = compulsion.relation_scales * answer.inequality_multipliers
    return np.flatnonzero(force > ACTIVE * _largest_force(compulsion))


def _swamps(answer: Answer, refined: Answer) -> bool:
    """Whether multipliers of an answer are so much too large that what is right of them has no digits."""
    sizes = (
        max(np.abs(found.multipliers).max(initial=0.0), np.abs(found.inequality_multipliers).max(initial=0.0))
        for found in (answer, refined)
    )
    given, right = sizes
    return bool(given > SWAMPED * right)


def _pulls(compulsion: Compulsion, answer: Answer) -> bool:
    """Whether an inequality row of an answer has a multiplier below zero by more than rounding."""
    if not compulsion.h.size:
        return False
    force = compulsion.relation_scales * answer.inequality_multipliers
    return bool((force < -MET * _largest_force(compulsion)).any())


def _largest_force(compulsion: Compulsion) -> float:
    return compulsion.work(compulsion.impressed, compulsion.P)


def _row_residual(compulsion: Compulsion, answer: Answer, da, dqdd):
    refined = replace(answer, a=answer.a - da, qdd=answer.qdd - dqdd)
    _, r2, _ = compulsion.residuals(refined.a, refined.qdd, refined.multipliers)
    worst, name = 0.0, ""
    scale = max(np.abs(refined.a).max(), np.abs(compulsion.a_free).max(), np.abs(compulsion.D).max(initial=0.0))
    for constraint in compulsion.structure.constraints:
        size = np.abs(r2[constraint.rows]).max() / scale if scale else 0.0
        if size > worst:
            worst, name = float(size), constraint.name
    if worst > SUSPICIOUS:  # all at rest, held by forces: their size is what rounding is measured by
        worst *= scale / max(scale, HELD * pulled(compulsion, answer).max(initial=0.0))
    return worst, name


def _complementarity(compulsion: Compulsion, answer: Answer) -> float:
    if not compulsion.h.size:
        return 0.0
    slack = compulsion.h - compulsion.G @ np.concatenate([answer.a, answer.qdd])
    slack, mu = slack / compulsion.relation_scales, answer.inequality_multipliers * compulsion.relation_scales
    acceleration = compulsion.acceleration_scale(answer.a)
    force = max(compulsion.work(compulsion.impressed), np.abs(mu).max())
    acceleration, force = (size or 1.0 for size in (acceleration, force))
    violations = (np.maximum(-slack, 0) / acceleration, np.maximum(-mu, 0) / force)
    both = np.minimum(np.abs(slack) / acceleration, np.abs(mu) / force)
    return float(max(v.max() for v in (*violations, both)))


def _loose(basis: np.ndarray) -> np.ndarray:
    """Which multipliers (r,) redundant rows leave open; empty when all are unique."""
    if not basis.shape[1]:
        return np.zeros(0, dtype=bool)
    sizes = np.linalg.norm(basis / np.linalg.norm(basis, axis=0), axis=1)
    return sizes > OPEN * sizes.max()
