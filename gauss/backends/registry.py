"""Backends by name, gauss's own methods and the installed QP solvers, and the rule of choice."""

from functools import partial
from importlib import import_module

from gauss.backends.accuracy import KEPT, own_settings
from gauss.backends.backend import BACKENDS, Backend
from gauss.backends.compulsion import Compulsion
from gauss.backends.foreign import call
from gauss.errors import ArgumentError, BackendError, did_you_mean

# QP solvers that are called directly; the others go through qpsolvers, which imports all of them.
DIRECT = {"osqp": "OSQP", "clarabel": "Clarabel", "piqp": "PIQP", "daqp": "DAQP"}


def available() -> list[str]:
    """Names of all backends that can be made here: gauss's own, and every installed QP solver."""
    return [*BACKENDS, *installed_solvers()]


def installed_solvers() -> list[str]:
    """Names of the installed QP solvers."""
    return _foreign().installed()


def is_installed(solver: str) -> bool:
    """Whether a QP solver is installed; one that is called directly is imported without qpsolvers."""
    if solver not in DIRECT:
        return solver in installed_solvers()
    try:
        import_module(solver)
    except ImportError:
        return False
    return True


def choose(compulsion: Compulsion) -> str:
    """Name of the backend that "auto" tries first; where its answer is not certified, others step in.

    * no inequality rows → "recursion": no QP solver is called; loops are met by a small system on top of the tree;
    * inequality rows → "daqp", an active-set method that is exact to round-off on the scaled form.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.

    Returns
    -------
    str
        Name of a backend.
    """
    return "daqp" if compulsion.h.size else "recursion"


def ready(backend, **settings) -> Backend:
    """Backend of a name, or an object of the caller's own, ready to be called many times.

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
        backend, settings = call(partial(backend, **settings)), {}
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
        Passed on to a QP solver, over those of :func:`gauss.backends.accuracy.own_settings`.

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
    programmed = import_module("gauss.backends.programmed").Programmed
    solver = backend.removeprefix("qpsolvers:")
    if not (is_installed(solver) if backend in DIRECT else solver in installed_solvers()):
        raise BackendError(
            f"no backend {backend!r}. {did_you_mean(backend, available())} QP solvers come with "
            "pip install 'qpsolvers[NAME]'."
        )
    settings = own_settings(solver) | settings
    if backend in DIRECT:
        method = getattr(import_module(f"gauss.backends.{backend}_"), DIRECT[backend])
        return programmed(method(**(KEPT.get(backend, {}) | settings)), form)
    return programmed(_foreign().QPSolvers(solver, **settings), form)


def _foreign():
    """Adaptor of qpsolvers, imported only when asked for: it takes long."""
    return import_module("gauss.backends.qpsolvers_")
