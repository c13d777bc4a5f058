"""Time grid of a fixed-step method."""

import numpy as np

from gauss.dynamics.timetable import NO_TIMES, Timetable
from gauss.kernels import Due

SAME = 1e-9  # of a step: closer times are one


def grid(begin: float, end: float, step: float, samples, switching: Timetable = NO_TIMES) -> np.ndarray:
    """Pairs (time to step to, what is :class:`gauss.kernels.Due` there), in order.

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


def _even(begin: float, end: float, step: float, samples) -> np.ndarray:
    """Pairs of an equidistant grid."""
    count = max(1, int(np.ceil((end - begin) / step * (1 - SAME))))
    times = np.append(begin + step * np.arange(1, count), end)
    if samples is None:
        return np.column_stack([times, np.full(count, float(Due.KEPT))])
    samples = samples[samples > begin]
    after = np.minimum(np.searchsorted(times, samples), count - 1)  # the last step may be shorter than the others
    before = np.maximum(after - 1, 0)
    nearest = np.where(samples - times[before] < times[after] - samples, before, after)
    met = np.abs(times[nearest] - samples) <= SAME * step
    times[nearest[met]] = samples[met]
    due = np.full(count, float(Due.STEP))
    due[nearest[met]] = Due.KEPT
    aside = samples[~met]
    if not aside.size:
        return np.column_stack([times, due])
    pairs = np.concatenate([np.column_stack([times, due]), np.column_stack([aside, np.full(aside.size, float(Due.ASIDE))])])
    return pairs[np.argsort(pairs[:, 0], kind="stable")]
