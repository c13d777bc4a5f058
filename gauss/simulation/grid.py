"""Ends of fixed steps: the time grid of a motion, and those of one call of a stepping object."""

import numpy as np

from gauss.codegen.kernels import Due
from gauss.dynamics.laws.switching import Switching
from gauss.dynamics.laws.switching_times import APART, NO_TIMES, Timetable
from gauss.integrators import FixedStep
from gauss.simulation.memory_limit import SHORTER, refuse_beyond_memory

EQUAL_TIMES = 1e-9  # relative to the step: closer times are one
STEP_NUMBERS = 4  # in memory for each step of a motion
CALL_NUMBERS = 6  # the same of a call of a stepping object
FEW_STEPS = 16  # of a call: so many times are written one by one in less time than as arrays
SHORTEST_CONTACT_STEP = 1e-3  # relative to the step: the rounding of a gap over the step is a velocity error


def grid(begin: float, end: float, step: float, samples, switching: Timetable = NO_TIMES) -> np.ndarray:
    """Pairs (end of a step [s], :class:`gauss.codegen.kernels.Due` there), in order.

    The last step is shortened to meet the end. ``samples`` are times to return [s]; the end of every step when None. A step
    ends just before and just after each switching time.
    """
    pairs = _even(begin, end, step, samples)
    if not switching.switches.size:
        return pairs
    stops = [t for stop in switching.stops(begin, end) if stop[0] < stop[1] for t in stop]
    divided = np.column_stack([stops, np.full(len(stops), float(Due.STEP))])
    pairs = np.concatenate([pairs, divided])
    return pairs[np.argsort(pairs[:, 0], kind="stable")]


def grid_of(method: FixedStep, begin: float, end: float, step: float, samples, switching: Switching) -> np.ndarray:
    """Pairs of a method, as by :func:`grid`."""
    if method.nonsmooth:
        return contact_grid(begin, end, step, samples, switching)
    return grid(begin, end, step, samples, switching.times)


def contact_grid(begin: float, end: float, step: float, samples, switching: Switching) -> np.ndarray:
    """Pairs of Moreau–Jean time stepping, which evaluates loads at the start of a step or in its middle.

    A step therefore ends just after a switching time: the nearest time of the grid is moved there, or a time is added where
    that one is a sample; a step that is longer by that is halved. At jumps of prescribed velocities steps end before and
    after, as with other methods.
    """
    pairs = _even(begin, end, step, samples)
    stops = [stop for stop in switching.times.stops(begin, end) if stop[0] < stop[1]]
    if not stops:
        return pairs
    jumps = [t for stop in stops if switching.jumps.within(*stop) for t in stop]
    afters = [after for before, after in stops if not switching.jumps.within(before, after)]
    pairs = _with_ends(pairs, np.full(len(pairs), samples is None) | (pairs[:, 1] == Due.STEP), afters, begin, step)
    ends = pairs[pairs[:, 1] != Due.OFF_GRID_SAMPLE, 0]
    lengths = np.diff(ends, prepend=begin)
    longer = lengths > step * (1.0 + EQUAL_TIMES)
    added = np.concatenate([jumps, ends[longer] - 0.5 * lengths[longer]])
    pairs = np.concatenate([pairs, np.column_stack([added, np.full(added.size, float(Due.STEP))])])
    return pairs[np.argsort(pairs[:, 0], kind="stable")]


def _with_ends(pairs: np.ndarray, movable: np.ndarray, afters: list[float], begin: float, step: float) -> np.ndarray:
    """Pairs with ends of steps just after switching times: movable ones are moved there, else new ones are inserted."""
    movable[-1] = False
    for after in afters:
        k = int(np.argmin(np.abs(pairs[:, 0] - after)))
        if movable[k]:
            pairs[k, 0], movable[k] = after, False
        elif abs(pairs[k, 0] - after) > SHORTEST_CONTACT_STEP * step and after - begin > SHORTEST_CONTACT_STEP * step:
            k = int(np.searchsorted(pairs[:, 0], after))
            pairs, movable = np.insert(pairs, k, (after, Due.STEP), axis=0), np.insert(movable, k, False)
    return pairs


