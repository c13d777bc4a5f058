"""Opaque laws between evaluations: the defect y' − f(t, y) of the dense output is sampled and compared with the tolerance.

The defect of an accepted step is small wherever the equations of motion are smooth (Enright, *A new error-control for
initial value solvers*, Appl. Math. Comput. 31, 1989): a large one shows that an opaque law has switched within the step.
"""

from collections.abc import Callable

import numpy as np

from gauss.integrators import Rates
from gauss.system import State

PLACES = (0.187, 0.431, 0.569, 0.813)  # of the samples, relative to the step
INCREMENT = 1e-4  # of the differences for y', relative to the step
LARGEST_DEFECT = 1e5  # over the tolerance
REJECTED_SHARE = 0.5  # of a step with a larger defect that is tried next
RESOLVED_STEP = 1e-6  # relative to the duration: the defect of shorter steps is not sampled
SPARSE_STEP = 0.01  # relative to the duration: longer steps with opaque laws may miss short features


def defect_is_large(
    evaluate: Callable[[State], Rates],
    dense: Callable[[float], tuple[State, np.ndarray]],
    begin: float,
    h: float,
    allowed: np.ndarray,
) -> bool:
    """Whether the defect of v' at a place in a step exceeds :data:`LARGEST_DEFECT` times the tolerance.

    Parameters
    ----------
    evaluate : callable
        Rates of a state.
    dense : callable
        Dense output of the step: t → (state, work).
    begin, h : float
        Begin and length of the step [s].
    allowed : ndarray, shape (n_v,)
        Tolerance of the rates.
    """
    for place in PLACES:
        before, at, after = (dense(begin + (place + shift) * h)[0] for shift in (-INCREMENT, 0.0, INCREMENT))
        defect = (after.v - before.v) / (after.t - before.t) - evaluate(at).acceleration
        if (h * np.abs(defect) > LARGEST_DEFECT * allowed).any():
            return True
    return False
