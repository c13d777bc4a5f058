"""Names of the arguments of functions and of classes: an unknown keyword is refused with the nearest one."""

from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from types import FunctionType
from typing import Any, TypeVar

from gauss.errors import ArgumentError, did_you_mean

T = TypeVar("T", bound=Callable)


def named_arguments(target: T) -> T:
    """Function, or class by its ``__init__``, that refuses unknown keywords with an ArgumentError that names the nearest."""
    if not isinstance(target, type):
        return _named(target, target.__name__)
    if "__init__" in vars(target):
        target.__init__ = _named(target.__init__, target.__name__)  # type: ignore[misc]  # the same signature
    return target


def named_methods(target: type):
    """Refuse unknown keywords in the public methods of a class, as by :func:`named_arguments`."""
    for name, method in list(vars(target).items()):
        if isinstance(method, FunctionType) and not name.startswith("_"):
            setattr(target, name, _named(method, name))


def _named(function: Any, name: str) -> Any:
    """Function that refuses unknown keywords; it stays as it is if it takes any."""
    kinds = {key: parameter.kind for key, parameter in signature(function).parameters.items()}
    if Parameter.VAR_KEYWORD in kinds.values():
        return function
    known = {key for key, kind in kinds.items() if kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)}

    @wraps(function)
    def call(*arguments, **named):
        if not known.issuperset(named):
            unknown = next(key for key in named if key not in known)
            raise ArgumentError(f"{name}: no argument {unknown!r}. {did_you_mean(unknown, known - {'self'})}")
        return function(*arguments, **named)

    return call
