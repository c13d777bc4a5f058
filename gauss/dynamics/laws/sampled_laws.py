"""Jumps of opaque laws of time: sampling, and bisection between samples that differ.

A law is evaluated at the initial state of the mechanism, so that all changes are those of time. Features shorter than the
sampling interval may be missed; ``breaks=`` gives such times.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from gauss.dynamics.laws.known_searches import KnownSearch
from gauss.dynamics.laws.recorded_time import KinematicsAtTime, reads_first, reads_time
from gauss.dynamics.laws.step_sampling import LawOfTime
from gauss.dynamics.laws.switching_times import EQUAL_TIMES, NO_TIMES, Timetable
from gauss.scene.stateful_laws import preserved

SAMPLES = 32_768  # of a law over a motion: resolves a millisecond in twenty seconds
LEAST_SAMPLES = 256  # of a short motion, and of a law that does not read the time: they show whether it remembers calls
LONGEST_GAP = 1.5  # between two samples, relative to their mean distance
MOST_JUMPS = 1000  # located jumps: a law with more of them is rough throughout
REPEATED_SAMPLES = 4  # taken again after all others: a function of time gives equal numbers
JUMP_RATIO = 8.0  # of a change between two samples to its neighbours, above which it is a jump
PARTS = 8  # cells of an interval in which a law changes, next to intervals in which it is constant


def sampled_times(
    law, motion, begin: float, end: float, what: str = "a law", uses_time: bool = False, known: KnownSearch | None = None
) -> Timetable:
    """Jumps of one law, and ends of the intervals in which it is constant; with the law itself unless it is constant.

    ``law``: of (t, motion). ``motion``: kinematics of the initial state; None for laws of rotors. ``what``: name of the law
    in warnings. ``uses_time``: whether the law is known to use the time: a constant value is then warned of. ``known``: last
    search of this law of loads, which is not repeated for the same law.
    """
    own, of_motion = (reads_first(law, begin, None), False) if motion is None else reads_time(law, motion)
    values = partial(_values, law, motion, of_motion)
    count = _count(motion, end - begin) if own or of_motion or uses_time else LEAST_SAMPLES
    search = partial(_located, values, begin, end, what, count, CONSTANT if uses_time else "")
    try:
        with preserved(law):
            if known is None:
                found = search()
            else:
                key = known.key(law, motion.state, begin, end, what, own, of_motion, uses_time)
                found = known.found(key, values, (begin, end), search)
        return (
            found
            if found.limitations or found is NO_TIMES
            else replace(found, laws=(partial(_values_or_none, law, motion, of_motion),))
        )
    except _NoValueError:  # the motion reports this failure by name
        return NO_TIMES


def law_of_time(law, motion) -> LawOfTime | None:
    """Opaque law as a function of time at the initial state; None if it does not read the time."""
    own, of_motion = reads_time(law, motion)
    return partial(_values_or_none, law, motion, of_motion) if own or of_motion else None


def _values(law, motion, of_motion: bool, times) -> np.ndarray:
    """Values (k, n) at times (k,)."""
    try:
        return _rows([law(t, KinematicsAtTime(motion, t) if of_motion else motion) for t in np.asarray(times).tolist()])
    except Exception as error:  # a law may fail in any way at other times
        raise _NoValueError from error


def _values_or_none(law, motion, of_motion: bool, times: np.ndarray) -> np.ndarray:
    """Values (k, n) at times (k,); not a number where the law has none."""
    try:
        with preserved(law), np.errstate(all="ignore"):  # it may have no value where the motion never comes
            return _values(law, motion, of_motion, times)
    except _NoValueError:
        return np.full((len(times), 1), np.nan)


def _rows(values: list) -> np.ndarray:
    """Values (k, n) of k results of a law: numbers, or arrays of any shapes with n entries."""
    try:
        return np.array(values, dtype=float).reshape(len(values), -1)
    except ValueError:  # their shapes differ
        return np.array([np.ravel(np.asarray(one, dtype=float)) for one in values])


def _count(motion, duration: float) -> int:
    """Number of samples: of a motion shorter than the time of the scene, as many as fall to it."""
    share = 1.0 if motion is None else min(1.0, duration / motion.system.scale.time)
    return max(LEAST_SAMPLES, int(SAMPLES * share))


CONSTANT = (
    "{} asks for the time, but has the same value at all of {} sampled times: pulses shorter than {:.2g} s may be missed; "
    "give breaks=[...] [s], or write it with gauss.math"
)


FORGETS = (
    "{} gives other values when it is called again at the same time: it keeps something from one call for the next, or is "
    "random, but methods call a law several times in a step, and again in steps that they refuse. Simulate a controller "
    "with a state from sample to sample, each time with state=motion.state(-1)"
)


class _NoValueError(Exception):
    """A law has no value at some time in the initial state."""


def _located(values_at, begin: float, end: float, what: str, count: int, constant: str) -> Timetable:
    """Jumps of a function of time, and ends of the intervals in which it is constant."""
    jitter = (0.6180339887498949 * np.arange(count)) % 1.0  # no period coincides with the samples
    times = begin + (end - begin) * np.concatenate([[0.0], (np.arange(count) + 0.5 + 0.5 * (jitter - 0.5)) / count, [1.0]])
    values = values_at(times)
    places = np.linspace(0, len(times) - 1, REPEATED_SAMPLES).astype(int)
    if not np.array_equal(values_at(times[places]), values[places], equal_nan=True):
        return Timetable(NO_TIMES.switches, NO_TIMES.mesh, (FORGETS.format(what),))
    change = np.abs(np.diff(values, axis=0)).max(axis=1)
    moves = change > 0.0
    if not moves.any():
        text = constant.format(what, times.size, (end - begin) / count * LONGEST_GAP)
        return Timetable(NO_TIMES.switches, NO_TIMES.mesh, (text,)) if constant else NO_TIMES
    beside = np.maximum(np.append(change[1:], 0.0), np.insert(change[:-1], 0, 0.0))
    jumps = np.flatnonzero(moves & ((change > JUMP_RATIO * beside) | _isolated(moves)))
    if len(jumps) > MOST_JUMPS:
        return Timetable(NO_TIMES.switches, NO_TIMES.mesh)
    close = EQUAL_TIMES * max(abs(begin), abs(end))
    switches = [_bisected(values_at, times[i], times[i + 1], values[i], values[i + 1], close) for i in jumps]
    inside = _cells(times, moves)
    return Timetable(np.unique(switches), inside[(inside > begin) & (inside < end)])


def _isolated(moves: np.ndarray) -> np.ndarray:
    """Cells in which a law changes, in runs of no more than two: one sample sees a pulse as two changes."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moves, [False]]).astype(int)))
    first, last = edges[::2], edges[1::2]
    found = np.zeros_like(moves)
    for begin, end in zip(first[last - first <= 2], last[last - first <= 2], strict=True):
        found[begin:end] = True
    return found


def _cells(times: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Ends of the cells of the intervals in which a law changes."""
    rests = np.concatenate([[True], ~moves, [True]])
    first, last = np.flatnonzero(rests[:-1] & ~rests[1:]), np.flatnonzero(~rests[:-1] & rests[1:])
    smooth = [(a, b) for a, b in zip(first, last, strict=True) if b - a > 1 and (a > 0 or b < len(moves))]
    mesh = [np.linspace(times[a], times[b], PARTS + 1) for a, b in smooth if len(smooth) <= MOST_JUMPS]
    return np.unique(np.concatenate([np.zeros(0), *mesh]))


def _bisected(values_at, low: float, high: float, below: np.ndarray, above: np.ndarray, close: float) -> float:
    """Time of the largest change of a value between two times, to the last digits."""
    while high - low > close:
        middle = 0.5 * (low + high)
        here = values_at([middle])[0]
        if np.abs(here - below).max() > np.abs(above - here).max():
            high, above = middle, here
        else:
            low, below = middle, here
    return 0.5 * (low + high)
