"""Loop joints: those with most freedoms, which leave fewest loop constraints, then far from the ground.

A joint with a coupling stays in the tree, of whose coordinates couplings are rows. Where the tree would end in a link
without inertia, whose acceleration the tree alone does not determine, the joints of such links stay in it, too.

A joint that repeats another between the same two bodies adds no constraint: a door on two hinges is the usual case. Its
coordinate stays, its rows are dropped. Rows that special dimensions make redundant (a third parallel crank) stay: the
proximal iterations of the forward dynamics converge with them.
"""

from dataclasses import replace

import numpy as np

from gauss.backends.structure import GROUND, Edge
from gauss.system.placed_elements import PlacedJoint
from gauss.system.subsystem import Subsystem, spanning_tree

SAME_AXIS = 1e-12  # sine of the angle between two axes, and their distance relative to the subsystem, of one axis


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


def repeated(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Mark the rows of joints that repeat others as redundant."""
    in_tree = {edge.constraint for edge in subsystem.tree}
    order = sorted(range(len(subsystem.joints)), key=lambda i: (i not in in_tree, i))
    between: dict[frozenset, list[PlacedJoint]] = {}
    rows, reasons = set(), []
    for index in order:
        joint = subsystem.joints[index]
        others = between.setdefault(frozenset((joint.parent, joint.child)), [])
        first = next((other for other in others if _repeats(joint, other, SAME_AXIS * subsystem.size)), None)
        others.append(joint)
        if first is not None:
            rows |= {(index, axis) for axis in _constrained_axes(joint)}
            reasons.append(f"joint {joint.name!r} repeats {first.name!r}")
    return [replace(subsystem, redundant=subsystem.redundant | rows)], reasons


def _constrained_axes(joint: PlacedJoint) -> list[int]:
    """Axes that a joint with a constant motion subspace constrains."""
    free = np.abs(np.concatenate(joint.pair.subspace(np.array(joint.pair.reference)))).sum(axis=1) > 0
    return [axis for axis in range(6) if not free[axis]]


def _repeats(joint: PlacedJoint, other: PlacedJoint, near: float) -> bool:
    """Whether two joints allow the same motion between the same two bodies, their axes no farther apart than is near [m]."""
    if joint.pair.kind != other.pair.kind or joint.pair.kind not in ("revolute", "prismatic", "cylindrical"):
        return False
    if (joint.parent, joint.child) == (other.parent, other.child):
        pairs = [("parent", "parent"), ("child", "child")]
    elif (joint.parent, joint.child) == (other.child, other.parent):
        pairs = [("parent", "child"), ("child", "parent")]
    else:
        return False
    return all(_same_line(joint, mine, other, theirs, near) for mine, theirs in pairs)


def _same_line(joint: PlacedJoint, mine: str, other: PlacedJoint, theirs: str, near: float) -> bool:
    (R, p), (R_other, p_other) = ((getattr(j, f"R_{s}"), getattr(j, f"p_{s}")) for j, s in ((joint, mine), (other, theirs)))
    turned = np.abs(np.cross(R[:, 2], R_other[:, 2])).max()
    aside = 0.0 if joint.pair.kind == "prismatic" else np.abs(np.cross(R[:, 2], p_other - p)).max()
    return bool(turned <= SAME_AXIS and aside <= near)
