"""Compulsion → certified Solution: the one entry. A backend by name answers, and its answer is certified."""

from gauss.backends.answering import certified
from gauss.backends.backend import Backend
from gauss.backends.certificate import TOLERANCE
from gauss.backends.compulsion import Compulsion
from gauss.backends.registry import ready
from gauss.backends.rescue import automatic
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
