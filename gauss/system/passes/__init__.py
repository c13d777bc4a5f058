"""Reduction of a system to the subsystems that are integrated, pass after pass.

Each pass turns a subsystem into smaller ones with the same motion, and gives its reasons.
"""

from typing import NamedTuple

from gauss.system.passes.cut import cut, repeated
from gauss.system.passes.islands import islands
from gauss.system.passes.plane import plane, plane_loops
from gauss.system.passes.rigid import rigid
from gauss.system.passes.sphere import sphere
from gauss.system.passes.trains import trains
from gauss.system.passes.weld import weld
from gauss.system.subsystem import Subsystem, whole

__all__ = ["PASSES", "cut", "islands", "plane", "plane_loops", "repeated", "rigid", "sphere", "trains", "weld"]

# Sentence of explain(), and the pass, in the order in which they run.
PASSES = {
    "bodies without relative motion are one": weld,
    "loops that cannot move are rigid bodies": rigid,
    "islands that do not interact are stepped apart": islands,
    "mechanisms in a plane are laid into it": plane,
    "spherical mechanisms have all joints in their centre": sphere,
    "loops are cut at the cheapest joints": cut,
    "loops in a plane are closed by two rows": plane_loops,
    "joints that repeat others bring no rows": repeated,
    "gear and belt trains are one reduced inertia": trains,
}


class Stage(NamedTuple):
    """Subsystems after a pass.

    Attributes
    ----------
    what : str
        What the pass does.
    why : tuple of str
        Its reasons; empty if it changed nothing.
    subsystems : tuple of Subsystem
        The subsystems that remain.
    """

    what: str
    why: tuple[str, ...]
    subsystems: tuple[Subsystem, ...]


def reduction(system) -> tuple[Stage, ...]:
    """Stages from the whole system to the subsystems that are integrated, one a pass."""
    stages = [Stage("the scene as it is written", (), (whole(system),))]
    for what, reduce in PASSES.items():
        smaller = [reduce(subsystem) for subsystem in stages[-1].subsystems]
        subsystems = tuple(subsystem for some, _ in smaller for subsystem in some)
        why = dict.fromkeys(reason for _, reasons in smaller for reason in reasons)
        stages.append(Stage(what, tuple(why), subsystems))
    return tuple(stages)
