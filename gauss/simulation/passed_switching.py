"""Switching of laws of time within fixed steps that do not end there: of stepping objects, and of steps without events.

A prescribed velocity must not jump within such a step, for an impact is no part of it; features that are shorter than the
steps are warned of, and so are jumps of laws, at which steps are of order 1.
"""

import math
import warnings
from dataclasses import replace

import numpy as np

from gauss.codegen import Expression
from gauss.dynamics.laws.constraint_modes import refuse_surfaces
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.prescribed_jumps import RELATIVE, SMOOTH, generic_state
from gauss.dynamics.laws.switching import called_laws, timed_switching
from gauss.dynamics.laws.switching_times import APART, Timetable
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError, SwitchingWarning, user_level
from gauss.simulation.undetected_switching import warn_of_times
from gauss.system import State, System

CONTINUOUS = "let prescribed velocities be continuous, and prescribed positions smooth"  # a remedy
HORIZON = 10_000  # steps of a stepping object, which has no end, in which switching is looked for at once
RESOLVING_STEPS = 2.0  # steps that a feature of a law of time must last
BESIDE = np.array([-2.0, -1.0, 1.0, 2.0])  # places of samples beside a switching time, in distances of ends of steps


def smooth_timetable(system: System, laws: Laws, start: State, end: float, remedy: str = CONTINUOUS) -> Timetable:
    """Switching times and mesh of laws of time, for steps without impacts.

    Parameters
    ----------
    system : System
        The system.
    laws : Laws
        Its loads.
    start : State
        State at the start.
    end : float
        End of the steps [s].
    remedy : str, optional
        What to do about a jump.

    Raises
    ------
    SimulationError
        If a prescribed position or velocity jumps.
    """
    times, jumps = timed_switching(system, laws, start, end)
    if jumps:
        name = system.scene.name
        raise SimulationError(f"prescribed velocities of {name!r} jump at t = {jumps.times[0]:.6g} s; {remedy}.")
    warn_of_times(system, times)
    return times


def warn_of_features(scene: str, step: float, remedy: str, first: float | None = None):
    """Warn of a feature of a law of time that is shorter than steps resolve, the first one at a time [s]."""
    place = "" if first is None else f" at t = {first:.6g} s"
    text = f"steps of {step:g} s pass over a feature of a law of time{place}; shorten the step, or {remedy}."
    warnings.warn(f"{scene!r}: {text}", SwitchingWarning, stacklevel=user_level())


def examine_steps(system: System, laws: Laws, start: State, end: float, step: float, remedy: str = "use gauss.simulate"):
    """Refuse or warn of switching of laws of time in fixed steps that pass over it; parameters of :func:`smooth_timetable`.

    Warns
    -----
    SwitchingWarning
        With the scene and the time of the first feature that is shorter than steps resolve, or of the first jump.

    Raises
    ------
    SimulationError
        If a prescribed position or velocity jumps.
    """
    name, times = system.scene.name, smooth_timetable(system, laws, start, end, remedy)
    short = times.switches[:-1][np.diff(times.switches) < RESOLVING_STEPS * step]
    times = times.join(called_laws(system, laws, start))
    first = min(float(short[0]) if short.size else np.inf, times.first_coarse(start.t, end, step))
    if first < np.inf or times.unresolved(start.t, end, step):
        warn_of_features(name, step, remedy, first if first < np.inf else None)
        return
    jumping = _jumping(system, laws, start, times.switches)
    if jumping.size:
        text = f"steps of {step:g} s do not end where a law of time jumps, at t = {jumping[0]:.6g} s"
        warnings.warn(f"{name!r}: {text}: they are of order 1 there; {remedy}.", SwitchingWarning, stacklevel=user_level())


def _jumping(system: System, laws: Laws, start: State, times: np.ndarray) -> np.ndarray:
    """Times of some (k,) at which the value of a traced load jumps, at the start or at a generic state [s]."""
    if not times.size or laws.motion is None or not laws.outputs:
        return np.zeros(0)
    symbols = laws.motion.state
    assert isinstance(symbols.t, Expression)
    looks = times[:, None] + APART * np.abs(times).max() * BESIDE
    found = np.zeros(times.size, dtype=bool)
    for state in (start, generic_state(system, start)):
        numbers = zip([*symbols.q, *symbols.v], [*state.q, *state.v], strict=True)
        given = {symbol.index: Interval.point(np.full(looks.shape, value)) for symbol, value in numbers}
        with np.errstate(all="ignore"):
            ranges = enclose(laws.outputs, given | {symbols.t.index: Interval.point(looks)})
            for one in ranges:
                before, last, first, after = np.moveaxis(np.broadcast_to(one.low, looks.shape), -1, 0)
                smooth = np.abs(last - before) + np.abs(after - first)
                found |= np.abs(first - last) > SMOOTH * smooth + RELATIVE * np.maximum(np.abs(first), np.abs(last))
    return times[found]


class StepsAhead:
    """Time ahead of a stepping object in which switching has been looked for.

    Parameters
    ----------
    system : System
        The system.
    laws : Laws
        Its loads.
    step : float
        Step [s].

    Raises
    ------
    SimulationError
        If a constraint jumps at a condition on the state.
    """

    def __init__(self, system: System, laws: Laws, step: float):
        refuse_surfaces(system, "a motion in fixed steps of one call each")
        self.system, self.laws, self.step = system, laws, step
        is_timed = system.relations.asks_time or bool(laws.outputs) or bool(laws.called)
        self.begin, self.end = (0.0, -math.inf) if is_timed else (-math.inf, math.inf)

    def seen_from(self, t: float) -> float:
        """Number of steps from a time [s] in which switching has been looked for."""
        return (self.end - t) / self.step if self.begin <= t <= self.end else 0.0

    def look(self, start: State, end: float):
        """Look for switching from a state up to a time [s] at least; as :func:`examine_steps`."""
        if not self.begin <= start.t <= self.end:
            self.begin = self.end = start.t
        while self.end < end:
            further = self.end + HORIZON * self.step
            examine_steps(self.system, self.laws, replace(start, t=self.end), further, self.step)
            self.end = further
