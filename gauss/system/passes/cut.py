"""Choice of the loop joints: those with most freedoms, which leave fewest loop constraints, then far from the ground.

A joint with a coupling stays in the tree, of whose coordinates couplings are rows.
"""

from dataclasses import replace

from gauss.system.subsystem import Subsystem, spanning_tree


def cut(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Choose the spanning tree with the fewest loop constraints."""
    if not subsystem.loop_joints:
        return [subsystem], []
    coupled = {name for coupling in subsystem.couplings for name in (coupling.driver, coupling.driven)}

    def preference(joint) -> int:
        return joint.pair.n_v - (10 if joint.name in coupled else 0)

    tree = spanning_tree(subsystem.joints, preference)
    better = replace(subsystem, tree=tree)
    names = lambda p: ", ".join(repr(p.joints[i].name) for i in p.loop_joints)  # noqa: E731
    if better.loop_joints == subsystem.loop_joints:
        return [subsystem], []
    return [better], [f"loops are closed by {names(better)} instead of {names(subsystem)}"]
