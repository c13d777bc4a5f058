"""From a backend to its certified solution: it is called, the form of its answer is checked, the answer is certified.

Whatever somebody else's code raises or wrongly returns is the reason of a failed answer, never an error of the caller.
Arrays that come back are copied, for they may be a workspace of the backend that its next call overwrites.
"""

import traceback
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np

from gauss.backends.backend import BACKENDS, Backend, Factored
from gauss.backends.certificate import certify, conclude
from gauss.backends.compulsion import Compulsion
from gauss.backends.factorisation import factors
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.solution import Answer, Solution, failure
from gauss.errors import BackendError

DOUBLE = np.dtype(float)
OURS = "gauss."  # modules whose classes write to nothing that they are given
REAL_KINDS = "fiu"  # kinds of arrays of real numbers; others might be converted, but hardly mean these numbers


def certified(compulsion: Compulsion, backend: Backend, tolerance: float) -> Solution:
    """Certified solution of a backend; one that is not certified, with the reason, where the backend fails.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.
    backend : Backend
        The method.
    tolerance : float
        Relative error above which the solution is not certified.
    """
    for answer_of in _ways(compulsion, backend):
        try:
            answer, *by = answer_of()
            certificate = certify(compulsion, answer, *by)
        except (BackendError, np.linalg.LinAlgError) as error:  # no answer, or none that can be certified
            answer = failure(compulsion, str(error))
            certificate = certify(compulsion, answer)
        solution = conclude(compulsion, answer, certificate, backend.name, tolerance)
        if solution.status.certified:
            break
    return solution


def _ways(compulsion: Compulsion, backend: Backend) -> Iterator[Callable[[], tuple]]:
    """Functions that return an answer, then the factorisation and the correction that the certificate takes over, if any."""
    if compulsion.h.size and backend.name in BACKENDS:
        yield partial(_refuse, backend)
    elif hasattr(backend, "solve_with"):  # isinstance of a protocol takes a twentieth of the solution
        for factor in factors(compulsion):
            yield partial(_factored_answer, compulsion, cast(Factored, backend), factor)
    else:
        given = compulsion if type(backend).__module__.startswith(OURS) else compulsion.read_only()
        yield lambda: (checked_answer(compulsion, call(backend, given)),)


def _refuse(backend: Backend):
    raise BackendError(f"backend {backend.name!r} takes no inequality rows; use a QP backend such as 'daqp'.")


def _factored_answer(
    compulsion: Compulsion, backend: Factored, make: Callable[..., KKTFactor]
) -> tuple[Answer, KKTFactor, Correction]:
    factor = make(compulsion)
    answer, correction = checked_refinement(factor, call(backend.solve_with, factor))
    return answer, factor, correction


def call(method: Callable, *given):
    """Result of a foreign method.

    Raises
    ------
    BackendError
        If it raises anything.
    """
    try:
        return method(*given)
    except (KeyboardInterrupt, SystemExit, BackendError):
        raise
    except np.linalg.LinAlgError as error:  # numpy's message names the fault of the matrix
        raise BackendError(str(error)) from error
    except BaseException as error:  # panics of Rust code are no Exceptions
        raise BackendError(f"failed: {raised(error)}") from error


def raised(error: BaseException) -> str:
    """An error in words: its kind, its message, and the line that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{where}"


def checked_answer(compulsion: Compulsion, said) -> Answer:
    """Answer of a backend as arrays of the shapes of the compulsion; multipliers of None are zero.

    Raises
    ------
    BackendError
        If it is no answer, or holds other things than real numbers of these shapes.
    """
    if not isinstance(said, Answer):
        raise BackendError(f"failed: it returned {_kind(said)}, expected a gauss.backends.Answer.")
    sizes = {"a": compulsion.Phi.size, "qdd": compulsion.P.size}
    duals = {"multipliers": compulsion.D.size, "inequality_multipliers": compulsion.h.size}
    arrays = {name: real_array(name, getattr(said, name), size) for name, size in sizes.items()}
    for name, size in duals.items():
        given = getattr(said, name)
        arrays[name] = np.zeros(size) if given is None else real_array(name, given, size)
    return Answer(
        **arrays, found=truth(said.found), message=call(str, said.message), iterations=whole_number(said.iterations)
    )


def checked_refinement(factor: KKTFactor, said) -> tuple[Answer, Correction]:
    """Answer and last correction of a backend that takes a factorisation.

    Raises
    ------
    BackendError
        If it returns something else.
    """
    if not (isinstance(said, tuple) and len(said) == 2 and isinstance(said[1], tuple) and len(said[1]) == 4):
        raise BackendError(f"failed: it returned {_kind(said)}, expected an Answer and a correction (a, qdd, λ, μ).")
    answer = checked_answer(factor.compulsion, said[0])
    sizes = answer.a.size, answer.qdd.size, answer.multipliers.size, factor.active.size
    a, qdd, multipliers, mu = (real_array("the correction", *given) for given in zip(said[1], sizes, strict=True))
    return answer, (a, qdd, multipliers, mu)


def real_array(name: str, given, size: int) -> np.ndarray:
    """Copy of real numbers, shape (size,).

    Raises
    ------
    BackendError
        If they are not real numbers of this shape.
    """
    if type(given) is np.ndarray and given.dtype is DOUBLE and given.shape == (size,):
        return given.copy()
    try:
        found = np.asarray(given)
    except Exception as error:  # of an object that a backend returns, whatever it is
        raise BackendError(f"failed: {name} is no array: {raised(error)}.") from error
    if found.dtype.kind not in REAL_KINDS or found.shape != (size,):
        what = f"{found.dtype} of shape {found.shape}" if found.ndim else _kind(given)
        raise BackendError(f"failed: {name} is {what}, expected {size} real numbers, shape ({size},).")
    return found.astype(float)


def truth(found) -> bool:
    """Whether a backend claims success, as a bool.

    Raises
    ------
    BackendError
        If it is neither True nor False.
    """
    if not isinstance(found, bool | np.bool_):
        raise BackendError(f"failed: found is {_kind(found)}, expected True or False.")
    return bool(found)


def whole_number(iterations) -> int:
    """Number of iterations of a backend.

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
