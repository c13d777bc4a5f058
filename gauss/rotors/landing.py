"""Event location: the first zero of a margin in a step, refined by steps that end there, and the phase beyond it.

The zero is found on the dense output (Brent's method), the state by a step of its own from the start of the step; Newton's
method on the margin corrects the time, since the dense output is less accurate than a step.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import OdeSolver
from scipy.optimize import brentq

from gauss.errors import SimulationError

if TYPE_CHECKING:
    from gauss.rotors.run import RotorRun

TIME_CORRECTIONS = 6  # Newton steps on the time of an event
SLOPE_STEP = 1e-4  # of the interval, for the slope of a margin
PROBE_SLACKS = 4.0  # slacks: the margin beyond an event at which the next mode is decided
MOST_STALLED_EVENTS, RELATIVE_PROGRESS = 100, 1e-12  # events in a row that advance time by less than this share of the run
RTOL = 1e-15  # of Brent's method


def land(
    run: RotorRun,
    kind: type[OdeSolver],
    dense: Callable,
    begin: float,
    until: float,
    keys: list,
    before: np.ndarray,
    negative,
) -> None:
    """Step from the start of a step to the first margin that becomes negative, and find the new phase.

    SimulationError if too many events follow each other without progress in time.

    Parameters
    ----------
    run : RotorRun
        The run, at the start of the step.
    kind : type
        Integrator.
    dense : callable
        Dense output of the step.
    begin, until : float
        Start of the step, and a time at which margins are negative [s].
    keys, before : list, ndarray
        Names of the margins, and their values at the start.
    negative : ndarray of int
        Indices of the negative margins.
    """
    step = _Step(run, dense, begin, until)
    first, t = step.first_zero(before, negative)
    t, y = step.corrected(kind, first, t, bool(before[first] > 0))
    run.stalled = run.stalled + 1 if t - run.t <= RELATIVE_PROGRESS * run.switching.duration else 0
    if run.stalled > MOST_STALLED_EVENTS:
        raise SimulationError(
            f"at t = {t:.9g} s more than {MOST_STALLED_EVENTS} events follow each other without progress, the last of "
            f"{keys[first][0]} {keys[first][1]}; a discontinuity holds the motion: give the element a finite slope."
        )
    run.t, run.y = float(t), y
    at_zero = np.flatnonzero(run.margins(t, y)[1] <= run.slack)
    probe = step.probe(t, first)
    run.change({keys[k] for k in (first, *at_zero)}, (probe, *run.split(dense(probe))))
    run.record()


class _Step:
    """Margins over one step."""

    def __init__(self, run: RotorRun, dense: Callable, begin: float, until: float):
        self.run, self.dense, self.begin, self.until, self.y_begin = run, dense, begin, until, run.y

    def margin(self, t: float, k: int) -> float:
        """One margin on the dense output."""
        return self.run.margins(t, self.dense(t) if t > self.begin else self.y_begin)[1][k]

    def _shifted(self, t: float, k: int, shift: float) -> float:
        return self.margin(t, k) + shift

    def root(self, function: Callable[[float], float], begin: float) -> float:
        """Zero of a function between a time and the end of the step [s]."""
        return brentq(function, begin, self.until, xtol=self.run.switching.finest, rtol=RTOL)

    def first_zero(self, before: np.ndarray, negative) -> tuple[int, float]:
        """First margin that becomes negative, and when [s]; one that begins at zero has to leave the slack."""
        roots: dict[int, float] = {}
        for k in negative:
            shift = 0.0 if before[k] > 0 else self.run.slack
            if before[k] + shift <= 0:
                roots[k] = self.begin
            else:
                roots[k] = self.root(partial(self._shifted, k=k, shift=shift), self.begin)
        first = min(roots, key=lambda k: roots[k])
        return first, roots[first]

    def corrected(self, kind: type[OdeSolver], first: int, t: float, positive: bool) -> tuple[float, np.ndarray]:
        """Time and state of the event, by Newton's method on steps that end there."""
        run, begin, until = self.run, self.begin, self.until
        y = self.y_begin
        for _ in range(TIME_CORRECTIONS):
            if t <= begin:
                return begin, self.y_begin
            y = self._reach(kind, t)
            value = run.margins(t, y)[1][first] + (0.0 if positive else run.slack)
            h = SLOPE_STEP * (until - begin)
            ahead, back = min(t + h, until), max(t - h, begin)
            slope = (self.margin(ahead, first) - self.margin(back, first)) / (ahead - back)
            if slope >= 0 or abs(value / slope) <= 4 * np.finfo(float).eps * max(t, until - begin):
                break
            t = min(max(t - value / slope, begin), until)
        return t, y

    def _reach(self, kind: type[OdeSolver], end: float) -> np.ndarray:
        """State at a time within the step, by an integration of its own."""
        run = self.run
        solver = kind(run.rates, self.begin, self.y_begin, end, first_step=end - self.begin, **run.options(kind))
        while solver.status == "running":
            solver.step()
        return solver.y

    def probe(self, t: float, first: int) -> float:
        """Time beyond the event at which the margin is clearly negative [s]: there the next mode is decided."""
        slack = self.run.slack

        def beyond(s: float) -> float:
            return self.margin(s, first) + PROBE_SLACKS * slack

        probe = t if beyond(t) <= 0 or beyond(self.until) >= 0 else self.root(beyond, t)
        # below the resolution of time the end of the step is the next time that can be told apart
        return self.until if beyond(probe) > 0.5 * PROBE_SLACKS * slack else probe
