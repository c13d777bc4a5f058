"""From a backend to its certified solution: it is called, the form of its answer is checked, the answer is certified.

Whatever somebody else's code raises or wrongly returns is the reason of a failed answer, never an error of the caller.
Arrays that come back are copied, for they may be a workspace of the backend that its next call overwrites.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import cast

import numpy as np

from gauss.backends.backend import BACKENDS, Backend, Factored
from gauss.backends.certificate import certify, conclude
from gauss.backends.compulsion import Compulsion
from gauss.backends.factorisation import factors
from gauss.backends.foreign import ForeignCode, call, kind, real_array, truth, whole_number
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.solution import Answer, Solution, failure
from gauss.errors import BackendError

OURS = "gauss."  # modules whose classes write to nothing that they are given


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
        yield partial(_answer, compulsion, backend)


def _refuse(backend: Backend):
    raise BackendError(f"backend {backend.name!r} takes no inequality rows; use a QP backend such as 'daqp'.")


def _answer(compulsion: Compulsion, backend: Backend) -> tuple[Answer]:
    given = compulsion if type(backend).__module__.startswith(OURS) else compulsion.read_only()
    with ForeignCode():
        said = backend(given)
    return (checked_answer(compulsion, said),)


def _factored_answer(
    compulsion: Compulsion, backend: Factored, make: Callable[..., KKTFactor]
) -> tuple[Answer, KKTFactor, Correction]:
    factor = make(compulsion)
    with ForeignCode():
        said = backend.solve_with(factor)
    answer, correction = checked_refinement(factor, said)
    return answer, factor, correction


def checked_answer(compulsion: Compulsion, said) -> Answer:
    """Answer of a backend as arrays of the shapes of the compulsion; multipliers of None are zero.

    BackendError if it is no answer, or holds other things than real numbers of these shapes.
    """
    if not isinstance(said, Answer):
        raise BackendError(f"failed: it returned {kind(said)}, expected a gauss.backends.Answer.")
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

    BackendError if it returns something else.
    """
    if not (isinstance(said, tuple) and len(said) == 2 and isinstance(said[1], tuple) and len(said[1]) == 4):
        raise BackendError(f"failed: it returned {kind(said)}, expected an Answer and a correction (a, qdd, λ, μ).")
    answer = checked_answer(factor.compulsion, said[0])
    sizes = answer.a.size, answer.qdd.size, answer.multipliers.size, factor.active.size
    a, qdd, multipliers, mu = (real_array("the correction", *given) for given in zip(said[1], sizes, strict=True))
    return answer, (a, qdd, multipliers, mu)
