"""Impacts of prescribed motions: the state, the energy account and the event after a jump of prescribed velocities."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.impact import Impact
from gauss.dynamics.laws.prescribed_jumps import Jumps
from gauss.dynamics.laws.switching import Switching
from gauss.errors import SimulationError
from gauss.simulation.motion_records import Event
from gauss.simulation.trajectory import Trajectory
from gauss.system import State


class AfterJump(NamedTuple):
    """State after a jump of prescribed velocities."""

    state: State  # just after the switching time
    work: np.ndarray  # quadratures up to then: work of drives and of forces on bodies, energy lost, … [J]
    event: Event  # the impact


def crossed(jumps: Jumps, state: State, work: np.ndarray, after: float) -> AfterJump | None:
    """Impact of a motion at a switching time, up to just after it [s]; None if no prescribed velocity jumps there."""
    found = jumps.crossed(state, after)
    if found is None:
        return None
    happened, names = found
    return AfterJump(happened.state, booked(work, happened), of_impact(after, names, happened))


def booked(work: np.ndarray, happened: Impact) -> np.ndarray:
    """Quadratures (work, losses) with those of an impact."""
    work = work.copy()
    work[0] += happened.work
    work[2] += happened.loss
    return work


def of_impact(t: float, names, happened: Impact) -> Event:
    """Event of an impact at a time [s]."""
    return Event(float(t), "impact", tuple(names), happened.loss, happened.impulses)


def beside_jumps(switching: Switching, start: State, end: float, samples, made: Callable) -> Trajectory:
    """Motion whose laws jump at its start, at its end or at samples; samples at a jump are those just after it.

    ``made``: (start, end, samples) → trajectory, without samples at a jump. Where a law switches at the end [s], steps end
    just before it.
    """
    last = switching.times.last_end(start.t, end)
    if not switching.jumps and last == end:
        return made(start, end, samples)
    times = samples
    for before, after in switching.times.stops(start.t, end):
        if samples is not None and switching.jumps.within(before, after):
            times = np.where((times > before) & (times < after), after, times)
    begun = _begun(switching.jumps, start, end)
    if samples is not None:
        times = times if begun is None else np.maximum(times[times > start.t], begun.state.t)
        times = np.append(times[times < last], np.full((times >= last).sum(), last))
    try:
        found = made(start if begun is None else begun.state, last, times)
    except SimulationError as error:
        if error.trajectory is not None:
            error.trajectory = _shown(error.trajectory, start, begun, samples)
        raise
    return _ended(_shown(found, start, begun, samples), switching.jumps, last, end)


def _begun(jumps: Jumps, start: State, end: float) -> AfterJump | None:
    """Impact at the start, if a prescribed velocity jumps there."""
    after = jumps.at_start(start.t, end)
    return None if after is None else crossed(jumps, start, np.zeros(3), after)


def _shown(found: Trajectory, start: State, begun: AfterJump | None, samples) -> Trajectory:
    """Motion with its start before the impact there, and with the requested sample times."""
    if begun is not None:
        columns = {"t": found.t, "q": found.q, "v": found.v, "work": found.work + begun.work}
        if samples is None or samples[0] == start.t:
            first = {"t": start.t, "q": start.q, "v": start.v, "work": np.zeros(3)}
            columns = {name: np.concatenate([[first[name]], column]) for name, column in columns.items()}
        found = replace(found, **columns, events=(begun.event, *found.events))
    return found if samples is None else replace(found, t=samples[: len(found)])


def _ended(found: Trajectory, jumps: Jumps, last: float, end: float) -> Trajectory:
    """Motion whose last sample, just before the final time, is just after a jump there; no impact without that sample."""
    if last == end or not len(found) or found.t[-1] < last:
        return found
    rows = {name: getattr(found, name).copy() for name in ("t", "q", "v", "work")}
    rows["t"][-1] = end
    try:
        reached = crossed(jumps, State(last, rows["q"][-1], rows["v"][-1]), rows["work"][-1], end)
    except SimulationError as error:
        error.trajectory = replace(found, **rows)
        raise
    if reached is None:
        return replace(found, **rows)
    after = {"t": end, "q": reached.state.q, "v": reached.state.v, "work": reached.work}
    for name, value in after.items():
        rows[name][-1] = value
    return replace(found, **rows, events=(*found.events, reached.event))
