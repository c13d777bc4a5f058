"""Switching of the torque laws of a network: times known beforehand, at which steps end; switching functions of the state.

Switching times of traced laws are found by :mod:`gauss.dynamics.laws.switching_times`, those of opaque laws by samples,
switching functions of angles and speeds by :mod:`gauss.rotors.surfaces`. Where laws are opaque, the defect y' − f(t, y) of
the dense output (Enright, BIT 29 (1989)) is sampled: where it would change the speeds by far more than the error allowed, a
law has switched between the stages of the step.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gauss.dynamics.laws.sampled_laws import sampled_times
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable, timetable
from gauss.rotors.reduced import ReducedNetwork
from gauss.rotors.surfaces import Surfaces
from gauss.rotors.traced_laws import TracedLaws
from gauss.scene.stateful_laws import preserved
from gauss.simulation.undetected_switching import LARGEST_DEFECT, REJECTED_SHARE, RESOLVED_STEP, SHIFTS, defect_times

if TYPE_CHECKING:
    from gauss.rotors.run import RotorRun

RESOLVED = 1e-14  # of the duration: crossings closer than that are one, and shorter steps are not searched


class NetworkSwitching(NamedTuple):
    """Switching times and switching functions that the steps of a run resolve."""

    times: Timetable  # switching times of laws of time, and a mesh that resolves these laws
    surfaces: Surfaces  # switching functions of angles and speeds
    opaque: tuple[str, ...]  # elements with opaque laws
    duration: float  # duration of the run [s]

    @property
    def finest(self) -> float:
        """Resolution of time [s]."""
        return RESOLVED * self.duration


def switching(reduced: ReducedNetwork, duration: float, rtol: float, breaks=()) -> NetworkSwitching:
    """Switching times and switching functions of a run.

    Parameters
    ----------
    reduced : ReducedNetwork
        The network.
    duration : float
        Duration of the run [s].
    rtol : float
        Relative tolerance of its steps.
    breaks : sequence of float
        Further switching times [s].
    """
    laws = TracedLaws(reduced)
    given = [*breaks, *(t for term in reduced.terms for t in term.breaks)]
    times = Timetable(np.unique([t for t in given if 0 < t < duration]).astype(float), np.zeros(0)) if given else NO_TIMES
    if laws.outputs:
        times = times.join(timetable(list(laws.outputs.values()), laws.t, 0.0, duration))
    terms = [term for term in laws.opaque.values() if term is not None]
    times = times.join(*(_sampled(reduced, term, duration) for term in terms))
    return NetworkSwitching(times, Surfaces(laws, rtol), tuple(laws.opaque), duration)


def _sampled(reduced: ReducedNetwork, term, duration: float) -> Timetable:
    """Discontinuities in time of an opaque law, at the initial angle and speed and a radian on at the largest speed."""
    j = reduced.names.index(term.shaft)
    angle, speed = reduced.angle[j], reduced.K[j] * reduced.speed[reduced.group[j]]
    places = (float(angle), float(speed)), (float(angle) + 1.0, float(reduced.largest))
    law = lambda t, _: [float(term.law(t, *place)) for place in places]  # noqa: E731
    begin, end = max(term.begin or 0.0, 0.0), duration if term.until is None else min(term.until, duration)
    with preserved(getattr(term.law, "function", None)):
        return sampled_times(law, None, begin, end, f"the law of {term.name!r}") if begin < end else NO_TIMES


def resolved_share(run: "RotorRun", begin: float, end: float, dense: Callable) -> tuple[float, float | None]:
    """Share of a step in which no law switches unseen, 1 for all of it; and the time of a discontinuity of a law [s]."""
    switching, share, jump = run.switching, 1.0, None
    if switching.surfaces and end - begin > switching.finest:
        share, jump = switching.surfaces.share(begin, end, lambda t: dense(t)[: 2 * run.n_g], switching.finest)
        if jump is not None:
            share = min(share, (jump - begin - switching.finest) / (end - begin))
    if share == 1.0 and switching.opaque and end - begin > RESOLVED_STEP * switching.duration:
        samples = defect_times(begin, end - begin).reshape(-1, len(SHIFTS))
        share = REJECTED_SHARE if any(_defective(run, end - begin, times, dense(times)) for times in samples) else 1.0
    return share, jump


def _defective(run: "RotorRun", h: float, times: np.ndarray, y: np.ndarray) -> bool:
    """Whether the defect of the speeds in a step of length h exceeds what is allowed, by dense output y at three times."""
    speeds = slice(run.n_g, 2 * run.n_g)
    slope = (y[speeds, 2] - y[speeds, 0]) / (times[2] - times[0])
    defect = slope - run.phase.instant(times[1], *run.split(y[:, 1])).acceleration
    return bool((h * np.abs(defect) > LARGEST_DEFECT * (run.atol[speeds] + run.rtol * np.abs(y[speeds, 1]))).any())


def switches(reduced: ReducedNetwork, duration: float) -> np.ndarray:
    """Times within a run at which a torque begins or ends, or the data of a link have a corner [s]."""
    torques = reduced.network.torques.values()
    times = [t for torque in torques for t in (torque.begin, torque.until) if t is not None]
    times += [t for link in reduced.links for t in link.corners]
    return np.unique([t for t in times if 0 < t < duration])


class StepEnd(NamedTuple):
    """Mandatory end of a step."""

    before: float  # when it ends [s]
    after: float  # when the next one begins [s]: a few units in the last place later where a law of time switches
    switches: bool  # whether torques may be discontinuous there
    samples: tuple[float, ...]  # times of samples [s]


def step_ends(duration: float, times: Timetable, switches: np.ndarray, samples: np.ndarray | None) -> list[StepEnd]:
    """Mandatory ends of steps in order; the last is that of the run.

    Parameters
    ----------
    duration : float
        Duration of the run [s].
    times : Timetable
        Switching times and mesh of laws.
    switches : ndarray
        Times at which torques begin or end, or data have a corner [s].
    samples : ndarray or None
        Times of samples [s].
    """
    found = [StepEnd(before, after, before < after, ()) for before, after in times.stops(0.0, duration)[:-1]]
    found.append(StepEnd(times.last_end(0.0, duration), duration, False, ()))
    found += [StepEnd(t, t, True, ()) for t in np.asarray(switches, dtype=float).tolist() if 0 < t < duration]
    found += [StepEnd(t, t, False, (t,)) for t in ([] if samples is None else samples.tolist())]
    merged: list[StepEnd] = []
    for stop in sorted(found):
        if merged and stop.before <= merged[-1].after:
            last = merged[-1]
            both = last.switches or stop.switches, last.samples + stop.samples
            merged[-1] = StepEnd(last.before, max(last.after, stop.after), *both)
        else:
            merged.append(stop)
    return merged
