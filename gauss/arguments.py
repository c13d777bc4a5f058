"""Arguments of functions and of classes: calls that do not fit are refused, unknown keywords with the nearest one.

Numbers, tables and names of the user are read by one function for each, which refuses everything else by what was expected.
"""

import sys
from collections.abc import Callable, Mapping
from functools import wraps
from inspect import Parameter, Signature, signature
from types import FunctionType
from typing import Any, TypeVar

import numpy as np

from gauss.errors import ArgumentError, did_you_mean

T = TypeVar("T", bound=Callable)
LARGEST_FLOAT = sys.float_info.max  # bound of numbers that may be integers: no float holds 10**400


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


def is_masked(value) -> bool:
    """Whether a value has masked entries."""
    return "numpy.ma" in sys.modules and bool(np.ma.is_masked(value))  # its import takes long


def real_numbers(value) -> np.ndarray | None:
    """Array of real numbers; None of anything else: text, objects, complex or masked numbers, rows of several lengths."""
    if is_masked(value):
        return None
    try:
        found = np.asarray(value)
    except (ValueError, RuntimeError):  # ragged; a tensor of torch in a graph of gradients
        return None
    return found.astype(float) if found.dtype.kind in "biuf" else None


def real_array(value, what: str, expected: str = "numbers") -> np.ndarray:
    """Array of real numbers.

    ArgumentError if it is none: text, objects, complex or masked numbers, rows of several lengths.

    Parameters
    ----------
    value : array_like
        What the user gave.
    what : str
        Function and argument, for the message.
    expected : str
        What is expected, in words.
    """
    found = real_numbers(value)
    if found is not None:
        return found
    if isinstance(value, np.ndarray) and not value.size:
        return np.zeros(value.shape)
    raise ArgumentError(f"{what}: expected {expected}, got {value!r:.80}.")


def table(value, what: str, expected: str) -> dict:
    """Mapping of names; empty for None.

    Raises
    ------
    ArgumentError
        If it is no mapping of texts.
    """
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise ArgumentError(f"{what}: expected {expected}, got {value!r:.80}.")
    return dict(value)


def name_list(value, what: str, expected: str = "names") -> tuple[str, ...]:
    """Names, of one text or of several; none for None.

    ArgumentError if one is no text.
    """
    if isinstance(value, str) or value is None:
        return () if value is None else (value,)
    if not np.iterable(value) or isinstance(value, bytes) or not all(isinstance(name, str) for name in value):
        raise ArgumentError(f"{what}: expected {expected}, got {value!r:.80}.")
    return tuple(value)


def generator(seed, what: str) -> np.random.Generator:
    """Generator of random numbers of a seed.

    ArgumentError if the seed is no whole number ≥ 0, nor None for one that differs from call to call.
    """
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0):
        raise ArgumentError(f"{what}: seed: expected a whole number of at least 0, or None, got {seed!r:.80}.")
    return np.random.default_rng(seed)
