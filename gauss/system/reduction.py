"""A system reduced to what is stepped: the passes one after the other, and what each of them did."""

from typing import NamedTuple

from gauss.system.passes import PASSES
from gauss.system.subsystem import Subsystem, whole


class Stage(NamedTuple):
    """Parts after a pass.

    Attributes
    ----------
    what : str
        What the pass does.
    why : tuple of str
        What it found; empty if it changed nothing.
    parts : tuple of Part
        The parts that are left.
    """

    what: str
    why: tuple[str, ...]
    parts: tuple[Subsystem, ...]


def reduction(system) -> tuple[Stage, ...]:
    """Stages from the whole system to the parts that are stepped, passes that found nothing included."""
    stages = [Stage("the scene as it is written", (), (whole(system),))]
    for what, reduce in PASSES.items():
        smaller = [reduce(part) for part in stages[-1].parts]
        parts = tuple(part for some, _ in smaller for part in some)
        why = dict.fromkeys(reason for _, reasons in smaller for reason in reasons)
        stages.append(Stage(what, tuple(why), parts))
    return tuple(stages)
