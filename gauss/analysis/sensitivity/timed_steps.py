"""Steps of a motion between given times that end at the switching times of its laws of time, as those of a simulation do."""

import numpy as np

from gauss.dynamics.laws.switching_times import Timetable
from gauss.dynamics.laws.traced_laws import Laws
from gauss.simulation.passed_switching import smooth_timetable, warn_of_features
from gauss.system import State, System

SHORTEST = 1e-13  # of a step: what is left between a switching time and a node is rounding


def timed_steps(
    system: System, laws: Laws, start: State, nodes: np.ndarray, lengths: np.ndarray
) -> list[list[tuple[float, float]]]:
    """Begin and length of the smooth steps from each of some times to the next [s].

    SimulationError if a prescribed position or velocity jumps.

    Parameters
    ----------
    laws : Laws
        Its loads.
    nodes : ndarray, shape (k + 1,)
        Times [s].
    lengths : ndarray, shape (k,)
        Lengths of steps that end at no switching time [s].

    Warns
    -----
    SwitchingWarning
        If a law of time has a smooth feature that is shorter than the steps resolve.
    """
    times, step = smooth_timetable(system, laws, start, float(nodes[-1])), float(lengths.max())
    if times.unresolved(start.t, float(nodes[-1]), step):
        warn_of_features(system.scene.name, step, "let the law vary more slowly")
    return divided(times, nodes, lengths)


def divided(times: Timetable, nodes: np.ndarray, lengths: np.ndarray) -> list[list[tuple[float, float]]]:
    """Begin and length of the steps from each of some times (k + 1,) to the next, of lengths (k,) but at switching times."""
    begin, end = float(nodes[0]), float(nodes[-1])
    stops = [stop for stop in times.stops(begin, end) if stop[0] < stop[1]]
    found: list[list[tuple[float, float]]] = []
    place = 0
    for node, after, h in zip(nodes[:-1].tolist(), nodes[1:].tolist(), lengths.tolist(), strict=True):
        steps, begin = [], max(begin, node)
        while place < len(stops) and stops[place][0] < after:
            before, reached = stops[place]
            steps.append((begin, before - begin))
            begin, place = reached, place + 1
        steps.append((begin, h if begin == node else after - begin))
        found.append([(t, length) for t, length in steps if length > SHORTEST * h])
    return found
