"""Reduction of a system to the subsystems that are integrated: the passes one after the other, with their reasons."""

from typing import NamedTuple

from gauss.system.passes import PASSES
from gauss.system.subsystem import Subsystem, whole


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
