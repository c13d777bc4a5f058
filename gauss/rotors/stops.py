"""Mandatory ends of steps of a run: switching times, gates, corners of data, ends of a mesh, and samples."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.laws.switching_times import Timetable


class StepEnd(NamedTuple):
    """Mandatory end of a step."""

    # before, after: end of the step, and start of the next one [s]: a few units in the last place apart at a switching time
    # of a law, so that no evaluation falls upon it
    before: float
    after: float
    switches: bool  # whether torques may be discontinuous there
    samples: tuple[float, ...]  # times of samples [s]


def stops(duration: float, times: Timetable, switches: np.ndarray, samples: np.ndarray | None) -> list[StepEnd]:
    """Stops of a run in order; the last is its end.

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
