"""What an evaluation of opaque laws costs, measured at the start of a scene: the laws, and all that calls them."""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np

from gauss.codegen.kernels import address
from gauss.dynamics.evaluation_cost import CALL, TIMED_CALL
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws, needs_poses
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.load_receiver import LoadReceiver
from gauss.scene.stateful_laws import preserved
from gauss.scene.values import ConstantLaw
from gauss.system import BoundLoad, System

MEASURING_TIME, MOST_CALLS = 1e-3, 50  # s, and calls, of a measurement
CHECK_COST = 4e-6  # s an evaluation of the checks that a law of the motion does not switch within a step


class CallCost(NamedTuple):
    """Cost of the opaque laws of a load in one evaluation."""

    whole: float  # time of an evaluation that they add [s]
    own: float  # part of it that is the user's code [s]; not a number if it was not measured

    def __str__(self):
        if self.own != self.own:
            return f"about {1e6 * self.whole:.2g} µs (estimated)"
        return f"about {1e6 * self.whole:.2g} µs (measured), of which its own code takes {1e6 * self.own:.2g} µs"


def call_costs(system: System, laws: Laws) -> dict[str, CallCost]:
    """Costs of the opaque laws of each load, by its name; an estimate where a law has no value at the start."""
    called = laws.called
    timed = not any(needs_poses(bound.load) for bound in called)
    try:
        own = [_own(system, bound) for bound in called]
        state, forces = system.initial_state(), LoadForces(system, called)
        numbers, found = np.concatenate([[state.t], state.q, state.v]), np.empty(system.n_v + 3)
        receive, given, target = LoadReceiver(forces), address(numbers), address(found)
        beside = max(0.0, _time(lambda: receive(given, target), called) - sum(own)) / max(1, len(called))
    except Exception:  # a law may fail in any way where the motion never comes
        return {bound.load.name: CallCost(TIMED_CALL if timed else CALL, np.nan) for bound in called}
    share = beside + (0.0 if timed else CHECK_COST / len(called))
    return {bound.load.name: CallCost(one + share, one) for bound, one in zip(called, own, strict=True)}


def _own(system: System, bound: BoundLoad) -> float:
    """Time of one call of each law of a load, with poses that are known [s]."""
    motion = kinematics(system, system.initial_state())
    laws = [law for law in bound.laws if not isinstance(law, ConstantLaw)]
    t = motion.state.t

    def call():
        for law in laws:
            law(t, motion)

    return _time(call, [bound])


def _time(call: Callable[[], object], bound: Sequence[BoundLoad]) -> float:
    """Least time of a call of opaque laws, whose state is kept [s]."""
    each = list[float]()
    with ExitStack() as kept:
        for law in (law for one in bound for law in one.laws):
            kept.enter_context(preserved(law))
        call()  # the first one may compile
        while len(each) < MOST_CALLS and sum(each) < MEASURING_TIME:
            begin = time.perf_counter()
            call()
            each.append(time.perf_counter() - begin)
    return min(each)
