"""Jumps of loads at switching times: where the value of a law just before and just after is another, and no slope is why."""

import numpy as np

from gauss.codegen import Expression, reachable
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.prescribed_jumps import RELATIVE, SMOOTH, generic_state
from gauss.dynamics.laws.sampled_laws import law_of_time
from gauss.dynamics.laws.switching_times import APART, jumps
from gauss.dynamics.laws.traced_laws import Laws
from gauss.scene.values import ConstantLaw
from gauss.system import State, System

SAMPLE_PLACES = np.array([-2.0, -1.0, 1.0, 2.0])  # places of samples beside a switching time, in distances of ends of steps
TIMES_IN_A_PASS = 32  # switching times: all operations of a law are kept for each


def first_jump(system: System, laws: Laws, start: State, end: float, times: np.ndarray) -> float:
    """First of some switching times (k,), ascending, at which the value of a load jumps [s]; infinite if there is none.

    Traced laws are compared at the start and at a generic state, opaque laws of time at their given ``breaks``.
    """
    apart = APART * max(abs(start.t), abs(end))
    return min(_traced(system, laws, start, times, apart), _opaque(system, laws, start, end, apart))


def _traced(system: System, laws: Laws, start: State, times: np.ndarray, apart: float) -> float:
    if laws.motion is None or not any(map(jumps, reachable(laws.outputs))):
        return np.inf
    states = start, generic_state(system, start)
    for first in range(0, times.size, TIMES_IN_A_PASS):
        part = times[first : first + TIMES_IN_A_PASS]
        found = np.any([_jumps(_values(laws, state, part[:, None] + apart * SAMPLE_PLACES)) for state in states], axis=0)
        if found.any():
            return float(part[found][0])
    return np.inf


def _opaque(system: System, laws: Laws, start: State, end: float, apart: float) -> float:
    motion, first = None, np.inf
    for bound in laws.called:
        given = np.asarray(getattr(bound.load, "breaks", ()), dtype=float)
        times = np.sort(given[(given > start.t) & (given <= end)])
        if not times.size:
            continue
        motion = motion or kinematics(system, start)
        found = (law_of_time(law, motion) for law in bound.laws if not isinstance(law, ConstantLaw))
        for law in [one for one in found if one is not None]:
            values = law(np.ravel(times[:, None] + apart * SAMPLE_PLACES)).T.reshape(-1, times.size, SAMPLE_PLACES.size)
            first = min(first, times[_jumps(values)].min(initial=np.inf))
    return float(first)


def _values(laws: Laws, state: State, looks: np.ndarray) -> np.ndarray:
    """Values (m, k, 4) of traced laws in a state, but for its time."""
    assert laws.motion is not None
    symbols = laws.motion.state
    assert isinstance(symbols.t, Expression)
    numbers = zip([*symbols.q, *symbols.v], [*state.q, *state.v], strict=True)
    given = {symbol.index: Interval.point(float(value)) for symbol, value in numbers}
    with np.errstate(all="ignore"):
        found = enclose(laws.outputs, given | {symbols.t.index: Interval.point(looks)})
    return np.array([np.broadcast_to(one.low, looks.shape) for one in found])


def _jumps(values: np.ndarray) -> np.ndarray:
    """Whether some of the values (m, k, 4) beside a time jumps there, (k,)."""
    before, last, first, after = np.moveaxis(values, -1, 0)
    with np.errstate(all="ignore"):
        smooth = np.abs(last - before) + np.abs(after - first)
        least = SMOOTH * smooth + RELATIVE * np.maximum(np.abs(first), np.abs(last))
        return (np.abs(first - last) > least).any(axis=0)
