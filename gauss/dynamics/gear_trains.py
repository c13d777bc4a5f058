"""Gear trains: joints with proportional rates, coupled by links with losses.

Losses depend on the direction of motion, and hold a train at rest like Coulomb friction. Joints of an ideal train follow its
first one, q_i = r_i q_1 + o_i and q̇_i = r_i q̇_1: the recursion has one acceleration for a train, but every coordinate is a
sum of its own, whose round-off grows with time; after each step those of the other joints follow from the first.
"""

from typing import NamedTuple

import numpy as np

from gauss.scene import LossyGear, Scene
from gauss.system import State, System


class GearTrain(NamedTuple):
    """Joints whose rates are proportional."""

    root: str  # joint whose direction of motion is that of the train
    rates: dict[str, float]  # rate of every joint over that of the root


def gear_trains(scene: Scene) -> list[GearTrain]:
    """Gear trains of a scene that drive links with losses."""
    found: list[GearTrain] = []
    for link in scene.losses.values():
        if not any(link.driver in train.rates for train in found):
            found.append(GearTrain(link.driver, _rates(scene, link.driver)))
    return found


def _rates(scene: Scene, root: str) -> dict[str, float]:
    links = [(coupling.driven, coupling.driver, coupling.ratio) for coupling in scene.couplings.values()]
    gears = [relation for relation in scene.relations.values() if isinstance(relation, LossyGear)]
    links += [(gear.driven, gear.driver, -gear.acts_on[gear.driver]) for gear in gears]
    rates, waiting = {root: 1.0}, [root]
    while waiting:
        joint = waiting.pop()
        for driven, driver, rate in links:
            for one, other, factor in ((driver, driven, rate), (driven, driver, 1.0 / rate if rate else 0.0)):
                if one == joint and other not in rates and factor:
                    rates[other] = rates[joint] * factor
                    waiting.append(other)
    return rates


class Follower(NamedTuple):
    """A joint of a gear train but the first."""

    q: int  # q, v: places of its coordinate and rate
    v: int
    first_q: int  # first_q, first_v: those of the first joint
    first_v: int
    ratio: float  # q is the ratio times that of the first joint,
    offset: float  # plus the offset


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
