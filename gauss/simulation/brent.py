"""Root of a function between two points of different sign (Brent, *Algorithms for Minimization without Derivatives*, ch. 4).

Inverse quadratic interpolation, the secant, or bisection where these converge slowly; operation by operation that of
``scipy.optimize.brentq``, whose import takes longer than a motion.
"""

from collections.abc import Callable
from math import copysign, isnan

MOST_ITERATIONS = 100
NO_STEP = float("inf")  # of an interpolation without a result: bisection is taken


def brent(function: Callable[[float], float], begin: float, end: float, xtol: float, rtol: float) -> float:
    """Root of a continuous function between two points, within xtol + rtol |root|.

    ValueError if the signs there are equal, or a value is NaN.
    """

    def value(x: float) -> float:
        found = float(function(x))
        if isnan(found):
            raise ValueError(f"the function is NaN at {x!r}; a root cannot be found.")
        return found

    before, x = float(begin), float(end)
    f_before, f = value(before), value(x)
    if 0.0 in (f_before, f):
        return before if f_before == 0.0 else x
    if not _differ(f_before, f):
        raise ValueError(f"the function has one sign at {begin!r} and at {end!r}.")
    other = f_other = last = step = 0.0
    for _ in range(MOST_ITERATIONS):
        if _differ(f_before, f):
            other, f_other, last = before, f_before, x - before
            step = last
        if abs(f_other) < abs(f):
            before, x, other = x, other, x
            f_before, f, f_other = f, f_other, f
        least, half = (xtol + rtol * abs(x)) / 2.0, (other - x) / 2.0
        if f == 0.0 or abs(half) < least:
            return x
        interpolates = abs(last) > least and abs(f) < abs(f_before)
        tried = _interpolated((before, f_before), (x, f), (other, f_other)) if interpolates else NO_STEP
        last, step = (step, tried) if 2.0 * abs(tried) < min(abs(last), 3.0 * abs(half) - least) else (half, half)
        before, f_before = x, f
        x += max(copysign(least, half), step, key=abs)
        f = value(x)
    raise ValueError(f"no root was found within {MOST_ITERATIONS} iterations.")


def _differ(one: float, other: float) -> bool:
    """Whether two numbers have different signs."""
    return one < 0.0 < other or other < 0.0 < one


def _interpolated(before: tuple[float, float], now: tuple[float, float], other: tuple[float, float]) -> float:
    """Step to the root of the secant, or of the inverse quadratic through three points; :data:`NO_STEP` if it has none."""
    (x_before, f_before), (x, f), (x_other, f_other) = before, now, other
    try:
        if x_before == x_other:
            return -f * (x - x_before) / (f - f_before)
        slope, slope_other = (f_before - f) / (x_before - x), (f_other - f) / (x_other - x)
        return -f * (f_other * slope_other - f_before * slope) / (slope_other * slope * (f_other - f_before))
    except ZeroDivisionError:
        return NO_STEP
