"""Arguments of functions and of classes: calls that do not fit are refused, unknown keywords with the nearest one."""

from collections.abc import Callable
from functools import wraps
from inspect import Parameter, Signature, signature
from types import FunctionType
from typing import Any, TypeVar

from gauss.errors import ArgumentError, did_you_mean

T = TypeVar("T", bound=Callable)


def named_arguments(target: T) -> T:
    """Function, or class by its ``__init__``, that refuses calls that do not fit with an ArgumentError."""
    if not isinstance(target, type):
        owner, _, name = target.__qualname__.rpartition(".")
        return _named(target, owner if name == "__init__" else name)
    if "__init__" in vars(target):
        target.__init__ = _named(target.__init__, target.__name__)  # type: ignore[misc]  # the same signature
    return target


def named_methods(target: type):
    """Refuse calls that do not fit the public methods of a class, as by :func:`named_arguments`."""
    for name, method in list(vars(target).items()):
        if isinstance(method, FunctionType) and not name.startswith("_"):
            setattr(target, name, _named(method, name))


def _named(function: Any, name: str) -> Any:
    """Function that refuses calls that do not fit; it stays as it is if it takes any keywords."""
    expected = signature(function)
    kinds = {key: parameter.kind for key, parameter in expected.parameters.items()}
    if Parameter.VAR_KEYWORD in kinds.values():
        return function
    known = {key for key, kind in kinds.items() if kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)}

    @wraps(function)
    def call(*arguments, **named):
        if not known.issuperset(named):
            unknown = next(key for key in named if key not in known)
            raise ArgumentError(f"{name}: no argument {unknown!r}. {did_you_mean(unknown, known - {'self'})}")
        try:
            return function(*arguments, **named)
        except TypeError:
            why = _misfit(expected, arguments, named)
            if not why:
                raise
        raise ArgumentError(f"{name}: {why}.")

    return call


def _misfit(expected: Signature, arguments: tuple, named: dict) -> str:
    """Why a call does not fit a signature; empty if it does."""
    try:
        expected.bind(*arguments, **named)
    except TypeError as error:
        return str(error)
    return ""
