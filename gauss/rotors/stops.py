"""Where the steps of a run end: at switching times, gates, corners of data, ends of a mesh, and samples."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.timetable import Timetable


class Stop(NamedTuple):
    """Where a step ends and the next one begins.

    Attributes
    ----------
    before, after : float
        Where the one ends and the other begins [s]: a few units in the last place apart at a switching time of a law, which
        no evaluation then falls upon.
    switches : bool
        Whether torques may jump there.
    samples : tuple of float
        Times whose samples are due [s].
    """

    before: float
    after: float
    switches: bool
    samples: tuple[float, ...]


def stops(duration: float, times: Timetable, switches: np.ndarray, samples: np.ndarray | None) -> list[Stop]:
    """Stops of a run in order; the last is its end.

    Parameters
    ----------
    duration : float
        How long the run is [s].
    times : Timetable
        Switching times and mesh of laws.
    switches : ndarray
        When torques begin or end, or data have a corner [s].
    samples : ndarray or None
        Samples that are asked for [s].
    """
    found = [Stop(before, after, before < after, ()) for before, after in times.stops(0.0, duration)]
    found += [Stop(t, t, True, ()) for t in np.asarray(switches, dtype=float).tolist() if 0 < t < duration]
    found += [Stop(t, t, False, (t,)) for t in ([] if samples is None else samples.tolist())]
    merged: list[Stop] = []
    for stop in sorted(found):
        if merged and stop.before <= merged[-1].after:
            last = merged[-1]
            both = last.switches or stop.switches, last.samples + stop.samples
            merged[-1] = Stop(last.before, max(last.after, stop.after), *both)
        else:
            merged.append(stop)
    return merged
