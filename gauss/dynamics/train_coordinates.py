"""Coordinates along ideal gear trains: q_i = r_i q_1 + o_i and q̇_i = r_i q̇_1, as the first joint of the train moves.

The recursion has one acceleration for a train, but every coordinate is a sum of its own, whose round-off grows with time.
After each step those of the other joints follow from the first.
"""

from typing import NamedTuple

import numpy as np

from gauss.system import State, System


class Follower(NamedTuple):
    """A joint of a gear train but the first: places of its coordinate and rate, and of those of the first joint."""

    q: int
    v: int
    first_q: int
    first_v: int
    ratio: float
    offset: float


def followers(system: System) -> list[Follower]:
    """Joints of gear trains but the first of each."""
    found = []
    for one in system.subsystems:
        for train in one.trains:
            (q, v), *others = ((int(one.q[one.joints[k].q.start]), int(one.v[one.joints[k].v.start])) for k in train.joints)
            for places, ratio, offset in zip(others, train.ratios[1:], train.offsets[1:], strict=True):
                found.append(Follower(*places, q, v, ratio, offset))
    return found


def on_trains(system: System, state: State) -> State:
    """State whose gear trains follow their first joints."""
    moved = followers(system)
    if not moved:
        return state
    q, v = np.array(state.q), np.array(state.v)
    for joint in moved:
        q[joint.q] = joint.ratio * q[joint.first_q] + joint.offset
        v[joint.v] = joint.ratio * v[joint.first_v]
    return State(state.t, q, v)
