"""Switching of laws of time within fixed steps that do not end there: of stepping objects, and of steps without events.

A prescribed velocity must not jump within such a step, for an impact is no part of it; features that are shorter than the
steps are warned of, and so are jumps of laws, at which steps of methods of higher order are of order 1. A jump at an end of
a step does no harm to methods that evaluate nothing there; the last stage of others sees the value after it.
"""

import math
import warnings
from dataclasses import replace

import numpy as np

from gauss.dynamics.laws.constraint_modes import refuse_surfaces
from gauss.dynamics.laws.load_jumps import first_jump
from gauss.dynamics.laws.switching import called_laws, timed_switching
from gauss.dynamics.laws.switching_times import APART, Timetable
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError, SwitchingWarning, user_level
from gauss.integrators import FixedStep
from gauss.simulation.undetected_switching import warn_of_times
from gauss.system import State, System

CONTINUOUS = "let prescribed velocities be continuous, and prescribed positions smooth"  # a remedy
SIMULATED = "use gauss.simulate, or an input, which is held within each step"  # a remedy
HORIZON = 10_000  # steps of a stepping object, which has no end, in which switching is looked for at once
RESOLVING_STEPS = 2.0  # steps that a feature of a law of time must last


def smooth_timetable(system: System, laws: Laws, start: State, end: float, remedy: str = CONTINUOUS) -> Timetable:
    """Switching times and mesh of laws of time up to an end [s], for steps without impacts.

    SimulationError, with a remedy, if a prescribed position or velocity jumps.
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


def examine_steps(
    system: System,
    laws: Laws,
    start: State,
    end: float,
    step: float,
    remedy: str = SIMULATED,
    method: FixedStep | None = None,
    warned_of: set[str] | None = None,
):
    """Refuse or warn of switching of laws of time in fixed steps from a start to an end [s] that pass over it.

    Without a method they are steps of an explicit Runge–Kutta method. SimulationError if a prescribed position or velocity
    jumps. SwitchingWarning with the scene and the time of the first feature that is shorter than steps resolve, or of the
    first jump; what is in ``warned_of`` is not warned of again, what is warned of is added.
    """
    name, times = system.scene.name, smooth_timetable(system, laws, start, end, remedy)
    said = set() if warned_of is None else warned_of
    if "feature" not in said:
        first = _first_feature(times.join(called_laws(system, laws, start)), start.t, end, step)
        if first is not None:
            said.add("feature")
            warn_of_features(name, step, remedy, first if first < np.inf else None)
            return
    if "jump" in said or (method is not None and method.order == 1):
        return
    ending = _ends_of_steps(times.switches, start.t, step)
    harmful = times.switches if method is None or method.evaluates_end else times.switches[~ending]
    first = first_jump(system, laws, start, end, harmful)
    if first < np.inf:
        said.add("jump")
        at_end = ", at the end of one, where its method evaluates the law" if first in times.switches[ending] else ""
        text = f"steps of {step:g} s are of order 1 where a law of time jumps, at t = {first:.6g} s{at_end}"
        warnings.warn(f"{name!r}: {text}; {remedy}.", SwitchingWarning, stacklevel=user_level())


def _first_feature(times: Timetable, begin: float, end: float, step: float) -> float | None:
    """Time of the first feature that steps do not resolve [s], infinite where it is not known; None if there is none."""
    inside = ~_ends_of_steps(times.switches, begin, step)
    short = (np.diff(times.switches) < RESOLVING_STEPS * step) & (inside[1:] | inside[:-1])
    first = min(times.switches[:-1][short].min(initial=np.inf), times.first_coarse(begin, end, step))
    return float(first) if first < np.inf or times.unresolved(begin, end, step) else None


def _ends_of_steps(times: np.ndarray, begin: float, step: float) -> np.ndarray:
    """Whether some times (k,) are ends of steps [s], but for rounding."""
    ends = begin + np.round((times - begin) / step) * step
    return np.abs(times - ends) <= APART * np.maximum(abs(begin), np.abs(times))


class StepsAhead:
    """Time ahead of a stepping object in which switching has been looked for; a feature and a jump are warned of once.

    SimulationError if a constraint jumps at a condition on the state.
    """

    def __init__(self, system: System, laws: Laws, step: float, method: FixedStep):
        refuse_surfaces(system, "a motion in fixed steps of one call each")
        self.system, self.laws, self.step, self.method = system, laws, step, method
        self.is_timed = system.relations.asks_time or bool(laws.outputs) or bool(laws.called)
        self.begin, self.horizons, self.warned_of = 0.0, 0, set[str]()

    @property
    def end(self) -> float:
        """End of the time in which switching has been looked for [s]."""
        return self.begin + self.horizons * (HORIZON * self.step)

    def seen_from(self, t: float) -> float:
        """Number of steps from a time [s] in which switching has been looked for."""
        if not self.is_timed:
            return math.inf
        if not self.begin <= t <= self.end:
            return 0.0
        beside = abs(math.remainder(t - self.begin, self.step))  # as _ends_of_steps, of one time
        return (self.end - t) / self.step if beside <= APART * max(abs(self.begin), abs(t)) else 0.0

    def look(self, start: State, end: float):
        """Look for switching from a state up to a time [s] at least; as :func:`examine_steps`."""
        if not self.is_timed:
            return
        if not self.seen_from(start.t):
            self.begin, self.horizons = start.t, 0
        while self.end < end:
            further = self.begin + (self.horizons + 1) * (HORIZON * self.step)
            given = self.system, self.laws, replace(start, t=self.end), further, self.step
            examine_steps(*given, method=self.method, warned_of=self.warned_of)
            self.horizons += 1
