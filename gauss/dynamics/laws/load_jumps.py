"""Jumps of loads at switching times, and kinks and jumps of traced laws in one state.

At a switching time a law jumps if its value just before and just after is another, and no slope is why. In a state where
accelerations are to be differentiated, a switching function that is zero there is looked at first. Then the second
difference f(x + δ) − 2 f(x) + f(x − δ) of a law f is of order δ² where it is smooth, of order δ at a kink, and of order 1 at
a jump; the first difference f(x + δ) − f(x − δ), of order δ, shows jumps that are odd, as that of a sign.
"""

from dataclasses import replace

import numpy as np

from gauss.codegen import Expression, reachable
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.prescribed_jumps import RELATIVE, SMOOTH, generic_state
from gauss.dynamics.laws.sampled_laws import law_of_time
from gauss.dynamics.laws.switching_functions import watch_of
from gauss.dynamics.laws.switching_times import APART, jumps
from gauss.dynamics.laws.traced_laws import Laws
from gauss.scene.values import ConstantLaw
from gauss.system import BoundLoad, State, System, retract

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


DIFFERENCE = 1e-4  # δ, in units of the coordinates and rates of the scene
DIVISOR = 8.0  # between two δ: first and second differences of a smooth law have the ratios 8 and 64, at a jump 1 and 1
LEAST_RATIOS = np.array([[4.0], [20.0]])  # of first and second differences of a smooth law; second ones at a kink have 8
DIFFERENCE_ROUNDING = 1e-12  # of differences, relative to the values


def kinked_laws(system: System, laws: Laws, state: State) -> tuple[str, ...]:
    """Names of the loads whose traced laws have a kink or a jump in a state."""
    watch = watch_of(system, laws)
    if watch is None or not watch.is_between(state):
        return ()
    asked = [bound for bound in laws.traced if bound.load.name in watch.names]
    return tuple(bound.load.name for bound in asked if _has_kink(system, bound, state))


def _has_kink(system: System, bound: BoundLoad, state: State) -> bool:
    """Whether differences of the laws of a load along some coordinate or rate are those of a kink or a jump."""

    def values(direction: int, far: float) -> np.ndarray:
        change = np.zeros((2, system.n_v))
        change.ravel()[direction] = far
        q, v = retract(system, state.q, change[0] * system.scale.coordinates), state.v + change[1] * system.scale.rates
        motion = kinematics(system, replace(state, q=q, v=v))
        return np.concatenate([np.ravel(np.asarray(law(state.t, motion), dtype=float)) for law in bound.laws])

    here = values(0, 0.0)
    for direction in range(2 * system.n_v):
        found = []
        for far in (DIFFERENCE, DIFFERENCE / DIVISOR):
            below, above = values(direction, -far), values(direction, far)
            found.append(np.abs([above - below, above - 2.0 * here + below]))
        floor = DIFFERENCE_ROUNDING * (np.abs(here) + np.abs(above) + np.abs(below))
        if ((found[0] > floor) & (LEAST_RATIOS * found[1] > found[0])).any():
            return True
    return False
