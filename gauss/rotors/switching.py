"""Switching of the torque laws of a network: switching times, known beforehand, and switching functions of the state.

Switching times of traced laws are found by :mod:`gauss.dynamics.laws.switching_times`, those of opaque laws by samples,
switching functions of angles and speeds by :mod:`gauss.rotors.surfaces`.
"""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.laws.sampled_laws import sampled_times
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable, timetable
from gauss.rotors.reduced import ReducedNetwork
from gauss.rotors.surfaces import Surfaces
from gauss.rotors.traced_laws import TracedLaws

RESOLVED = 1e-14  # of the duration: crossings closer than that are one, and shorter steps are not searched


class NetworkSwitching(NamedTuple):
    """Switching times and switching functions that the steps of a run resolve.

    Attributes
    ----------
    times : Timetable
        Switching times of laws of time, and a mesh that resolves these laws.
    surfaces : Surfaces
        Switching functions of angles and speeds.
    opaque : tuple of str
        Elements with opaque laws.
    duration : float
        Duration of the run [s].
    """

    times: Timetable
    surfaces: Surfaces
    opaque: tuple[str, ...]
    duration: float

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
    return sampled_times(law, None, begin, end) if begin < end else NO_TIMES
