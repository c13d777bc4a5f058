"""Event location on the dense output of a step: zeros of gap functions and other values, onset of a condition."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from gauss.simulation.brent import brent

SUBINTERVALS = 8  # subintervals of a step: the sign of the gap rate shows a gap that closes and opens again within one
GRAZING = 1e-11  # relative to the size of a gap: one whose minimum is negative by no more than this is not hit
TIME_TOLERANCE = 1e-15  # relative
HALVINGS = 33  # bisections of a step for a condition: to 1e-10 of its length


def first_hit(at: Callable[[float], np.ndarray], begin: float, end: float, gaps: np.ndarray) -> tuple[float, int] | None:
    """First time in (begin, end] at which an open gap closes, and its index; None if none does.

    Parameters
    ----------
    at : callable
        t → gap functions and their rates, (2, m), over their sizes.
    begin, end : float
        Step [s].
    gaps : ndarray of int
        Indices of the open gaps.
    """
    if not gaps.size:
        return None
    times = np.linspace(begin, end, SUBINTERVALS + 1)
    seen = np.array([at(t)[:, gaps] for t in times])  # (looks, 2, gaps)
    width, rate = seen[:, 0], seen[:, 1]
    suspect = ((width[1:] < 0.0) & (rate[1:] < 0.0)) | ((rate[:-1] < 0.0) & (rate[1:] > 0.0))
    which = np.flatnonzero(suspect.any(axis=0))
    hits = [(_hit(lambda t, i=gaps[k]: at(t)[:, i], times, width[:, k], rate[:, k]), gaps[k]) for k in which]
    return min(((t, int(i)) for t, i in hits if t is not None), default=None)


def _hit(at, times, width, rate) -> float | None:
    """First time at which one gap closes, given its samples."""
    for k in range(len(times) - 1):
        begin, end = times[k], times[k + 1]
        if width[k + 1] < 0.0 and rate[k + 1] < 0.0:
            if rate[k] > 0.0:  # it opened and closed again: a spurious root by rounding may precede the opening
                begin = _brent(lambda t: at(t)[1], begin, end)
            elif width[k] <= 0.0:  # it never opened
                return begin
            return _root(lambda t: at(t)[0], begin, end)
        if rate[k] < 0.0 < rate[k + 1]:
            lowest = _brent(lambda t: at(t)[1], begin, end)
            if at(lowest)[0] < -GRAZING and width[k] > 0.0:
                return _root(lambda t: at(t)[0], begin, lowest)
    return None


def _brent(function, begin: float, end: float) -> float:
    """Root of a function between two points of different sign, to rounding (Brent)."""
    return brent(function, begin, end, xtol=TIME_TOLERANCE * max(abs(begin), abs(end)), rtol=TIME_TOLERANCE)


def _root(width, begin: float, end: float) -> float:
    """Zero of a gap function that is negative at the end and not at the start."""
    return begin if width(begin) <= 0.0 else _brent(width, begin, end)


def first_negative(
    at: Callable[[float], np.ndarray], begin: float, end: float, rounding: Callable[[float], np.ndarray] | None = None
) -> tuple[float, int] | None:
    """First time in (begin, end] at which one of the values becomes negative, and its index; None if none does.

    Values above ``-rounding(t)`` are not negative.
    """
    times = np.linspace(begin, end, SUBINTERVALS + 1)
    for before, after in pairwise(times):
        negative = at(after) < (0.0 if rounding is None else -rounding(after))
        if negative.any():
            ended = np.flatnonzero(negative)
            return min((_root(lambda t, k=k: at(t)[k], before, after), int(k)) for k in ended)
    return None


def first_true(condition: Callable[[float], bool], begin: float, end: float) -> float:
    """Time from which a condition holds that is false at the start of a step and true at its end, by bisection."""
    for _ in range(HALVINGS):
        middle = 0.5 * (begin + end)
        if condition(middle):
            end = middle
        else:
            begin = middle
    return end
