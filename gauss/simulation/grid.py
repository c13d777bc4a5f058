"""Time grid of a fixed-step method."""

import numpy as np

from gauss.codegen.kernels import Due
from gauss.dynamics.laws.switching_functions import Switching
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.integrators import FixedStep

SAME = 1e-9  # of a step: closer times are one
SHORT = 1e-3  # of a step: steps over contacts are no shorter, for rounding of a gap over the length of a step is a velocity


def grid(begin: float, end: float, step: float, samples, switching: Timetable = NO_TIMES) -> np.ndarray:
    """Pairs (time to step to, what is :class:`gauss.codegen.kernels.Due` there), in order.

    Parameters
    ----------
    begin, end, step : float
        Interval and step [s]; the last step is shortened to meet the end.
    samples : ndarray or None
        Times to return [s]; the end of every step when None.
    switching : Timetable
        Switching times, just before and just after which a step ends.
    """
    pairs = _even(begin, end, step, samples)
    if not switching.switches.size:
        return pairs
    stops = [t for stop in switching.stops(begin, end) if stop[0] < stop[1] for t in stop]
    divided = np.column_stack([stops, np.full(len(stops), float(Due.STEP))])
    pairs = np.concatenate([pairs, divided])
    return pairs[np.argsort(pairs[:, 0], kind="stable")]


def grid_of(method: FixedStep, begin: float, end: float, step: float, samples, switching: Switching) -> np.ndarray:
    """Pairs of a method, as of :func:`grid`."""
    if method.nonsmooth:
        return contact_grid(begin, end, step, samples, switching)
    return grid(begin, end, step, samples, switching.times)


def contact_grid(begin: float, end: float, step: float, samples, switching: Switching) -> np.ndarray:
    """The same of time stepping, which evaluates loads at the begin of a step or in its middle.

    A step therefore ends just after a switching time: the nearest time of the grid is moved there, or a time is added if
    something is due at that one. Only prescribed velocities that jump are passed as by other methods.
    """
    pairs = _even(begin, end, step, samples)
    stops = [stop for stop in switching.times.stops(begin, end) if stop[0] < stop[1]]
    if not stops:
        return pairs
    crossed = [t for stop in stops if switching.jumps.within(*stop) for t in stop]
    movable = np.full(len(pairs), samples is None) | (pairs[:, 1] == Due.STEP)
    movable[-1] = False
    for _, after in (stop for stop in stops if not switching.jumps.within(*stop)):
        k = int(np.argmin(np.abs(pairs[:, 0] - after)))
        if movable[k]:
            pairs[k, 0], movable[k] = after, False
        elif abs(pairs[k, 0] - after) > SHORT * step and after - begin > SHORT * step:
            k = int(np.searchsorted(pairs[:, 0], after))
            pairs, movable = np.insert(pairs, k, (after, Due.STEP), axis=0), np.insert(movable, k, False)
    added = np.column_stack([crossed, np.full(len(crossed), float(Due.STEP))]) if crossed else pairs[:0]
    pairs = np.concatenate([pairs, added])
    return pairs[np.argsort(pairs[:, 0], kind="stable")]


def _even(begin: float, end: float, step: float, samples) -> np.ndarray:
    """Pairs of an equidistant grid."""
    count = max(1, int(np.ceil((end - begin) / step * (1 - SAME))))
    times = np.append(begin + step * np.arange(1, count), end)
    if samples is None:
        return np.column_stack([times, np.full(count, float(Due.SAMPLE))])
    samples = samples[samples > begin]
    after = np.minimum(np.searchsorted(times, samples), count - 1)  # the last step may be shorter than the others
    before = np.maximum(after - 1, 0)
    nearest = np.where(samples - times[before] < times[after] - samples, before, after)
    met = np.abs(times[nearest] - samples) <= SAME * step
    times[nearest[met]] = samples[met]
    due = np.full(count, float(Due.STEP))
    due[nearest[met]] = Due.SAMPLE
    aside = samples[~met]
    if not aside.size:
        return np.column_stack([times, due])
    pairs = np.concatenate(
        [np.column_stack([times, due]), np.column_stack([aside, np.full(aside.size, float(Due.OFF_GRID_SAMPLE))])]
    )
    return pairs[np.argsort(pairs[:, 0], kind="stable")]
