"""Every answer is checked before it is believed: one refinement step with the recursion as independent factor.

The size of the step is the error of the answer (measured over a dozen backends: ratio to the true error 1.000 ± 0.0004), as
far as residuals show it; what their own rounding may hide is found by a step for random residuals of that size. Both are
judged body by body: residuals of rows, and norms over all bodies, hide wrong answers of light bodies.
"""

from dataclasses import replace

import numpy as np

from gauss.backends.estimate import HELD, SUSPICIOUS, acceleration_errors, pulled
from gauss.backends.recursion import Factor
from gauss.backends.refining import Refining
from gauss.backends.svd import FullFactor
from gauss.compulsion import Answer, Certificate, Compulsion, Solution, Status
from gauss.errors import BackendError

TOLERANCE = 1e-6  # relative error above which an answer is not called solved
OFF_CONSTRAINTS = 10.0  # times √gap: by so much may redundant rows contradict each other in a state that is off by the gap
OPEN = 1e-9  # share of the largest entry above which redundant rows leave a multiplier open
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
        return Certificate(np.nan, unknown, "", np.nan, "", np.nan)
    if factor is None:
        factor = factored(compulsion, active_rows(compulsion, answer))
    if correction is None:
        correction = factor.correction(compulsion, answer)
    basis = factor.free_multipliers()
    answer = _without_loose(answer, basis)
    errors = acceleration_errors(compulsion, answer, correction)
    errors = errors + acceleration_errors(compulsion, answer, factor.rounding(answer))
    n = compulsion.structure.n_bodies
    names = [*compulsion.structure.bodies, *compulsion.structure.coordinates]
    worst = int(np.argmax(errors))
    residual, worst_row = _row_residual(compulsion, answer, *correction[:2])
    loose, constraints = _loose(basis), compulsion.structure.constraints
    return Certificate(
        float(errors[worst]),
        errors[:n],
        names[worst],
        residual,
        worst_row,
        _complementarity(compulsion, answer),
        tuple(c.name for c in constraints if loose[c.rows].any()),
        loose,
    )


def factored(compulsion: Compulsion, active=()) -> Refining:
    """Independent factorisation of a compulsion: the recursion, or that of the whole matrix where the tree does not do.

    Raises
    ------
    BackendError
        If some acceleration is undetermined.
    """
    try:
        return Factor(compulsion, active)
    except BackendError:
        return FullFactor(compulsion, active)


def judge(answer: Answer, certificate: Certificate, tolerance: float, row_tolerance: float) -> Status:
    """Return the status that the certificate allows, whatever the backend claims."""
    if np.isnan(certificate.error):
        reason = answer.message if not answer.found else "the backend claims success, but its numbers are not finite"
    elif certificate.error > tolerance:
        reason = f"estimated relative error {certificate.error:.1e} of {certificate.worst!r} exceeds {tolerance:.0e}"
        reason += "" if answer.found else f" ({answer.message})"
    elif certificate.row_residual > row_tolerance:
        reason = (
            f"rows contradict each other: {certificate.worst_row!r} is violated by {certificate.row_residual:.1e} relative"
        )
    elif certificate.complementarity > tolerance:
        reason = f"inequality rows violated or multipliers inconsistent by {certificate.complementarity:.1e} relative"
    else:
        reason = ""
    return Status(not reason, reason, answer.found, answer.message)


def conclude(compulsion: Compulsion, answer: Answer, certificate: Certificate, backend: str, tolerance: float) -> Solution:
    """Solution of an answer and its certificate."""
    status = judge(answer, certificate, tolerance, max(tolerance, OFF_CONSTRAINTS * np.sqrt(compulsion.gap)))
    fields = (answer.a, answer.qdd, answer.multipliers, answer.inequality_multipliers)
    return Solution(*fields, status, certificate, backend, answer.iterations, compulsion)


def active_rows(compulsion: Compulsion, answer: Answer) -> np.ndarray:
    """Inequality rows that the answer holds as equalities."""
    if not compulsion.h.size:
        return np.zeros(0, dtype=int)
    force = np.abs(compulsion.G) * answer.inequality_multipliers[:, None]
    largest = max(np.abs(compulsion.impressed).max(), np.abs(compulsion.P).max(initial=0.0))
    return np.flatnonzero(force.max(axis=1) > ACTIVE * largest)


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
    mu = answer.inequality_multipliers
    acceleration = max(np.abs(answer.a).max(), np.abs(compulsion.a_free).max())
    force = max(np.abs(compulsion.impressed).max(), np.abs(mu).max())
    acceleration, force = (size or 1.0 for size in (acceleration, force))
    violations = (np.maximum(-slack, 0) / acceleration, np.maximum(-mu, 0) / force)
    both = np.minimum(np.abs(slack) / acceleration, np.abs(mu) / force)
    return float(max(v.max() for v in (*violations, both)))


def _without_loose(answer: Answer, basis: np.ndarray) -> Answer:
    """Answer without what redundant rows leave open in its multipliers, which may be as large as a backend likes."""
    if not basis.shape[1]:
        return answer
    open_part = basis @ np.linalg.lstsq(basis, answer.multipliers, rcond=None)[0]
    return replace(answer, multipliers=answer.multipliers - open_part)


def _loose(basis: np.ndarray) -> np.ndarray:
    """Which multipliers (r,) redundant rows leave open; empty when all are unique."""
    if not basis.shape[1]:
        return np.zeros(0, dtype=bool)
    sizes = np.linalg.norm(basis / np.linalg.norm(basis, axis=0), axis=1)
    return sizes > OPEN * sizes.max()
