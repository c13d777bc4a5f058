"""Error that a kink of a law may leave in a step: an error estimate of high order may be almost zero there by chance.

The estimate of a pair is a weighted sum of slopes. For an acceleration with a kink at the share s of a step it is a
piecewise linear function of s that changes its sign, and for some s it is far below the error. The residual of the
trapezoidal rule, v₁ − v₀ − h (a₀ + a₁) / 2, has no such zero: it is h² [ȧ] s (1 − s) / 2, and about h³ ä / 12 for smooth
accelerations.
"""

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.laws.enclosed_parts import PARTS
from gauss.integrators import Point, Tolerance, next_factor

# largest error of a step over the residual of the trapezoidal rule, for kinks at all places: DOP853 0.74, dopri5 0.28,
# Radau IIA 0.22
KINK_SHARE = 0.75
KINK_ORDER = 2  # of that residual
UNCROSSED = 0.5 / PARTS  # from the middle of the subinterval of a crossing to its beginning


def kink_error(begin: Point, end: Point, tolerance: Tolerance) -> Scalar:
    """Largest error of rates over the tolerance, if the step has a kink; root mean square, as the estimate of a pair.

    ``begin``, ``end``: ends of the step, numbers or expressions.
    """
    v, h = (begin.state.v, end.state.v), end.state.t - begin.state.t
    residual = v[1] - v[0] - 0.5 * h * (begin.rates.acceleration + end.rates.acceleration)
    shares = np.ones(v[0].size) if tolerance.shares is None else tolerance.shares[1]
    allowed = tolerance.of_rates(math.maximum(np.abs(v[0]), np.abs(v[1])), shares)
    return KINK_SHARE * math.sqrt(np.sum((residual / allowed) ** 2) / (2 * v[0].size))


def kink_factor(error: Scalar, crossing: Scalar) -> Scalar:
    """Factor of a rejected step with a kink: the next ends before the crossing, or is short enough to cross it.

    ``error``: :func:`kink_error`, above 1. ``crossing``: middle of the subinterval of the first crossing, relative to the
    step.
    """
    return math.maximum(crossing - UNCROSSED, next_factor(error, KINK_ORDER))
