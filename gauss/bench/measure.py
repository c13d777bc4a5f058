"""One cell of the comparison, measured in a worker: a backend on a problem, in a form, at a level."""

import time
from statistics import median

import numpy as np

from gauss.backends import BACKENDS, certify, make, solve
from gauss.backends.certificate import TOLERANCE, conclude
from gauss.backends.programme import FORMS, attempt, read
from gauss.bench.levels import OWN, settings
from gauss.bench.reference import Reference
from gauss.compulsion import Answer, Compulsion
from gauss.errors import BackendError

AUTO = "auto"  # gauss's own choice, with its rescue
OURS = (AUTO, *BACKENDS)
ROUNDS = 15  # timed solves of one cell, fewer when they take long
BUDGET = 0.1  # [s] for them
WRONG = 1e-3  # relative error above which an answer is wrong for any purpose


def measure(compulsion: Compulsion, expected: Reference, backend: str, form: str, level: str) -> dict:
    """Time of a solve from nothing, error, residuals, claim and certificate of one cell.

    The time of a QP solver is that of its set-up and solve, the matrices given; that of a method of gauss includes the
    making of its matrices.
    """
    if backend in OURS:
        if backend != AUTO and compulsion.h.size:
            raise BackendError("methods of gauss for equality rows take no inequality rows")
        return _judged(compulsion, expected, *_own(compulsion, backend))
    programme = FORMS[form](compulsion).without_zeros()
    if not programme.d.size and not programme.k.size:
        raise BackendError("no rows: nothing to ask for")

    def solve_once():
        return attempt(make(backend, form, **settings(backend, level)).solver, programme)

    outcome = solve_once()
    seconds = _median_seconds(solve_once)
    row = _judged(compulsion, expected, read(compulsion, programme, outcome), backend, seconds)
    if outcome.x is not None and np.isfinite(outcome.x).all():
        y = np.zeros(programme.d.size) if outcome.y is None else outcome.y
        z = np.zeros(programme.k.size) if outcome.z is None else outcome.z
        row["primal"], row["dual"], row["gap"] = programme.residuals(outcome.x, y, z)
    return row


def forms_of(backend: str, asked) -> tuple[str, ...]:
    """Forms in which a backend is measured: all that are asked for, or its own."""
    return (OWN,) if backend in OURS else tuple(asked)


def _own(compulsion: Compulsion, backend: str) -> tuple[Answer, str, float]:
    method = _automatic if backend == AUTO else make(backend)
    answer = method(compulsion)
    return answer, backend, _median_seconds(lambda: method(compulsion))


def _automatic(compulsion: Compulsion) -> Answer:
    found = solve(compulsion)
    parts = found.a, found.qdd, found.multipliers, found.inequality_multipliers
    return Answer(*parts, found.status.certified, str(found.status), found.iterations)


def _median_seconds(solve_once) -> float:
    begin, seconds = time.perf_counter(), []
    while len(seconds) < ROUNDS and (not seconds or time.perf_counter() - begin < BUDGET):
        start = time.perf_counter()
        solve_once()
        seconds.append(time.perf_counter() - start)
    return median(seconds)


def _judged(compulsion: Compulsion, expected: Reference, answer: Answer, backend: str, seconds: float) -> dict:
    certificate = certify(compulsion, answer)
    status = conclude(compulsion, answer, certificate, backend, TOLERANCE).status
    error = expected.error(compulsion, answer)
    return {
        "outcome": "answered" if np.isfinite(error) else ("refused" if not answer.found else "not finite"),
        "seconds": seconds,
        "error": error,
        "primal": np.nan,
        "dual": np.nan,
        "gap": np.nan,
        "claimed": answer.found,
        "certified": status.certified,
        "certificate": certificate.error,
        "iterations": answer.iterations,
        "reason": status.reason or answer.message,
    }
