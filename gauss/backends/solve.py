"""The one entry: choose a backend, let it answer, certify the answer."""

from contextlib import suppress
from importlib import import_module
from typing import Protocol, runtime_checkable

import numpy as np

from gauss.backends.accuracy import KEPT, own_settings
from gauss.backends.certificate import TOLERANCE, certify, conclude, factors
from gauss.backends.refining import Refining
from gauss.backends.rescue import automatic
from gauss.compulsion import Answer, Compulsion, Solution
from gauss.compulsion.solution import failure
from gauss.errors import BackendError, known, require


@runtime_checkable
class Backend(Protocol):
    """A method: called with a compulsion, it answers. It may keep a workspace from call to call."""

    name: str

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""


@runtime_checkable
class Factored(Backend, Protocol):
    """A method that answers by a factorisation made for the certificate, which then need not be made twice."""

    def solve_with(self, factor: Refining) -> tuple[Answer, tuple]:
        """Answer, and the correction that the last step of its refinement left."""


# Methods of our own, for equality rows: name, which is also that of the file, and class. Files are imported when their
# method is first asked for: scipy takes long. QP solvers join by name in `make`.
BACKENDS = {
    "recursion": "Recursion",
    "kkt": "KKT",
    "schur": "Schur",
    "nullspace": "NullSpace",
    "pinv": "Pinv",
    "sparse": "Sparse",
    "gradient": "Gradient",
    "proximal": "Proximal",
    "svd": "SVD",
}


def available() -> list[str]:
    """Names of all backends that can be made here: gauss's own, and every installed QP solver."""
    return [*BACKENDS, *_foreign().installed()]


# QP solvers that are called directly and keep their workspace; the others go through qpsolvers.
DIRECT = {"osqp": "OSQP", "clarabel": "Clarabel", "piqp": "PIQP"}


def make(backend: str, form: str | None = None, **settings) -> Backend:
    """Backend by name, ready to be called many times (and to reuse its workspace, if it has one).

    Parameters
    ----------
    backend : str
        One of gauss's own methods, or a QP solver; "qpsolvers:osqp" calls OSQP through qpsolvers, anew each time.
    form : str, optional
        Form of the compulsion that a QP solver gets: "F1" full, "F2" without q̈, "F2s" that scaled, "F3" q̈ alone. When not
        given "F2s", and "F3" where a body has no mass.
    **settings
        Passed on to a foreign solver, over those of :func:`gauss.backends.accuracy.own_settings`.

    Raises
    ------
    BackendError
        If there is no such backend, form or setting here.
    """
    if backend in BACKENDS:
        if settings or form not in (None, "F2s"):
            settings = settings or {"form": form}
            raise BackendError(f"backend {backend!r} takes no settings, got {', '.join(settings)}.")
        return getattr(import_module(f"gauss.backends.{backend}"), BACKENDS[backend])()
    programmed = import_module("gauss.backends.programme").Programmed
    solver = backend.removeprefix("qpsolvers:")
    if solver not in _foreign().installed():
        raise BackendError(
            f"no backend {backend!r}. {known(backend, available())} QP solvers come with pip install 'qpsolvers[NAME]'."
        )
    settings = own_settings(solver) | settings
    if backend in DIRECT:
        method = getattr(import_module(f"gauss.backends.{backend}_"), DIRECT[backend])
        return programmed(method(**(KEPT[backend] | settings)), form)
    return programmed(_foreign().QPSolvers(solver, **settings), form)


def choose(compulsion: Compulsion) -> str:
    """Name of the backend that "auto" tries first; where its answer is not certified, others step in.

    * no inequality rows → "recursion": no QP solver is called; loops are met by a small system on top of the tree;
    * inequality rows → "daqp", an active-set method that is exact to rounding on the scaled form.

    Parameters
    ----------
    compulsion : Compulsion
        What is to be solved.

    Returns
    -------
    str
        Name of a backend.
    """
    return "daqp" if compulsion.h.size else "recursion"


def solve(compulsion: Compulsion, backend: str | Backend = "auto", *, tolerance: float = TOLERANCE, **settings) -> Solution:
    """Accelerations and reactions of least compulsion, certified.

    Parameters
    ----------
    compulsion : Compulsion
        Made by :func:`gauss.assemble`.
    backend : str or Backend
        Name (see :func:`gauss.backends.available`), "auto", or an object from :func:`gauss.backends.make`.
    tolerance : float
        Relative error above which the status is not "solved".
    **settings
        ``form`` and settings of a QP solver, see :func:`gauss.backends.make`.

    Returns
    -------
    Solution
        ``str(solution.status)`` is "solved" only if the certificate confirms it; nothing is raised for a solver
        that fails.

    Raises
    ------
    BackendError
        If there is no such backend.
    """
    require(compulsion, (Compulsion,), "solve")
    if backend == "auto":

        def attempt(name: str) -> Solution:
            return _solved(compulsion, make(name, **(settings if name == choose(compulsion) else {})), tolerance)

        return automatic(compulsion, attempt, lambda: _foreign().installed(), tolerance)
    return _solved(compulsion, make(backend, **settings) if isinstance(backend, str) else backend, tolerance)


def _solved(compulsion: Compulsion, backend: Backend, tolerance: float) -> Solution:
    """Answer of a backend with its certificate."""
    try:
        if compulsion.h.size and backend.name in BACKENDS:
            raise BackendError(f"backend {backend.name!r} takes no inequality rows; use a QP backend such as 'daqp'.")
        if isinstance(backend, Factored):
            return _by_factors(compulsion, backend, tolerance)
        answer = backend(compulsion)
        certificate = certify(compulsion, answer)
    except (BackendError, np.linalg.LinAlgError) as error:  # no answer, or none that can be certified
        answer = failure(compulsion, str(error))
        certificate = certify(compulsion, answer)
    return conclude(compulsion, answer, certificate, backend.name, tolerance)


def _by_factors(compulsion: Compulsion, backend: Factored, tolerance: float) -> Solution:
    """Answer with its certificate, by the first factorisation that leads to one.

    Raises
    ------
    BackendError
        If the last of them, which tells rows that repeat others best, cannot be made.
    """
    *first, last = factors(compulsion)
    for factor in first:
        with suppress(BackendError):
            found = _factored(compulsion, backend, factor(compulsion), tolerance)
            if found.status.certified:
                return found
    return _factored(compulsion, backend, last(compulsion), tolerance)


def _factored(compulsion: Compulsion, backend: Factored, factor: Refining, tolerance: float) -> Solution:
    answer, correction = backend.solve_with(factor)
    certificate = certify(compulsion, answer, factor, correction)
    return conclude(compulsion, answer, certificate, backend.name, tolerance)


def _foreign():
    """Adaptor of qpsolvers, imported only when asked for: it takes long."""
    return import_module("gauss.backends.qpsolvers_")
