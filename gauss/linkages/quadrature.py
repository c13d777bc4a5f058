"""Integrals (Gauss–Legendre) and zeros (bisection) of functions of the crank angle, all angles in one call."""

import numpy as np

POINTS = 10  # Gauss–Legendre points in a panel
PANEL = np.radians(4.0)  # widest panel; the forces of a linkage are smooth over it
SAMPLES = 1440  # crank angles of a turn in first searches: what is narrower than ¼° may be missed
BISECTIONS = 52


def cumulative(function, points: np.ndarray, breaks=()) -> np.ndarray:
    """Integral of a function from the first of the points to each of them, (k,).

    Parameters
    ----------
    function : callable
        Takes angles (n,) and returns values (n,).
    points : ndarray, shape (k,)
        Angles.
    breaks : array_like
        Angles where the function jumps: no panel reaches across.
    """
    low, high = points.min(), points.max()
    inside = [b for b in np.ravel(breaks) if low < b < high]
    coarse = np.unique(np.concatenate([points, inside]))
    counts = np.maximum(1, np.ceil(np.diff(coarse) / PANEL).astype(int))
    edges = np.concatenate(
        [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(coarse, coarse[1:], counts, strict=False)] + [coarse[-1:]]
    )
    x, w = np.polynomial.legendre.leggauss(POINTS)
    half = np.diff(edges)[:, None] / 2
    nodes = edges[:-1, None] + half * (1 + x)
    integrals = (function(nodes.ravel()).reshape(nodes.shape) * w * half).sum(axis=1) if half.size else np.zeros(0)
    total = np.concatenate([[0.0], np.cumsum(integrals)])
    at = total[np.searchsorted(edges, points)]
    return at - at[0]


def zeros(function, start: float, end: float) -> np.ndarray:
    """Angles between start and end at which a function changes its sign, to rounding, increasing."""
    low, high = min(start, end), max(start, end)
    angles = np.linspace(low, high, max(2, int(SAMPLES * (high - low) / (2 * np.pi)) + 1))
    negative = function(angles) < 0
    change = np.flatnonzero(negative[1:] != negative[:-1])
    a, b, sign = angles[change], angles[change + 1], negative[change]
    if not a.size:
        return a
    for _ in range(BISECTIONS):
        middle = (a + b) / 2
        same = (function(middle) < 0) == sign
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    return (a + b) / 2
