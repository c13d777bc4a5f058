"""Every answer is certified before it is believed: by its residuals, and one step of iterative refinement.

The residuals are those of the problem as it is assembled, whoever answered. The factorisation is made anew for the answers
of all backends but the recursion itself: its answers are refined with their own factorisation, and the last correction of
that refinement is the one that is judged, for another factorisation would take longer than the answer did. A wrong
factorisation is found by the second step, unless it is wrong in just the directions that it does not see; only a backend of
another kind, or :mod:`gauss.analysis.crosscheck`, would find that.

The same step corrects the multipliers, and these are returned: a backend need not give any. They are judged for themselves,
constraint by constraint: near a singular configuration reactions may have fewer correct digits than accelerations.

The size of the step is the error of the answer (measured over a dozen backends: ratio to the true error 1.000 ± 0.0004), as
far as residuals show it. Added are the size of a second step, for the error of the factorisation itself, and a bound of the
error that round-off of the residuals may hide, from steps for random residuals of that size: the sum is to bound the true
error, which thousands of random problems put to the test (``gauss bench fuzz``). Errors are judged body by body: residuals
of rows, and norms over all bodies, hide wrong answers of light bodies.
"""

from dataclasses import replace

import numpy as np

from gauss.backends.active_set import active_set, has_negative_multiplier
from gauss.backends.compulsion import Compulsion
from gauss.backends.dual_certificate import DualCertificate
from gauss.backends.estimate import SHARE_AT_REST, SUSPICIOUS_ERROR, AccelerationScale
from gauss.backends.kkt_factor import EPSILON, Correction, KKTFactor
from gauss.backends.solution import Answer, Certificate, Solution, SolveStatus

TOLERANCE = 1e-6  # relative error of accelerations above which an answer is not called solved
CONTRADICTION = 10.0  # times √residual of the state: relative contradiction of redundant rows that such a state explains
UNDETERMINED_SHARE = 1e-9  # of the largest entry of the null space, above which a multiplier is undetermined
ROUNDED_NORM = 1e-12  # relative round-off of norms and sums of errors
SWAMPING_RATIO = 1e3  # of multipliers to the right ones, above which they cost as many digits and are dropped


def certify(
    compulsion: Compulsion, answer: Answer, factor: KKTFactor | None = None, correction: Correction | None = None
) -> Certificate:
    """Certificate of an answer.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.
    answer : Answer
        Answer of a backend.
    factor : KKTFactor, optional
        Its factorisation; made anew when not given.
    correction : tuple, optional
        Correction of the answer by this factorisation, where it is known already.

    Raises
    ------
    BackendError
        If the active set of the inequality rows is not found, or some acceleration is undetermined.
    """
    if not np.isfinite(np.concatenate([answer.a, answer.qdd, *_duals(answer)])).all():
        return _unknown(compulsion, answer)
    complementarity, refined_before = _complementarity(compulsion, answer), factor is not None and correction is not None
    if factor is not None and correction is not None:
        given, own = answer, _duals(answer)
    else:
        given, own, factor, answer, correction = _with_active_set(compulsion, answer, factor)
    refined = factor.less(answer, correction)
    if has_negative_multiplier(compulsion, refined):  # those of least norm may be negative where the given ones are not
        answer, refined = given, factor.less(given, correction)
    again = factor.correction(compulsion, refined)  # the factorisation is not exact, either
    doubled = tuple(2.0 * change for change in again)  # the sum of steps that halve each time
    parts = correction, doubled, factor.rounding(answer)
    judged = replace(refined, a=answer.a, qdd=answer.qdd)  # wrong multipliers must not make accelerations look small
    scale = AccelerationScale(compulsion, judged)
    first, second, hidden = (scale.errors(part) for part in parts)
    errors = EPSILON + (1.0 + ROUNDED_NORM) * (first + second + hidden)
    structure = compulsion.structure
    worst = int(np.argmax(errors))
    residual, worst_row = _row_residual(scale, *correction[:2])
    undetermined = _undetermined(factor.free_multipliers())
    return Certificate(
        float(errors[worst]),
        errors[: structure.n_bodies],
        [*structure.bodies, *structure.coordinates][worst],
        residual,
        worst_row,
        complementarity,
        _dual(factor, own, answer if refined_before else judged, parts if refined_before else parts[1:]),
        tuple(c.name for c in structure.constraints if undetermined[c.rows].any()),
        undetermined,
    )


def _unknown(compulsion: Compulsion, answer: Answer) -> Certificate:
    """Certificate of an answer with numbers that are not finite."""
    given, all_rows = _duals(answer), np.arange(compulsion.h.size)
    dual = DualCertificate(compulsion, *given, given, all_rows, (tuple(np.nan * part for part in given),))
    return Certificate(np.nan, np.full(compulsion.structure.n_bodies, np.nan), "", np.nan, "", np.nan, dual)


