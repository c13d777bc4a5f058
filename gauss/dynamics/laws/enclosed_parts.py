"""Enclosures of coordinates and rates on the subintervals of a step, cubic Hermite polynomials of their ends.

Enclosures of functions there tell bounds, peaks between the ends, changes of sign.
The hull of the Bernstein coefficients of a polynomial encloses it (Farouki, Computer Aided Geometric Design 29 (2012) 379).
"""

from functools import reduce

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.laws.intervals import Interval
from gauss.dynamics.laws.levels import Levels
from gauss.system import State, System, coordinate_rates

PARTS = 8  # subintervals of a step
STEEP, NEGLIGIBLE = 2.5, -50.0  # rise of an exponent within a subinterval, and the exponent of a negligible value


def enclosed_parts(
    system: System, begin: State, first: np.ndarray, end: State, last: np.ndarray, count: int = PARTS
) -> tuple[list[np.ndarray], list[list[Interval]]]:
    """Values of (t, q, v) at the ends of the subintervals of a step, and enclosures of (t, q, v, q̈) on each.

    ``begin``, ``end``: ends of the step, numbers or expressions. ``first``, ``last`` (n_v,): accelerations there.
    """
    h = end.t - begin.t
    value = [np.concatenate([[s.t], s.q, s.v]) for s in (begin, end)]
    slope = [np.concatenate([[1.0], coordinate_rates(system, s.q, s.v), a]) for s, a in ((begin, first), (end, last))]
    change = value[1] - value[0]
    nodes, slopes, tau = [], [], h / count
    for s in np.arange(count + 1) / count:  # Hermite's polynomial and its derivative
        bump = s * (1.0 - s)
        nodes.append(value[0] + s * s * (3.0 - 2.0 * s) * change + h * bump * ((1.0 - s) * slope[0] - s * slope[1]))
        inner = (1.0 - s) * (1.0 - 3.0 * s) * slope[0] - s * (2.0 - 3.0 * s) * slope[1]
        slopes.append(6.0 * bump * change / h + inner)
    size, n = 1 + system.n_q + system.n_v, system.n_v
    nodes[-1] = value[1]
    parts = []
    for j in range(count):
        points = [nodes[j], nodes[j] + tau / 3.0 * slopes[j], nodes[j + 1] - tau / 3.0 * slopes[j + 1], nodes[j + 1]]
        part = [_hull([point[k] for point in points]) for k in range(size)]
        between = [3.0 * (points[i + 1] - points[i]) / tau for i in range(3)]  # Bernstein coefficients of the derivative
        part += [_hull([point[size - n + k] for point in between]) for k in range(n)]
        parts.append(part)
    return nodes, parts


def _hull(values) -> Interval:
    return reduce(Interval.hull, map(Interval.point, values))


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


def sign_changes(value: Interval, before: Scalar, after: Scalar, noise: Scalar | Levels) -> tuple[Scalar, Scalar]:
    """Number of changes between the ends of a subinterval, and whether the enclosure straddles a switching value.

    In place of ``noise``, the round-off of a sign, levels have many such values.
    """
    if isinstance(noise, Levels):
        changes = math.minimum(math.abs(noise.at(after) - noise.at(before)), 2.0)
        return changes, math.where(noise.at(value.low) < noise.at(value.high), 1.0, 0.0)
    changes = math.where(before < 0.0, math.where(after < 0.0, 0.0, 1.0), math.where(after < 0.0, 1.0, 0.0))
    return changes, math.where(value.low < -noise, math.where(value.high > noise, 1.0, 0.0), 0.0)


def _most(value: Interval) -> Scalar:
    return math.maximum(largest_size(value), largest_size(-value))


def largest_size(value: Interval) -> Scalar:
    """Bound of the size of a value from above."""
    return math.maximum(math.maximum(value.high, -value.low), 0.0)
