"""Which bodies of a scene may sleep in time stepping, and which never do."""

from typing import NamedTuple

from gauss.dynamics.conditions import are_free_in_contact, shapes_in_contact, smooth_question, takes_pair_kernels
from gauss.dynamics.contact.coordinate_groups import bodies_of_groups, coordinate_groups
from gauss.dynamics.contact.shape_table import carriers_of
from gauss.dynamics.rules import Question, reasons_in_words
from gauss.errors import SimulationError, listed

MOST_NAMED = 5  # loads that are named


class Sleepers(NamedTuple):
    """Bodies that joints let move."""

    able: tuple[str, ...]  # those that may sleep
    never: tuple[str, ...]  # others: a law of time or a prescribed motion acts on them, or on what they are connected with


def sleepers(ask: Question) -> Sleepers:
    """Bodies that may sleep in motions of a system, and those that never do.

    Raises
    ------
    SimulationError
        If none may, with the reason.
    """
    system = ask.system
    why = takes_pair_kernels(ask) if shapes_in_contact(ask) else ["it has no contacts of shapes"]
    if why:
        raise SimulationError(
            f"sleeping: bodies sleep in steps by kernels of pairs of shapes, which do not take {system.scene.name!r}: "
            f"{reasons_in_words(why)}; give no sleeping=."
        )
    if are_free_in_contact(system) and not ask.held:
        moving = {joint.child for joint in system.joints if joint.pair.n_v}
        return Sleepers(tuple(name for k, name in enumerate(system.structure.bodies) if k in moving), ())
    return _of_trees(ask)


def _of_trees(ask: Question) -> Sleepers:
    """Bodies of mechanisms."""
    smooth = smooth_question(ask)
    if smooth.laws.called:
        raise SimulationError(
            f"sleeping: the laws of {listed(smooth.laws.reasons, MOST_NAMED)} are opaque, and may change whatever moves: "
            "expected laws that can be traced; write them with gauss.math, or give no sleeping=."
        )
    groups = coordinate_groups(ask.system, smooth.system, carriers_of(ask.system), ask.held)
    timed = dict[str, bool]()
    for bodies, which in zip(bodies_of_groups(smooth.system, groups), groups.timed.tolist(), strict=True):
        timed |= dict.fromkeys(bodies, which)
    moving = [name for name in ask.system.scene.bodies if name in timed]
    return Sleepers(
        tuple(name for name in moving if not timed[name]),
        tuple(name for name in moving if timed[name]),
    )
