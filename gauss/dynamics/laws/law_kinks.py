"""Kinks and jumps of traced laws in one state, where accelerations have no derivatives.

A switching function that is zero in the state is looked at first. Then the second difference f(x + δ) − 2 f(x) + f(x − δ)
of a law f is of order δ² where it is smooth, of order δ at a kink, and of order 1 at a jump; the first difference
f(x + δ) − f(x − δ), of order δ, shows jumps that are odd, as that of a sign.
"""

from dataclasses import replace

import numpy as np

from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.switching_functions import watch_of
from gauss.dynamics.laws.traced_laws import Laws
from gauss.system import BoundLoad, State, System, retract

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
