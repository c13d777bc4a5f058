"""Compulsion → certified Solution: the one entry. A backend by name answers, and its answer is certified.

Backend "auto" tries one method after another until an answer is certified; the status names those that failed. The order is
that of independence: the singular values of the whole KKT matrix where the tree moves no inertia or the rank of a loop is
hard to tell; other QP solvers where an active-set method stalls. Answers with inequality rows get one proximal step more:
their active rows are taken as equalities, and the correction that the certificate finds is taken off.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from gauss.backends.active_set import active_set
from gauss.backends.answering import certified
from gauss.backends.backend import Backend
from gauss.backends.certificate import TOLERANCE, certify, conclude
from gauss.backends.compulsion import Compulsion
from gauss.backends.registry import choose, is_installed, make, ready
from gauss.backends.solution import Solution
from gauss.errors import judged_later, require


def solve(
    compulsion: Compulsion, backend: str | Backend | type = "auto", *, tolerance: float = TOLERANCE, **settings
) -> Solution:
    """Accelerations and reactions of least compulsion, certified.

    Parameters
    ----------
    compulsion : Compulsion
        Made by :func:`gauss.assemble`.
    backend : str, Backend or class
        "auto", a name (see :func:`gauss.backends.available`), an object from :func:`gauss.backends.make`, or anything of
        the form of :class:`gauss.backends.Backend`.
    tolerance : float
        Relative error of accelerations and of multipliers above which the status is not "solved".
    **settings
        ``form`` and settings of a QP solver, see :func:`gauss.backends.make`.

    Returns
    -------
    Solution
        ``str(solution.status)`` is "solved" only if the certificate confirms it; nothing is raised for a solver
        that fails, or that answers in other shapes than those of the compulsion: the status says why.

    Raises
    ------
    BackendError
        If there is no such backend.
    ArgumentError
        If it has not the form of a backend.
    """
    require(compulsion, (Compulsion,), "solve")
    with judged_later():
        if isinstance(backend, str) and backend == "auto":
            return automatic(compulsion, tolerance, settings)
        method = ready(backend, **settings)
        return certified(compulsion, method, tolerance)


EQUALITIES = ("recursion", "svd", "nullspace", "sparse")
INEQUALITIES = ("daqp", "piqp", "clarabel", "quadprog")
CORRECTABLE_ERROR = 1e-3  # relative error from which one step brings an answer to round-off


def automatic(compulsion: Compulsion, tolerance: float, settings: dict) -> Solution:
    """First certified solution of the methods that suit a compulsion; the first one's failure if there is none.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.
    tolerance : float
        Relative error above which a solution is not certified.
    settings : dict
        ``form`` and settings of the method that :func:`gauss.backends.choose` names.
    """
    failed, solutions = dict[str, str](), list[Solution]()
    for name in _candidates(compulsion):
        method = make(name, **(settings if name == choose(compulsion) else {}))
        solution = certified(compulsion, method, tolerance)
        if compulsion.h.size:
            solution = refined(solution, tolerance)
        if solution.status.certified:
            rescued = "; ".join(f"{other}: {reason}" for other, reason in failed.items())
            return replace(solution, status=replace(solution.status, rescued=rescued)) if rescued else solution
        failed[name] = solution.status.reason
        solutions.append(solution)
    first, others = solutions[0], f"; nor by {', '.join([*failed][1:])}" if len(failed) > 1 else ""
    reason = f"{first.status.reason.removesuffix('.')}{others}"
    return replace(first, status=replace(first.status, reason=reason))


def _candidates(compulsion: Compulsion) -> Iterator[str]:
    """Names of the methods to try, in order; one alone where numbers are not finite: no other could do better."""
    finite = all(np.isfinite(part).all() for part in (compulsion.impressed, compulsion.D, compulsion.P, compulsion.h))
    names = filter(is_installed, INEQUALITIES) if compulsion.h.size else iter(EQUALITIES)
    return names if finite else islice(names, 1)


def refined(solution: Solution, tolerance: float) -> Solution:
    """Solution less its error, with the same active rows; the given one if that is no better."""
    error, compulsion = solution.certificate.error, solution.compulsion
    if not 0.0 < error < CORRECTABLE_ERROR:
        return solution
    answer = solution.answer
    factor, _, correction = active_set(compulsion, answer)
    better = factor.less(answer, correction)
    better = replace(better, found=True, message="solved")
    certificate = certify(compulsion, better, factor)
    if not certificate.error < error or certificate.complementarity > max(solution.certificate.complementarity, tolerance):
        return solution
    return conclude(compulsion, better, certificate, solution.backend, tolerance)
