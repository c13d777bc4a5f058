"""Meshes whose intervals end where laws of time switch, and do not span what they have not seen of a law.

Within an interval the collocation is right for smooth laws; a narrow one may lie between all of its points.
"""

import numpy as np

from gauss.analysis.optimal.mesh_error import SUBSTEPS
from gauss.dynamics.laws.switching_times import distinct
from gauss.dynamics.laws.traced_laws import Laws
from gauss.simulation.passed_switching import smooth_timetable, warn_of_features
from gauss.system import State, System

MOST_PLACES = 20  # of an interval: more switching times and cells of a law are left to the check of the result
MESH_DISTANCE = 0.01  # of an equal interval: a mesh point nearer to a switching time gives way to it


def law_mesh(system: System, start: State, span: tuple[float, float], intervals: int) -> np.ndarray:
    """First mesh (n + 1,) on [0, 1]: equal intervals, divided where laws of time switch if the duration is given [s].

    SimulationError if a prescribed position or velocity jumps.
    """
    equal, (duration, longest) = np.linspace(0.0, 1.0, intervals + 1), span
    if duration != longest:
        return equal
    begin, end = start.t, start.t + duration
    times = smooth_timetable(system, Laws(system), start, end)
    places = (np.array([0.5 * (before + after) for before, after in times.stops(begin, end)[:-1]]) - begin) / duration
    if not places.size or places.size > MOST_PLACES * intervals:
        return equal
    inner = equal[1:-1]
    far = np.abs(inner[:, None] - places).min(axis=1) > MESH_DISTANCE / intervals
    return distinct(np.concatenate([equal[[0, -1]], inner[far], places]))


def warn_of_passed(system: System, start: State, t: np.ndarray):
    """Warn of features of laws of time that pass between all times at which a mesh t (n + 1,) was checked [s].

    SimulationError if a prescribed position or velocity jumps.

    Warns
    -----
    SwitchingWarning
        With the scene.
    """
    times = smooth_timetable(system, Laws(system), start, float(t[-1]))
    edges = distinct(np.clip(np.concatenate([t[[0, -1]], times.switches, times.mesh]), t[0], t[-1]))
    if edges.size < 3:
        return
    middle = 0.5 * (edges[1:] + edges[:-1])
    steps = (np.diff(t) / SUBSTEPS)[np.clip(np.searchsorted(t, middle) - 1, 0, len(t) - 2)]
    passed = np.diff(edges) < steps
    if passed.any():
        warn_of_features(system.scene.name, float(steps[passed].max()), "give more intervals=", float(middle[passed][0]))
