"""One cell of the comparison, measured in a worker: a backend on an instance, in a form, at a level."""

from dataclasses import replace
from functools import lru_cache
from statistics import median

import numpy as np

from gauss.backends import certify, make, solve
from gauss.backends.certificate import TOLERANCE, conclude
from gauss.backends.compulsion import Compulsion
from gauss.backends.programme import Outcome, Programme
from gauss.backends.programmed import read
from gauss.backends.solution import Answer
from gauss.bench.clocks import COMPILING, UNKNOWN, ended, median_times, summary, timed
from gauss.bench.contestants import ready, refusal, started
from gauss.bench.instances import Instance, of_arrays
from gauss.bench.levels import AUTO, LIMIT, OURS, OWN, Promise, promise
from gauss.bench.ready import Ready
from gauss.bench.structured import CONES, COULOMB, ROWS, STAGES, ProgrammeStructure, StructuredProgramme
from gauss.errors import BackendError

NOT_ASKED = "not asked"  # outcome of a problem that a solver does not take: no failure
LOADING = 30.0  # [s] of CPU time that a library may take to load and to solve a tiny programme
WRONG = 1e-3  # relative error above which an answer is wrong for any purpose
# Relative to the terms that a residual sums: rounding of a residual that is no fault of a solver.
TERM_ROUNDING_RELATIVE = 10.0 * np.finfo(float).eps
FIGURES: tuple[str, ...] = ("cold", "seconds", "lower", "upper", "setup", "solve", "library")
FIGURES += ("warm", "error", "dual_error", "primal", "dual", "gap", "excess", "certificate")


def measure(instance: Instance, backend: str, form: str, level: str) -> dict:
    """Times, error, residuals, claim and certificate of one cell.

    The clock runs for set-up and solve of a QP solver, its problem ready in the form that it takes; that of a method of
    gauss includes the making of its matrices.
    """
    if backend in OURS:
        return _own(instance, backend)
    programme = instance.programme(form)
    if reason := refusal(backend, programme):
        return unanswered() | {"outcome": NOT_ASKED, "reason": reason}
    given = _copied(programme)  # a solver may change what it is given; it is judged by the programme itself
    try:
        prepared = ready(backend, given, level)
    except BackendError as error:
        return unanswered() | {"outcome": NOT_ASKED, "reason": str(error)}
    _loaded(backend, level, instance.structure.kind)
    outcome, times = _called(prepared, backend in COMPILING)
    if _differs(given, programme):
        outcome = replace(outcome, found=False, message="the solver changed the programme that it was given")
    row = unanswered() | times | _judged(instance, programme, outcome, promise(backend, level))
    row["warm"] = _warm(instance, backend, programme, level)
    if times["seconds"] > LIMIT:
        row |= {"outcome": "timed out", "claimed": False, "reason": f"{times['seconds']:.2g} s, the limit is {LIMIT:g} s"}
    return row


def _copied(programme: Programme) -> Programme:
    """Programme with matrices and vectors of its own."""
    return replace(programme, **{name: getattr(programme, name).copy() for name in ("H", "c", "C", "d", "K", "k")})


def _differs(given: Programme, programme: Programme) -> bool:
    """Whether any number of two programmes of the same shape differs; the order in which they are stored may."""
    vectors = zip((given.c, given.d, given.k), (programme.c, programme.d, programme.k), strict=True)
    matrices = zip((given.H, given.C, given.K), (programme.H, programme.C, programme.K), strict=True)
    return not all(np.array_equal(a, b, equal_nan=True) for a, b in vectors) or any((a != b).nnz for a, b in matrices)


def unanswered() -> dict:
    """Row of a cell without an answer."""
    return dict.fromkeys(FIGURES, np.nan) | {"claimed": False, "certified": False, "iterations": 0, "reason": ""}


def _called(prepared: Ready, compiles: bool) -> tuple[Outcome, dict]:
    """Outcome of a solver, and its times."""
    with prepared.around:
        found, seconds = timed(lambda: _returned(prepared.call), LIMIT, compiles)
        times = [UNKNOWN if isinstance(one, BaseException) else prepared.library(one) for one in found]
        last = found[-1]
        if isinstance(last, BaseException):
            outcome = Outcome(None, None, None, False, f"{type(last).__name__}: {last}")
        else:
            outcome = prepared.read(last)
    return outcome, summary(seconds) | median_times(times, seconds)


def _warm(instance: Instance, backend: str, programme: Programme, level: str) -> float:
    """Time [s] of a call that starts at the answer of the step before; nan where a solver takes no start, or fails then."""
    warm = None if instance.start is None else started(backend, programme, level, instance.start)
    if warm is None:
        return np.nan
    with warm.around:
        found, seconds = timed(lambda: _returned(warm.call), LIMIT)
        claimed = not isinstance(found[-1], BaseException) and warm.read(found[-1]).found
    return summary(seconds)["seconds"] if claimed else np.nan


def _returned(call):
    """What a call returns, or the error that it raises."""
    try:
        return call()
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # panics of Rust code are no Exceptions
        return error


# Tiny programmes by the kind of their structure: rows, cones, Coulomb's law, stages.
TINY_PROGRAMMES = {
    ROWS: of_arrays("", "", np.eye(2), np.ones(2), np.ones((1, 2)), [1.0], np.eye(2)[:1], [1.0]),
    STAGES: of_arrays(
        "",
        "",
        np.eye(2),
        np.ones(2),
        [[-1.0, 1.0]],
        [1.0],
        np.eye(2),
        [1.0] * 2,
        structure=ProgrammeStructure(stages=(1, 1, 1)),
    ),
    CONES: of_arrays("", "", np.eye(3), np.ones(3), None, None, -np.eye(3), np.zeros(3), structure=ProgrammeStructure((3,))),
    COULOMB: of_arrays(
        "", "", np.eye(3), np.ones(3), None, None, -np.eye(3), np.zeros(3), structure=ProgrammeStructure((3,), (1.0,))
    ),
}