def with_samples(pairs: np.ndarray, times: np.ndarray, step: float, rows: bool) -> tuple[np.ndarray, dict[int, int]]:
    """Pairs (n, 2) with steps that end at samples of a control law, too; and number of pairs before a sample → its number.

    ``times`` (k,) are the samples after the start [s], ascending, numbered from 1; a step that nearly ends at one serves it.
    ``rows``: whether every end of a step is a row of the trajectory.
    """
    equal = np.maximum(EQUAL_TIMES * step, 4.0 * APART * np.abs(times))
    ends = pairs[pairs[:, 1] != Due.OFF_GRID_SAMPLE, 0]
    near = np.abs(ends[np.minimum(np.searchsorted(ends, times - equal), ends.size - 1)] - times) <= equal
    due = Due.SAMPLE if rows else Due.STEP
    pairs = np.concatenate([pairs, np.column_stack([times[~near], np.full((~near).sum(), float(due))])])
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    begins = np.searchsorted(pairs[:, 0], times + equal, side="right")
    return pairs, {int(place): k for k, place in enumerate(begins, start=1)}


def _even(begin: float, end: float, step: float, samples) -> np.ndarray:
    """Pairs of an equidistant grid; SimulationError if they do not fit into memory."""
    steps = (end - begin) / step
    refuse_beyond_memory(STEP_NUMBERS * steps, f"step: {steps:.3g} steps of {step:.3g} s over {end - begin:.3g} s", SHORTER)
    count = max(1, int(np.ceil((end - begin) / step * (1 - EQUAL_TIMES))))
    pairs = np.empty((count, 2))  # in place: a long motion waits for it
    times = pairs[:, 0]
    np.multiply(step, np.arange(1, count), out=times[:-1])
    times[:-1] += begin
    times[-1] = end
    if samples is None:
        pairs[:, 1] = Due.SAMPLE
        return pairs
    samples = samples[samples > begin]
    after = np.minimum(np.searchsorted(times, samples), count - 1)  # the last step may be shorter than the others
    before = np.maximum(after - 1, 0)
    nearest = np.where(samples - times[before] < times[after] - samples, before, after)
    met = np.abs(times[nearest] - samples) <= EQUAL_TIMES * step
    times[nearest[met]] = samples[met]
    pairs[:, 1] = Due.STEP
    pairs[nearest[met], 1] = Due.SAMPLE
    off_grid = samples[~met]
    if not off_grid.size:
        return pairs
    pairs = np.concatenate([pairs, np.column_stack([off_grid, np.full(off_grid.size, float(Due.OFF_GRID_SAMPLE))])])
    return pairs[np.argsort(pairs[:, 0], kind="stable")]


class StepEnds:
    """Ends of the steps of one call, of one length [s], in an array that machine code reads.

    ``grid`` (room, 2): times [s], and :attr:`Due.UNCHECKED`, as steps are checked every few ones, not where a call ends;
    ``times`` (room,): the times, a view.
    """

    def __init__(self, step: float):
        self.step = step
        self.make_room(1)

    def make_room(self, n: int):
        """Hold the ends of n steps; SimulationError if they do not fit into memory."""
        refuse_beyond_memory(CALL_NUMBERS * n, f"n: the times of {n:.3g} steps", "give fewer steps a call")
        self.grid = np.column_stack([np.zeros(n), np.full(n, float(Due.UNCHECKED))])
        self.times, self._numbers = self.grid[:, 0], self.grid.data.cast("B").cast("d")

    def write(self, begin: float, first: int, n: int):
        """Write the ends of n steps of a motion that began at a time [s], from step ``first`` on."""
        h, last = self.step, first + n
        if n > FEW_STEPS:
            self.times[:n] = begin + h * np.arange(first, last)
        else:
            for k in range(n):
                self._numbers[2 * k] = begin + h * (first + k)
