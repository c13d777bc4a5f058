"""The one entry: choose a backend, let it answer, certify the answer."""

from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Protocol, runtime_checkable

import numpy as np

from gauss.backends.accuracy import KEPT, own_settings
from gauss.backends.asked import ask, checked, checked_pair
from gauss.backends.certificate import TOLERANCE, certify, conclude, factors
from gauss.backends.compulsion import Compulsion
from gauss.backends.refining import Refining
from gauss.backends.rescue import automatic
from gauss.backends.solution import Answer, Solution, failure
from gauss.errors import ArgumentError, BackendError, did_you_mean, judged_later, require


@runtime_checkable
class Backend(Protocol):
    """A method: called with a compulsion, it answers. It may keep a workspace from call to call.

    Any object of this form can be given wherever a backend is named, also a class that makes one without arguments. What it
    raises, and arrays of other shapes, become the reason of a status; accelerations and multipliers are certified.
    A QP solver is wrapped by :class:`gauss.backends.programme.Programmed`, and then gets matrices.

    Attributes
    ----------
    name : str
        By which results and messages call it; not that of a method of gauss.

    Examples
    --------
    >>> class Dense:
    ...     name = "dense"
    ...
    ...     def __call__(self, compulsion):
    ...         rows, n = np.hstack([compulsion.A, compulsion.B]), compulsion.Phi.size
    ...         inertia = np.diag(np.append(compulsion.Phi, np.zeros(compulsion.P.size)))
    ...         K = np.block([[inertia, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    ...         x = np.linalg.solve(K, np.concatenate([compulsion.impressed, compulsion.P, compulsion.D]))
    ...         return Answer(x[:n], x[n : -len(rows)], x[-len(rows) :], np.zeros(0))
    >>> gauss.simulate(scene, 1.0, backend=Dense)
    """

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
            f"no backend {backend!r}. {did_you_mean(backend, available())} QP solvers come with "
            "pip install 'qpsolvers[NAME]'."
        )
    settings = own_settings(solver) | settings
    if backend in DIRECT:
        method = getattr(import_module(f"gauss.backends.{backend}_"), DIRECT[backend])
        return programmed(method(**(KEPT[backend] | settings)), form)
    return programmed(_foreign().QPSolvers(solver, **settings), form)


def ready(backend, **settings) -> Backend:
    """Backend of a name, or an object of somebody else, ready to be called many times.

    Parameters
    ----------
    backend : str, Backend or class
        Name, see :func:`make`; an object of the form of :class:`Backend`; or a class that makes one from the settings.
    **settings
        ``form`` and settings, of backends given by name or class.

    Raises
    ------
    BackendError
        If there is no backend of this name, or the class makes none.
    ArgumentError
        If it is something else, or its name is that of a method of gauss.
    """
    if isinstance(backend, str):
        return make(backend, **settings)
    if isinstance(backend, type):
        backend, settings = ask(partial(backend, **settings)), {}
    if not isinstance(backend, Backend) or not isinstance(backend.name, str):
        raise ArgumentError(
            "backend: expected 'auto', a name of gauss.backends.available(), or an object that has a name, is called with a "
            f"Compulsion and returns an Answer (see gauss.backends.Backend), got a {type(backend).__name__}."
        )
    if backend.name in BACKENDS and not type(backend).__module__.startswith("gauss.backends."):
        raise ArgumentError(f"backend: {backend.name!r} is the name of a method of gauss; give yours another name.")
    if settings:
        raise ArgumentError(f"backend {backend.name!r} is made already; it takes no settings, got {', '.join(settings)}.")
    return backend


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

    def attempt(name: str) -> Solution:
        return _solved(compulsion, make(name, **(settings if name == choose(compulsion) else {})), tolerance)

    with judged_later():
        if isinstance(backend, str) and backend == "auto":
            return automatic(compulsion, attempt, lambda: _foreign().installed(), tolerance)
        return _solved(compulsion, ready(backend, **settings), tolerance)


def _solved(compulsion: Compulsion, backend: Backend, tolerance: float) -> Solution:
    """Answer of a backend with its certificate."""
    try:
        if compulsion.h.size and backend.name in BACKENDS:
            raise BackendError(f"backend {backend.name!r} takes no inequality rows; use a QP backend such as 'daqp'.")
        if isinstance(backend, Factored):
            return _by_factors(compulsion, backend, tolerance)
        answer = checked(compulsion, ask(backend, compulsion))
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
    answer, correction = checked_pair(factor, ask(backend.solve_with, factor))
    certificate = certify(compulsion, answer, factor, correction)
    return conclude(compulsion, answer, certificate, backend.name, tolerance)


def _foreign():
    """Adaptor of qpsolvers, imported only when asked for: it takes long."""
    return import_module("gauss.backends.qpsolvers_")
