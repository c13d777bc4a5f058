"""When within a step a gap closes, or a condition first holds: on the dense output of the step."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

LOOKS = 8  # into each step: a gap that closes and opens again between two of them is seen by the sign of its rate
GRAZING = 1e-11  # of its size: a gap that is least by no more than this below zero is not hit
ROUNDING = 1e-15  # of a time
HALVINGS = 33  # of a step, to find when a condition first holds: 1e-10 of its length


def first_hit(at: Callable[[float], np.ndarray], begin: float, end: float, gaps: np.ndarray) -> tuple[float, int] | None:
    """First time in (begin, end] when one of some open gaps closes, and its number; None if none does.

    Parameters
    ----------
    at : callable
        ``at(t)`` returns widths and rates of all gaps, (2, m), over their sizes.
    begin, end : float
        The step [s].
    gaps : ndarray of int
        Numbers of the gaps that are open.
    """
    if not gaps.size:
        return None
    times = np.linspace(begin, end, LOOKS + 1)
    seen = np.array([at(t)[:, gaps] for t in times])  # (looks, 2, gaps)
    width, rate = seen[:, 0], seen[:, 1]
    suspect = ((width[1:] < 0.0) & (rate[1:] < 0.0)) | ((rate[:-1] < 0.0) & (rate[1:] > 0.0))
    which = np.flatnonzero(suspect.any(axis=0))
    hits = [(_hit(lambda t, i=gaps[k]: at(t)[:, i], times, width[:, k], rate[:, k]), gaps[k]) for k in which]
    return min(((t, int(i)) for t, i in hits if t is not None), default=None)


def _hit(at, times, width, rate) -> float | None:
    """First time when one gap closes, given what was seen of it."""
    for k in range(len(times) - 1):
        begin, end = times[k], times[k + 1]
        if width[k + 1] < 0.0 and rate[k + 1] < 0.0:
            if rate[k] > 0.0:  # it opened and closed again since: rounding may leave another root where it began to open
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
    """Root of a function between two places of different sign, to the last digits."""
    from scipy.optimize import brentq  # takes long to import: only who has contacts waits for it

    return brentq(function, begin, end, xtol=ROUNDING * max(abs(begin), abs(end)), rtol=ROUNDING)


def _root(width, begin: float, end: float) -> float:
    """Time when a width that is not negative at the begin and negative at the end is zero."""
    return begin if width(begin) <= 0.0 else _brent(width, begin, end)


def first_negative(
    at: Callable[[float], np.ndarray], begin: float, end: float, rounding: Callable[[float], np.ndarray] | None = None
) -> tuple[float, int] | None:
    """First time in (begin, end] when one of some values becomes negative, and its number; None if none does.

    Values that are no further below zero than ``rounding`` says are not negative.
    """
    times = np.linspace(begin, end, LOOKS + 1)
    for before, after in pairwise(times):
        negative = at(after) < (0.0 if rounding is None else -rounding(after))
        if negative.any():
            ended = np.flatnonzero(negative)
            return min((_root(lambda t, k=k: at(t)[k], before, after), int(k)) for k in ended)
    return None


def first_true(condition: Callable[[float], bool], begin: float, end: float) -> float:
    """Time from which a condition holds that does not at the begin of a step and does at its end."""
    for _ in range(HALVINGS):
        middle = 0.5 * (begin + end)
        if condition(middle):
            end = middle
        else:
            begin = middle
    return end
