"""Laws that switch along a motion of given steps: by time, where steps end as those of a simulation do, and by the state.

Across a jump at a value of the state, derivatives of a motion lack the change of the time of the jump.
"""

import warnings

import numpy as np

from gauss.codegen import Expression, reachable
from gauss.dynamics.laws.constraint_functions import watched_functions
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.switching_times import Timetable, jumps, of_time
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SwitchingWarning, user_level
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


def warn_of_jumps(system: System, t: np.ndarray, x: np.ndarray):
    """Warn where a condition of a traced law, other than one of time, changes along a motion.

    Parameters
    ----------
    t, x : ndarray, shape (k,), (k, n_q + n_v)
        Times [s] and states of the motion.
    """
    crossed = {name: time for time, names in reversed(_crossings(system, t, x)) for name in names}
    if crossed:
        listed = ", ".join(f"{name!r} (t = {time:.6g} s)" for name, time in crossed.items())
        warnings.warn(
            f"scene {system.scene.name!r}: conditions of laws change along the motion: {listed}. Derivatives are right if "
            "the laws are continuous there; across a jump they lack the change of the time at which it happens.",
            SwitchingWarning,
            stacklevel=user_level(),
        )


def _crossings(system: System, t: np.ndarray, x: np.ndarray) -> list[tuple[float, list[str]]]:
    """Times [s] before which a condition changes, and the loads and constraints that ask for it."""
    functions = watched_functions(system, Laws(system))
    if functions.motion is None or not functions.outputs:
        return []
    state = functions.motion.state
    assert isinstance(state.t, Expression)
    nodes = _conditions(functions.outputs, state.t)
    symbols = [state.t, *state.q, *state.v]
    given = {symbol.index: Interval.point(values) for symbol, values in zip(symbols, [t, *x.T], strict=True)}
    with np.errstate(all="ignore"):
        found = [np.broadcast_to(value.low, t.shape) for value in enclose(nodes, given)]
    asking = [[name for name, law in functions.functions if node in reachable(law.outputs)] for node in nodes]
    changes = [
        (float(t[k + 1]), names)
        for names, values in zip(asking, found, strict=True)
        for k in np.flatnonzero(np.diff(values))
    ]
    return sorted(changes, key=lambda change: change[0])


def _conditions(outputs: list[Expression], clock: Expression) -> list[Expression]:
    """Conditions at which laws may jump, other than those of time."""
    timed = {node.index for node in of_time(outputs, clock)}
    return [node for node in reachable(outputs) if jumps(node) and node.index not in timed]
