"""Functions of the user that are traced, as costs and conditions: what they raise or return wrongly gets one message."""

from collections.abc import Callable
from numbers import Real

import numpy as np

from gauss.codegen import Expression
from gauss.errors import ArgumentError, GaussError


def numbers_of(function: Callable, given: tuple, what: str, size: int | None = None) -> np.ndarray:
    """Numbers, or expressions of a graph, (m,) that a function of the user gives.

    Parameters
    ----------
    function : callable
        The function; it may return a number, a vector, or several of them.
    given : tuple
        Its arguments.
    what : str
        Its name for messages.
    size : int, optional
        Number of the values; any when not given.

    Raises
    ------
    ArgumentError
        If it raises, as for what cannot be traced, or returns anything else than so many finite numbers.
    """
    try:
        result = function(*given)
        parts = list(result) if isinstance(result, tuple | list) else [result]
        found = np.concatenate([np.ravel(np.asarray(part, dtype=object)) for part in parts] or [np.zeros(0, dtype=object)])
    except GaussError:
        raise
    except Exception as error:  # whatever a function of the user raises
        raise ArgumentError(f"{what} cannot be traced: it raised {type(error).__name__}: {error}.") from error
    if not all(map(_is_number, found)):
        raise ArgumentError(f"{what} cannot be traced: expected finite numbers, got {result!r:.80}.")
    if size is not None and found.size != size:
        raise ArgumentError(f"{what}: expected {'a number' if size == 1 else f'{size} numbers'}, got {result!r:.80}.")
    return found


def _is_number(value) -> bool:
    """Whether a value is a finite number, or an expression of one."""
    return isinstance(value, Expression) or (isinstance(value, Real) and bool(np.isfinite(float(value))))
