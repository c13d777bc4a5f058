"""Discontinuities in time of opaque laws: sampling, then bisection.

A law is evaluated at the initial state, so that it varies with time alone. Features shorter than the sampling interval may
be missed; ``breaks=`` names their times.
"""

import numpy as np

from gauss.dynamics.timetable import CLOSE, NO_TIMES, Timetable

SAMPLES = 32_768  # of a law over a motion: 20 s are sampled finer than every millisecond
MOST_JUMPS = 1000  # that are located: a law with more is rough throughout
STEEP = 8.0  # ratio of a change between samples to its neighbours above which it is a jump
PARTS = 8  # least steps in an interval in which a law varies, between intervals in which it is constant


def sampled_times(law, motion, begin: float, end: float) -> Timetable:
    """Jumps of one law, and a mesh on the intervals in which it varies.

    Parameters
    ----------
    law : callable
        Function of (t, motion).
    motion : Motion
        Kinematics of the initial state.
    begin, end : float
        Interval of time [s].
    """

    def value(t: float) -> np.ndarray:
        try:
            return np.ravel(np.asarray(law(t, motion), dtype=float))
        except Exception as error:  # the user's code may fail in any way at another time
            raise _NoValueError from error

    try:
        return _located(value, begin, end)
    except _NoValueError:  # the motion reports the failure with the name of the load, should it occur there
        return NO_TIMES


class _NoValueError(Exception):
    """A law has no value at some time and the initial state."""


def _located(value, begin: float, end: float) -> Timetable:
    """Jumps of a function of time, and a mesh on the intervals in which it varies."""
    jitter = (0.6180339887498949 * np.arange(SAMPLES)) % 1.0  # against aliasing with periodic laws
    times = begin + (end - begin) * np.concatenate(
        [[0.0], (np.arange(SAMPLES) + 0.5 + 0.5 * (jitter - 0.5)) / SAMPLES, [1.0]]
    )
    found = [value(t) for t in times]
    if len({entry.size for entry in found}) > 1:
        raise _NoValueError
    values = np.array(found)
    change = np.abs(np.diff(values, axis=0)).max(axis=1)
    moves = change > 0.0
    if not moves.any():
        return NO_TIMES
    beside = np.maximum(np.append(change[1:], 0.0), np.insert(change[:-1], 0, 0.0))
    jumps = np.flatnonzero(moves & (change > STEEP * beside))
    if len(jumps) > MOST_JUMPS:
        return NO_TIMES
    close = CLOSE * max(abs(begin), abs(end))
    switches = [_bisected(value, *times[i : i + 2], *values[i : i + 2], close) for i in jumps]
    rests = np.concatenate([[True], ~moves, [True]])
    first, last = np.flatnonzero(rests[:-1] & ~rests[1:]), np.flatnonzero(~rests[:-1] & rests[1:])
    smooth = [(a, b) for a, b in zip(first, last, strict=True) if b - a > 1 and (a > 0 or b < len(moves))]
    mesh = [np.linspace(times[a], times[b], PARTS + 1) for a, b in smooth if len(smooth) <= MOST_JUMPS]
    inside = np.unique(np.concatenate([np.zeros(0), *mesh]))
    return Timetable(np.unique(switches), inside[(inside > begin) & (inside < end)])


def _bisected(value, low: float, high: float, below: np.ndarray, above: np.ndarray, close: float) -> float:
    """Time of the largest change between two times, to rounding."""
    while high - low > close:
        middle = 0.5 * (low + high)
        here = value(middle)
        if np.abs(here - below).max() > np.abs(above - here).max():
            high, above = middle, here
        else:
            low, below = middle, here
    return 0.5 * (low + high)
