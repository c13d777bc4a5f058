"""Asking somebody else's code: what it raises or wrongly returns is a reason why there is no answer, no error of the caller.

What comes back is copied, for it may be a workspace of the backend that the next call overwrites.
"""

import traceback
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.refining import Refining
from gauss.backends.solution import Answer
from gauss.errors import BackendError

DOUBLE = np.dtype(float)
NUMBERS = "fiu"  # kinds of arrays that are numbers; others might be converted, but hardly mean what they then say


def ask(method: Callable, *given):
    """What a method returns.

    Raises
    ------
    BackendError
        If it raises anything.
    """
    try:
        return method(*given)
    except (KeyboardInterrupt, SystemExit, BackendError):
        raise
    except np.linalg.LinAlgError as error:  # numpy says best what is wrong with a matrix
        raise BackendError(str(error)) from error
    except BaseException as error:  # panics of Rust code are no Exceptions
        raise BackendError(f"failed: {raised(error)}") from error


def raised(error: BaseException) -> str:
    """An error in words: its kind, its message, and the line that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{where}"


def checked(compulsion: Compulsion, said) -> Answer:
    """Answer that a backend gave, as arrays of the shapes that the compulsion asks for; multipliers of None are zero.

    Raises
    ------
    BackendError
        If it is no answer, or its parts are not numbers of these shapes.
    """
    if not isinstance(said, Answer):
        raise BackendError(f"failed: it returned {_kind(said)}, expected a gauss.backends.Answer.")
    sizes = {"a": compulsion.Phi.size, "qdd": compulsion.P.size}
    duals = {"multipliers": compulsion.D.size, "inequality_multipliers": compulsion.h.size}
    parts = {name: numbers(name, getattr(said, name), size) for name, size in sizes.items()}
    for name, size in duals.items():
        given = getattr(said, name)
        parts[name] = np.zeros(size) if given is None else numbers(name, given, size)
    return Answer(**parts, found=claim(said.found), message=ask(str, said.message), iterations=count(said.iterations))


def checked_pair(factor: Refining, said) -> tuple[Answer, tuple]:
    """Answer and last correction of a backend that was given a factorisation.

    Raises
    ------
    BackendError
        If it gave something else.
    """
    if not (isinstance(said, tuple) and len(said) == 2 and isinstance(said[1], tuple) and len(said[1]) == 4):
        raise BackendError(f"failed: it returned {_kind(said)}, expected an Answer and a correction (a, qdd, λ, μ).")
    answer = checked(factor.compulsion, said[0])
    sizes = answer.a.size, answer.qdd.size, answer.multipliers.size, factor.active.size
    return answer, tuple(numbers("the correction", part, size) for part, size in zip(said[1], sizes, strict=True))


def numbers(name: str, given, size: int) -> np.ndarray:
    """Copy of some numbers, shape (size,).

    Raises
    ------
    BackendError
        If they are not real numbers of this shape.
    """
    if type(given) is np.ndarray and given.dtype is DOUBLE and given.shape == (size,):
        return given.copy()
    try:
        found = np.asarray(given)
    except Exception as error:
        raise BackendError(f"failed: {name} is no array: {raised(error)}.") from error
    if found.dtype.kind not in NUMBERS or found.shape != (size,):
        what = f"{found.dtype} of shape {found.shape}" if found.ndim else _kind(given)
        raise BackendError(f"failed: {name} is {what}, expected {size} real numbers, shape ({size},).")
    return found.astype(float)


def claim(found) -> bool:
    """Whether a backend claims success.

    Raises
    ------
    BackendError
        If what it says is neither true nor false.
    """
    if not isinstance(found, bool | np.bool_):
        raise BackendError(f"failed: found is {_kind(found)}, expected True or False.")
    return bool(found)


def count(iterations) -> int:
    """Iterations that a backend counts.

    Raises
    ------
    BackendError
        If it is no whole number.
    """
    if not isinstance(iterations, int | np.integer):
        raise BackendError(f"failed: iterations is {_kind(iterations)}, expected a whole number.")
    return int(iterations)


def _kind(given) -> str:
    return "None" if given is None else f"a {type(given).__name__}"
