"""Choice of the loop joints: those with most freedoms, which leave fewest loop constraints, then far from the ground.

A joint with a coupling stays in the tree, of whose coordinates couplings are rows. Where the tree would end in a link
without inertia, whose acceleration the tree alone does not determine, the joints of such links stay in it, too.
"""

from dataclasses import replace

from gauss.backends.structure import GROUND, Edge
from gauss.system.subsystem import Subsystem, spanning_tree


def cut(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Choose the spanning tree with the fewest loop constraints."""
    if not subsystem.loop_joints:
        return [subsystem], []
    coupled = {name for coupling in subsystem.couplings for name in (coupling.driver, coupling.driven)}

    def preference(joint) -> int:
        return joint.pair.n_v - (10 if joint.name in coupled else 0)

    tree = spanning_tree(subsystem.joints, preference)
    if _ends_without_inertia(subsystem, tree):
        idle = set(_without_inertia(subsystem))
        kept_first = lambda joint: preference(joint) - (100 if {joint.parent, joint.child} & idle else 0)  # noqa: E731
        tree = spanning_tree(subsystem.joints, kept_first)
    better = replace(subsystem, tree=tree)
    names = lambda p: ", ".join(repr(p.joints[i].name) for i in p.loop_joints)  # noqa: E731
    if better.loop_joints == subsystem.loop_joints:
        return [subsystem], []
    return [better], [f"loops are closed by {names(better)} instead of {names(subsystem)}"]


def _without_inertia(subsystem: Subsystem) -> list[int]:
    return [body for body in range(subsystem.n_bodies) if not subsystem.Phi[6 * body : 6 * body + 6].any()]


def _ends_without_inertia(subsystem: Subsystem, tree: tuple[Edge, ...]) -> bool:
    """Whether some link of a tree has no inertia, and carries none."""
    carries = {GROUND, *range(subsystem.n_bodies)} - set(_without_inertia(subsystem))
    for edge in reversed(tree):  # outer links first
        if edge.outer not in carries:
            return True
        carries.add(edge.inner)
    return False
