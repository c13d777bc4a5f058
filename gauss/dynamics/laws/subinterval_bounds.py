"""What enclosures of functions on a subinterval of a step tell: bounds, peaks between its ends, changes of sign."""

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.laws.intervals import Interval

STEEP, NEGLIGIBLE = 2.5, -50.0  # rise of an exponent within a subinterval, and the exponent of a negligible value


def upper_bounds(values: list[Interval], rates: list[Interval], ends: tuple[list, list], tau: Scalar) -> list[Scalar]:
    """Upper bounds of functions on a subinterval, by the enclosures of their values and, if there are any, their rates."""
    if not rates:
        return [value.high for value in values]
    each = zip(values, rates, *ends, strict=True)
    return [math.minimum(value.high, 0.5 * (x + y) + 0.5 * tau * _most(rate)) for value, rate, x, y in each]


def hidden_peaks(ends, tops: list[Scalar], highest: list[Scalar], hidden: Scalar, middle: float) -> Scalar:
    """Share of a step before its first hidden peak of an exponent, ``hidden`` or the middle of this subinterval."""
    for before, after, high, top in zip(*ends, tops, highest, strict=True):
        steep = math.where(high > math.minimum(before, after) + STEEP, 1.0, 0.0)
        counted = math.where(high > math.maximum(top - STEEP, NEGLIGIBLE), steep, 0.0)
        hidden = math.where(counted > 0.0, math.minimum(hidden, middle), hidden)
    return hidden


def may_turn(rate: Interval | None) -> Scalar:
    """1 where a function may turn, as its rate is not of one sign, or unknown."""
    return 1.0 if rate is None else math.where(rate.low > 0.0, 0.0, math.where(rate.high < 0.0, 0.0, 1.0))


def sign_changes(value: Interval, before: Scalar, after: Scalar, noise: Scalar | None) -> tuple[Scalar, Scalar]:
    """Number of changes between the ends of a subinterval, and whether the enclosure straddles a switching value.

    Without ``noise``, the round-off of a sign, every whole number is one.
    """
    if noise is None:
        level = math.floor(before)
        return math.minimum(math.abs(math.floor(after) - level), 2.0), math.where(
            math.floor(value.low) < math.floor(value.high), 1.0, 0.0
        )
    changes = math.where(before < 0.0, math.where(after < 0.0, 0.0, 1.0), math.where(after < 0.0, 1.0, 0.0))
    return changes, math.where(value.low < -noise, math.where(value.high > noise, 1.0, 0.0), 0.0)


def _most(value: Interval) -> Scalar:
    return math.maximum(largest_size(value), largest_size(-value))


def largest_size(value: Interval) -> Scalar:
    """Bound of the size of a value from above."""
    return math.maximum(math.maximum(value.high, -value.low), 0.0)
