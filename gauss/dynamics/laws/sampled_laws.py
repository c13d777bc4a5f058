"""Jumps of laws that cannot be traced, from samples in time: between two that differ the jump is bisected.

A law is evaluated with the mechanism as it stands at the start, so that all changes are those of time. What lasts less than
the time between two samples may be missed; ``breaks=`` names such times.
"""

import numpy as np

from gauss.dynamics.laws.stateful_laws import preserved
from gauss.dynamics.laws.switching_times import CLOSE, NO_TIMES, Timetable

SAMPLES = 32_768  # of a law over a motion: what lasts a thousandth of a second in twenty is seen
MOST_JUMPS = 1000  # that are located: a law that jumps at more of its samples is rough throughout
AGAIN = 4  # samples that are taken a second time, after all others: a function of time gives the very same numbers
STEEP = 8.0  # times the changes beside it, a change between two samples is taken for a jump
PARTS = 8  # into which steps divide a stretch of time in which a law changes, beside stretches in which it does not


def sampled_times(law, motion, begin: float, end: float, what: str = "a law") -> Timetable:
    """Jumps of one law, and ends of the stretches in which it is constant.

    Parameters
    ----------
    law : callable
        Of (t, motion).
    motion : Kinematics
        The mechanism at the start.
    begin, end : float
        What stretch of time is asked about [s].
    what : str
        How a warning calls the law.
    """

    def value(t: float) -> np.ndarray:
        try:
            return np.ravel(np.asarray(law(t, motion), dtype=float))
        except Exception as error:  # a law may fail in any way, and need not take the start at other times
            raise _NoValueError from error

    try:
        with preserved(law):
            return _located(value, begin, end, what)
    except _NoValueError:  # where the motion meets this, it says so by name
        return NO_TIMES


FORGETS = (
    "{} gives other values when it is called again at the same time: it keeps something from one call for the next, or is "
    "random, but methods call a law several times in a step, and again in steps that they refuse. Simulate a controller "
    "with a state from sample to sample, each time with state=motion.state(-1)"
)


class _NoValueError(Exception):
    """A law has no value at some time, with the mechanism as it stands at the start."""


def _located(value, begin: float, end: float, what: str) -> Timetable:
    """Jumps of a function of time, and ends of the stretches in which it is constant."""
    jitter = (0.6180339887498949 * np.arange(SAMPLES)) % 1.0  # so that no period falls upon the samples
    times = begin + (end - begin) * np.concatenate(
        [[0.0], (np.arange(SAMPLES) + 0.5 + 0.5 * (jitter - 0.5)) / SAMPLES, [1.0]]
    )
    found = [value(t) for t in times]
    if len({entry.size for entry in found}) > 1:
        raise _NoValueError
    values = np.array(found)
    places = np.linspace(0, len(times) - 1, AGAIN).astype(int)
    if not np.array_equal([value(times[place]) for place in places], values[places], equal_nan=True):
        return Timetable(NO_TIMES.switches, NO_TIMES.mesh, (FORGETS.format(what),))
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
    """Where between two times a value changes most, to the last digits."""
    while high - low > close:
        middle = 0.5 * (low + high)
        here = value(middle)
        if np.abs(here - below).max() > np.abs(above - here).max():
            high, above = middle, here
        else:
            low, below = middle, here
    return 0.5 * (low + high)
