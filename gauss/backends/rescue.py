"""Backend "auto": one method after another until the certificate confirms an answer, and a word about those that failed.

A method that is right where another fails: the singular values of the whole KKT matrix where the tree moves no inertia or
the rank of a loop is hard to tell; other QP solvers where an active-set method stalls. Answers with inequality rows get one
proximal step more: their active rows are taken as equalities and their error, as the certificate sees it, is taken off.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.backends.certificate import certify, conclude, settled
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution

EQUALITIES = ("recursion", "svd", "nullspace", "sparse")
INEQUALITIES = ("daqp", "piqp", "clarabel", "quadprog")
REACH = 1e-3  # relative error from which one step brings an answer to rounding


def automatic(compulsion: Compulsion, attempt: Callable[[str], Solution], installed: Callable, tolerance: float) -> Solution:
    """First certified solution of the methods that suit a compulsion; the first one's failure if there is none.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.
    attempt : callable
        ``attempt(name)`` solves it by a method.
    installed : callable
        Returns the names of the QP solvers that there are.
    tolerance : float
        Relative error above which a solution is not certified.
    """
    names, failed, first = EQUALITIES, [], None
    if compulsion.h.size:
        present = installed()
        names = [name for name in INEQUALITIES if name in present]
    if not all(np.isfinite(part).all() for part in (compulsion.impressed, compulsion.D, compulsion.P, compulsion.h)):
        names = names[:1]  # a motion that has blown up is beyond rescue
    for name in names:
        solution = attempt(name)
        if compulsion.h.size:
            solution = refined(solution, tolerance)
        if solution.status.certified:
            return replace(solution, status=replace(solution.status, rescued="; ".join(failed)))
        failed.append(f"{name}: {solution.status.reason}")
        first = first or solution
    others = f"; nor by {', '.join(names[1:])}" if names[1:] else ""
    reason = f"{first.status.reason.removesuffix('.')}{others}"
    return replace(first, status=replace(first.status, reason=reason))


def refined(solution: Solution, tolerance: float) -> Solution:
    """Solution less its error, with the same active rows; as it was if that is no better."""
    error, compulsion = solution.certificate.error, solution.compulsion
    if not 0.0 < error < REACH:
        return solution
    answer = solution.answer
    factor, _, correction = settled(compulsion, answer)
    better = factor.less(answer, correction)
    better = replace(better, found=True, message="solved")
    certificate = certify(compulsion, better, factor)
    if not certificate.error < error or certificate.complementarity > max(solution.certificate.complementarity, tolerance):
        return solution
    return conclude(compulsion, better, certificate, solution.backend, tolerance)