@lru_cache
def _loaded(backend: str, level: str, kind: str):
    """Solve a tiny programme once, so that loading the library is no part of the first timed solve."""
    tiny = TINY_PROGRAMMES[kind]
    prepared = ready(backend, tiny.programme(""), level)
    with prepared.around, ended(LOADING):
        _returned(prepared.call)


def _judged(instance: Instance, programme: Programme, outcome: Outcome, promised: Promise) -> dict:
    """Residuals of an answer, their excess over the promise of the solver, its error, and the certificate."""
    row = {"claimed": outcome.found, "iterations": outcome.iterations, "reason": outcome.message, "outcome": "refused"}
    if outcome.x is None:
        return row
    if not _is_finite(outcome):
        return row | {"outcome": "not finite"}
    y = np.zeros(programme.d.size) if outcome.y is None or not np.size(outcome.y) else outcome.y
    z = np.zeros(programme.k.size) if outcome.z is None or not np.size(outcome.z) else outcome.z
    if isinstance(programme, StructuredProgramme):
        y, z = programme.multipliers(outcome.x, y, z)
    residuals = programme.residuals(outcome.x, y, z)
    row |= dict(zip(("primal", "dual", "gap"), residuals, strict=True))
    row["excess"] = _excess(programme, outcome.x, y, z, promised)
    if instance.compulsion is None:
        known = instance.known
        dual_error = np.nan if known is None else known.dual_error(np.concatenate([y, z]))
        return row | {"outcome": "answered", "error": instance.error(None, outcome.x), "dual_error": dual_error}
    answer = read(instance.compulsion, programme, outcome)
    return row | {"outcome": "answered"} | _certified(instance, answer)


def _is_finite(outcome: Outcome) -> bool:
    """Whether all numbers of an outcome are finite."""
    return all(np.isfinite(part).all() for part in (outcome.x, outcome.y, outcome.z) if part is not None)


def _excess(programme: Programme, x, y, z, promised: Promise) -> float:
    """Largest of the residuals over what is promised of them, or over the rounding of their terms where this is more."""
    p = programme
    residuals, floors = p.residuals(x, y, z), _floors(p, x, y, z)
    tolerances = np.array(promised[:3])
    if promised.relative:  # as Clarabel, CVXOPT and ECOS measure residuals, by two-norms
        norm = np.linalg.norm
        primal = norm(np.concatenate([p.d, p.k])) + norm(x) + norm(p.k - p.K @ x)
        dual = norm(p.c) + norm(x) + norm(np.concatenate([y, z]))
        tolerances[:2] *= np.maximum([float(primal), float(dual)], 1.0)
    return float(np.max(residuals / np.maximum(tolerances, floors)))


def _floors(programme: Programme, x, y, z) -> np.ndarray:
    """Rounding (3,) of the residuals that :meth:`Programme.residuals` returns: no residual of large numbers is smaller."""
    p, x, y, z = programme, np.abs(x), np.abs(y), np.abs(z)
    H, C, K = abs(p.H), abs(p.C), abs(p.K)
    rows = max((C @ x + np.abs(p.d)).max(initial=0.0), (K @ x + np.abs(p.k)).max(initial=0.0))
    stationarity = (H @ x + np.abs(p.c) + C.T @ y + K.T @ z).max(initial=0.0)
    gap = x @ (H @ x) + np.abs(p.c) @ x + np.abs(p.d) @ y + np.abs(p.k) @ z
    return TERM_ROUNDING_RELATIVE * np.array([rows, stationarity, gap])


def _certified(instance: Instance, answer: Answer) -> dict:
    """Error of an answer, and its certificate."""
    compulsion = instance.compulsion
    assert compulsion is not None  # certificates are of compulsions
    certificate = certify(compulsion, answer)
    status = conclude(compulsion, answer, certificate, "", TOLERANCE).status
    return {
        "error": instance.error(answer, None),
        "dual_error": certificate.dual.given_error if np.isfinite(certificate.error) else np.nan,
        "certified": status.certified,
        "certificate": certificate.error,
    }


def _own(instance: Instance, backend: str) -> dict:
    compulsion = instance.compulsion
    if compulsion is None:
        raise BackendError("methods of gauss take a compulsion, not a programme from a file")
    if backend != AUTO and compulsion.h.size:
        raise BackendError("methods of gauss for equality rows take no inequality rows")
    method = _automatic if backend == AUTO else make(backend)
    found, seconds = timed(lambda: method(compulsion), LIMIT)
    answer = found[-1]
    claims = {"claimed": answer.found, "iterations": answer.iterations, "reason": answer.message}
    row = unanswered() | summary(seconds) | claims
    outcome = "answered" if np.isfinite(answer.qdd).all() else ("not finite" if answer.found else "refused")
    return row | {"outcome": outcome} | _certified(instance, answer)


def forms_of(backend: str, instance: Instance, asked) -> tuple[str, ...]:
    """Forms in which a backend is measured on an instance."""
    return (OWN,) if backend in OURS else instance.forms(asked)


def _automatic(compulsion: Compulsion) -> Answer:
    found = solve(compulsion)
    parts = found.a, found.qdd, found.multipliers, found.inequality_multipliers
    return Answer(*parts, found.status.certified, str(found.status), found.iterations)


def middle(values) -> float:
    """Median; nan counts as infinite."""
    return (
        float(median(np.nan_to_num(np.asarray(values, dtype=float), nan=np.inf, posinf=np.inf))) if len(values) else np.nan
    )
