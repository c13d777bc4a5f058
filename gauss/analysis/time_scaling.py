"""Laws of time within limits: trapezoids, S-curves and splines as piecewise polynomials.

Rest to rest over a way of 1 with largest rate v, acceleration a and jerk j: phases T_a, T_v, T_a of a trapezoid, seven
phases T_j, T_a − 2 T_j, T_j, T_v, … of an S-curve (Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and
Robots, 2008, sec. 3.2 and 3.4). A spline through points is stretched in time until it touches its first limit (sec. 5.2).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.interpolate import PPoly
else:
    PPoly = object  # scipy.interpolate is imported where a law is made

DEGREE = 5  # of all pieces
REST_LENGTH = 1.0  # s, length of the pieces of rest before and after a motion


def phases(v: float, a: float, j: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
    """Durations (m,), and values (m,) of the acceleration, or of a finite jerk, of the shortest move from rest to rest.

    Parameters
    ----------
    v, a, j : float
        Largest rate [1/s], acceleration [1/s²] and jerk [1/s³]; rate and jerk may be infinite.
    """
    if np.isinf(j):
        ramp = v / a if v * v < a else np.sqrt(1.0 / a)
        durations, values = [ramp, max(1.0 / (a * ramp) - ramp, 0.0), ramp], [a, 0.0, -a]
    else:
        jerk, ramp, cruise = _s_curve(v, a, j)
        plain = max(ramp - 2.0 * jerk, 0.0)
        durations, values = [jerk, plain, jerk, cruise, jerk, plain, jerk], [j, 0.0, -j, 0.0, -j, 0.0, j]
    kept = np.array(durations) > 0.0
    return np.array(durations)[kept], np.array(values)[kept]


def _s_curve(v: float, a: float, j: float) -> tuple[float, float, float]:
    """Durations T_j, T_a, T_v of a way of 1."""
    if np.isfinite(v):
        jerk, ramp = (np.sqrt(v / j), 2.0 * np.sqrt(v / j)) if v * j < a * a else (a / j, a / j + v / a)
        if 1.0 / v >= ramp:
            return jerk, ramp, 1.0 / v - ramp
    if 2.0 * a**3 <= j * j:
        return a / j, a / j / 2.0 + np.sqrt((a / j / 2.0) ** 2 + 1.0 / a), 0.0
    jerk = (0.5 / j) ** (1.0 / 3.0)
    return jerk, 2.0 * jerk, 0.0


def along_lines(points: np.ndarray, limits: tuple[np.ndarray, ...], begin: float) -> PPoly:
    """Law along straight lines from point to point (k, n), at rest in each, in the least time.

    Parameters
    ----------
    points : ndarray, shape (k, n)
        Points.
    limits : tuple of ndarray, shape (n,)
        Largest rates, accelerations and, for S-curves, jerks.
    begin : float
        When it begins [s].
    """
    durations, pieces = list[float](), list[np.ndarray]()
    order = len(limits)
    for start, way in zip(points[:-1], np.diff(points, axis=0), strict=True):
        moving = way != 0.0
        if not moving.any():
            continue
        most = [float((limit[moving] / np.abs(way[moving])).min()) for limit in limits]
        state = np.zeros(order)  # s and its derivatives below the highest
        for duration, highest in zip(*phases(*most), strict=True):
            series = np.append(state, highest) / _factorials(order)
            c = np.zeros((DEGREE + 1, len(way)))
            c[DEGREE - order :] = series[::-1, None] * way
            c[DEGREE] += start
            durations.append(duration)
            pieces.append(c)
            state = np.array([_derivative(series, k, duration) for k in range(order)])
    return _joined(durations, pieces, points[0], points[-1], begin)


def _factorials(n: int) -> np.ndarray:
    return np.cumprod(np.maximum(np.arange(n + 1), 1)).astype(float)


def _derivative(series: np.ndarray, order: int, t: float) -> float:
    """Derivative of a power series, lowest power first."""
    return float(np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(series, order)))


def through_points(points: np.ndarray, degree: int, limits: tuple[np.ndarray, ...], begin: float) -> PPoly:
    """Spline of degree 3 or 5 through points (k, n), at rest at both ends, stretched to its limits.

    Times between points are proportional to the time that the largest rates, or else accelerations, need.
    """
    from scipy.interpolate import CubicSpline, make_interp_spline
    from scipy.interpolate import PPoly as Piecewise

    limit = next(limit for limit in limits if np.isfinite(limit).any())
    times = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(points, axis=0)) / limit).max(axis=1))])
    if degree == 3:
        law = CubicSpline(times, points, bc_type="clamped")
    else:
        at_rest = [(1, np.zeros(points.shape[1])), (2, np.zeros(points.shape[1]))]
        spline = make_interp_spline(times, points, k=5, bc_type=(at_rest, at_rest))
        series = [spline(times[:-1], nu=k) / factor for k, factor in enumerate(_factorials(5))]
        law = Piecewise(np.array(series[::-1]), times)
    return rested([stretched(law, stretch(law, limits))], begin)


def stretch(law: PPoly, limits: tuple[np.ndarray, ...]) -> float:
    """Factor of all times that brings the derivatives of a law to the first of their limits (n,)."""
    shares = [(largest(law.derivative(k + 1)) / limit).max() ** (1.0 / (k + 1)) for k, limit in enumerate(limits)]
    return float(max(shares))


def stretched(law: PPoly, factor: float) -> PPoly:
    """Law that takes longer by a factor."""
    from scipy.interpolate import PPoly as Piecewise

    powers = np.arange(law.c.shape[0])[::-1]
    return Piecewise(law.c / factor ** powers[:, None, None], law.x * factor)


def largest(law: PPoly) -> np.ndarray:
    """Largest absolute value (n,) of each entry of a law."""
    return np.abs(extremes(law)).max(axis=0)


def extremes(law: PPoly) -> np.ndarray:
    """Lowest and highest values (2, n) of each entry of a law."""
    found = []
    for k in range(law.c.shape[2]):
        values = []
        for c, length in zip(law.c[:, :, k].T, np.diff(law.x), strict=True):
            roots = np.roots(np.polyder(c)) if c[:-1].any() else np.zeros(0)
            inside = roots.real[(np.abs(roots.imag) <= 1e-9 * length) & (roots.real > 0.0) & (roots.real < length)]
            values.append(np.polyval(c, np.concatenate([[0.0, length], inside])))
        found.append(np.concatenate(values))
    return np.array([[entry.min() for entry in found], [entry.max() for entry in found]])


def rested(laws: Sequence[PPoly], begin: float) -> PPoly:
    """Laws one after the other from a time on, at rest before and after."""
    durations, pieces = list[float](), list[np.ndarray]()
    for law in laws:
        padded = np.zeros((law.c.shape[1], DEGREE + 1, law.c.shape[2]))
        padded[:, DEGREE + 1 - law.c.shape[0] :] = law.c.transpose(1, 0, 2)
        durations.extend(np.diff(law.x))
        pieces.extend(padded)
    return _joined(durations, pieces, laws[0](laws[0].x[0]), laws[-1](laws[-1].x[-1]), begin)


def _joined(durations: list, pieces: list, first: np.ndarray, last: np.ndarray, begin: float) -> PPoly:
    """Piecewise polynomial of pieces (DEGREE + 1, n), between pieces of rest."""
    from scipy.interpolate import PPoly as Piecewise

    before, after = np.zeros((2, DEGREE + 1, len(first)))
    before[DEGREE], after[DEGREE] = first, last
    times = begin + np.concatenate([[-REST_LENGTH], np.cumsum([0.0, *durations])])
    return Piecewise(np.array([before, *pieces, after]).transpose(1, 0, 2), np.append(times, times[-1] + REST_LENGTH))
