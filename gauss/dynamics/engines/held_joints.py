"""Joints that a phase of a motion holds or brakes, by closed stops and by dry friction: rows q̇ = 0, and constant forces.

They change from phase to phase; what they act on does not, and its machine code is shared by all phases.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from gauss.scene import ClosedGap, JointFriction, Stop
from gauss.system import ContactMode, System, sides

LEAST_FRICTIONS = 3  # elements with more modes (3^n) than are worth machine code of their own


class HeldJoint(NamedTuple):
    """Closed stop or sticking friction of a joint coordinate of one freedom: the row ± q̇ = 0."""

    name: str  # name of the gap, or of the friction
    v: int  # place of the coordinate in v
    sign: float = 1.0  # the gap is sign · (q − bound)
    # place of the coordinate in q, and bound [rad, m]; None for friction, which holds any position
    stop: tuple[int, float] | None = None


def closed_stop(system: System, gap: ClosedGap) -> HeldJoint | None:
    """Closed stop of a gap; None if its row is not constant."""
    if not isinstance(gap.whole, Stop):
        return None
    placed, rate = system.coordinate(gap.whole.joint)
    if rate is not None or placed.v.stop - placed.v.start != 1 or placed.q.stop - placed.q.start != 1:
        return None
    sign, bound = gap.whole.bounds[gap.index]
    return HeldJoint(gap.name, placed.v.start, sign, (placed.q.start, bound))


def shared_frictions(whole: System) -> dict[str, JointFriction]:
    """Dry frictions of constant limit whose modes share machine code, by name: those of trees, where they are many."""
    found = {
        name: one for name, one in whole.scene.set_valued.items() if type(one) is JointFriction and not callable(one.limit)
    }
    shares = len(found) >= LEAST_FRICTIONS and not whole.closes and not whole.scene.losses
    return found if shares else {}


def held_joints(
    whole: System, names: Collection[str], mode: ContactMode, frictions: Mapping[str, JointFriction]
) -> list[HeldJoint]:
    """Joints that are held in a mode: at the stops among closed gaps of these names, and where frictions stick."""
    stops = [closed_stop(whole, gap) for gap in sides(whole.scene) if gap.name in names]
    sticking = [name for name in frictions if mode.set_valued.get(name) == 0]
    found = [HeldJoint(name, whole.column(frictions[name].joint)) for name in sticking]
    return [stop for stop in stops if stop is not None] + found


def braking(whole: System, mode: ContactMode, frictions: Mapping[str, JointFriction]) -> np.ndarray:
    """Generalised forces (n_v,) of the frictions that slip in a mode [N m, N]."""
    forces = np.zeros(whole.n_v)
    for name, one in frictions.items():
        forces[whole.column(one.joint)] += mode.set_valued.get(name, 0) * one.limit
    return forces