def _with_active_set(compulsion: Compulsion, given: Answer, factor: KKTFactor | None):
    """Given answer, its unique multipliers, and the result of :func:`active_set`; multipliers that swamp are dropped."""
    factor, answer, correction = active_set(compulsion, given, factor)
    own = _duals(answer)
    if _largest_dual(answer) > SWAMPING_RATIO * _largest_dual(factor.less(answer, correction)):
        given = replace(given, multipliers=0.0 * own[0], inequality_multipliers=0.0 * own[1])
        factor, answer, correction = active_set(compulsion, given, factor)
    return given, own, factor, answer, correction


def _duals(answer: Answer) -> tuple[np.ndarray, np.ndarray]:
    return answer.multipliers, answer.inequality_multipliers


def _largest_dual(answer: Answer) -> float:
    return max(np.abs(part).max(initial=0.0) for part in _duals(answer))


def _dual(factor: KKTFactor, own: tuple[np.ndarray, np.ndarray], returned: Answer, parts) -> DualCertificate:
    """Certificate of the multipliers that are returned, with the parts of their error and those that the backend gave.

    Answers that were refined with this factorisation keep their own: taking off the last correction would change their
    round-off.
    """
    mu = np.maximum(returned.inequality_multipliers, 0.0)  # below zero they are by round-off only
    return DualCertificate(factor.compulsion, returned.multipliers, mu, own, factor.active, tuple(p[2:] for p in parts))


def status_of(answer: Answer, certificate: Certificate, tolerance: float, row_tolerance: float) -> SolveStatus:
    """Status by the certificate, whatever the backend claims."""
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
    elif not certificate.complementarity <= tolerance:  # after an overflow it is not a number
        reason = f"inequality rows violated or multipliers inconsistent by {certificate.complementarity:.1e} relative"
    else:
        reason = ""
    return SolveStatus(not reason, reason, answer.found, answer.message, dual=certificate.dual, tolerance=tolerance)


def conclude(compulsion: Compulsion, answer: Answer, certificate: Certificate, backend: str, tolerance: float) -> Solution:
    """Solution of an answer and its certificate: its accelerations, and its multipliers less their error."""
    status = status_of(answer, certificate, tolerance, max(tolerance, CONTRADICTION * np.sqrt(compulsion.violation)))
    fields = (answer.a, answer.qdd, certificate.dual.multipliers, certificate.dual.inequality_multipliers)
    return Solution(*fields, status, certificate, backend, answer.iterations, compulsion)


def _row_residual(sizes: AccelerationScale, da, dqdd) -> tuple[float, str]:
    """Largest relative residual of a row that the correction leaves, and the name of its constraint."""
    compulsion, answer = sizes.compulsion, sizes.answer
    refined = replace(answer, a=answer.a - da, qdd=answer.qdd - dqdd)
    _, r2, _ = compulsion.residuals(refined.a, refined.qdd, refined.multipliers)
    worst, name = 0.0, ""
    scale = max(np.abs(refined.a).max(), np.abs(compulsion.a_free).max(), np.abs(compulsion.D).max(initial=0.0))
    for constraint in compulsion.structure.constraints:
        size = np.abs(r2[constraint.rows]).max() / scale if scale else 0.0
        if size > worst:
            worst, name = float(size), constraint.name
    if worst > SUSPICIOUS_ERROR:  # at rest under forces in balance: accelerations are round-off of these forces
        worst *= scale / max(scale, SHARE_AT_REST * sizes.by_one_reaction.max(initial=0.0))
    return worst, name


def _complementarity(compulsion: Compulsion, answer: Answer) -> float:
    """Largest relative violation of G x ≤ h, μ ≥ 0 and μ (G x − h) = 0."""
    if not compulsion.h.size:
        return 0.0
    slack = compulsion.h - compulsion.G @ np.concatenate([answer.a, answer.qdd])
    slack, mu = slack / compulsion.row_scales, answer.inequality_multipliers * compulsion.row_scales
    acceleration = compulsion.acceleration_scale(answer.a)
    force = max(compulsion.work(compulsion.impressed), np.abs(mu).max())
    acceleration, force = (size or 1.0 for size in (acceleration, force))
    violations = (np.maximum(-slack, 0) / acceleration, np.maximum(-mu, 0) / force)
    both = np.minimum(np.abs(slack) / acceleration, np.abs(mu) / force)
    return float(max(v.max() for v in (*violations, both)))


def _undetermined(basis: np.ndarray) -> np.ndarray:
    """Multipliers (r,) that redundant rows leave undetermined, by the null space (r, k); empty when all are unique."""
    if not basis.shape[1]:
        return np.zeros(0, dtype=bool)
    sizes = np.linalg.norm(basis / np.linalg.norm(basis, axis=0), axis=1)
    return sizes > UNDETERMINED_SHARE * sizes.max()
