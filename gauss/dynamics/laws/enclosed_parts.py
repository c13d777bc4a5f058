"""Enclosures of coordinates and rates on the subintervals of a step, cubic Hermite polynomials of their ends.

The hull of the Bernstein coefficients of a polynomial encloses it (Farouki, Computer Aided Geometric Design 29 (2012) 379).
"""

from functools import reduce

import numpy as np

from gauss.dynamics.laws.intervals import Interval
from gauss.system import State, System, coordinate_rates

PARTS = 8  # subintervals of a step


def enclosed_parts(
    system: System, begin: State, first: np.ndarray, end: State, last: np.ndarray, count: int = PARTS
) -> tuple[list[np.ndarray], list[list[Interval]]]:
    """Values of (t, q, v) at the ends of the subintervals of a step, and enclosures of (t, q, v, q̈) on each.

    Parameters
    ----------
    system : System
        The system.
    begin, end : State
        Ends of the step, numbers or expressions.
    first, last : ndarray, shape (n_v,)
        Accelerations there.
    count : int
        Number of subintervals.
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
