"""Calls of somebody else's code, and checks of what it returns: whatever it does wrongly is a BackendError."""

import traceback
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gauss.errors import BackendError

DOUBLE = np.dtype(float)
REAL_KINDS = "fiu"  # kinds of arrays of real numbers; others might be converted, but hardly mean these numbers


class ForeignCode:
    """Context of a call of somebody else's code: whatever it raises is a BackendError.

    BackendError at its end, in place of any other error; not of Ctrl-C.
    """

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if error is None or isinstance(error, KeyboardInterrupt | SystemExit | BackendError):
            return
        if isinstance(error, np.linalg.LinAlgError):  # numpy's message names the fault of the matrix
            raise BackendError(str(error)) from error
        raise BackendError(f"failed: {raised(error)}") from error  # panics of Rust code are no Exceptions


def call(method: Callable, *given):
    """Result of a foreign method, called as :class:`ForeignCode`."""
    with ForeignCode():
        return method(*given)


def raised(error: BaseException) -> str:
    """An error in words: its kind, its message, and the line that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{where}"


def real_array(name: str, given, size: int) -> np.ndarray:
    """Copy of real numbers, shape (size,).

    BackendError if they are not real numbers of this shape.
    """
    if type(given) is np.ndarray and given.dtype is DOUBLE and given.shape == (size,):
        return given.copy()
    try:
        found = np.asarray(given)
    except Exception as error:  # of an object that a backend returns, whatever it is
        raise BackendError(f"failed: {name} is no array: {raised(error)}.") from error
    if found.dtype.kind not in REAL_KINDS or found.shape != (size,):
        what = f"{found.dtype} of shape {found.shape}" if found.ndim else kind(given)
        raise BackendError(f"failed: {name} is {what}, expected {size} real numbers, shape ({size},).")
    return found.astype(float)


def truth(found) -> bool:
    """Whether a backend claims success, as a bool.

    BackendError if it is neither True nor False.
    """
    if not isinstance(found, bool | np.bool_):
        raise BackendError(f"failed: found is {kind(found)}, expected True or False.")
    return bool(found)


def whole_number(iterations) -> int:
    """Number of iterations of a backend.

    BackendError if it is no whole number.
    """
    if not isinstance(iterations, int | np.integer):
        raise BackendError(f"failed: iterations is {kind(iterations)}, expected a whole number.")
    return int(iterations)


def kind(given) -> str:
    """What was returned, in words."""
    return "None" if given is None else f"a {type(given).__name__}"
