"""Islands: bodies that no joint, coupling or relation connects, except by the ground, are subsystems of their own.

Springs and forces between islands do not couple accelerations.
"""

from dataclasses import replace
from itertools import chain, pairwise

from gauss.linked_groups import linked_groups
from gauss.system.placed_elements import PlacedFrame
from gauss.system.subsystem import GROUND, BoundRelation, Subsystem, kept_joints, spanning_tree


def islands(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Split a subsystem into its islands."""
    groups = _groups(subsystem)
    if len(groups) == 1:
        return [subsystem], []
    return [_island(subsystem, group) for group in groups], [f"{len(groups)} islands share nothing but the ground"]


def _groups(subsystem: Subsystem) -> list[list[int]]:
    """Bodies of each island, in order."""
    bound = [[joint.parent, joint.child] for joint in subsystem.joints]
    bound += [[side for name in (c.driver, c.driven) for side in _sides(subsystem.joint(name))] for c in subsystem.couplings]
    bound += [_bodies(subsystem, relation) for relation in subsystem.relations]
    links = chain.from_iterable(pairwise(body for body in bodies if body != GROUND) for bodies in bound)
    groups: dict[int, list[int]] = {}
    for body, group in enumerate(linked_groups(subsystem.n_bodies, links).tolist()):
        groups.setdefault(group, []).append(body)
    return list(groups.values())


def _bodies(subsystem: Subsystem, relation: BoundRelation) -> list[int]:
    """Bodies of a subsystem that a relation binds, directly or through joints.

    A relation of immovable bodies goes with the first body, which checks its residual.
    """
    bodies = [side for name in relation.joints if subsystem.has(name) for side in _sides(subsystem.joint(name))]
    bodies += [subsystem.carried[body].body for body in relation.bodies]
    return [body for body in bodies if body != GROUND] or [0]


def _sides(joint) -> tuple[int, int]:
    return joint.parent, joint.child


def _carried(subsystem: Subsystem, number: dict[int, int], relations: list[BoundRelation]) -> dict[int, PlacedFrame]:
    """Frames of an island by the body that each carries; of bodies fixed to the ground those that its relations name."""
    named = {body for relation in relations for body in relation.bodies}
    frames = {
        body: frame
        for body, frame in subsystem.carried.items()
        if body in named or (frame.body in number and frame.body != GROUND)
    }
    return {body: PlacedFrame(number[frame.body], frame.R, frame.p) for body, frame in frames.items()}


def _island(subsystem: Subsystem, bodies: list[int]) -> Subsystem:
    number = {body: i for i, body in enumerate(bodies)} | {GROUND: GROUND}
    joints = [j for j in subsystem.joints if j.parent in number and j.child in number]
    joints = [replace(j, parent=number[j.parent], child=number[j.child]) for j in joints]
    relations = [relation for relation in subsystem.relations if set(_bodies(subsystem, relation)) & set(bodies)]
    smaller = replace(
        subsystem,
        relations=tuple(relations),
        names=tuple(subsystem.names[body] for body in bodies),
        Phi=subsystem.Phi.reshape(-1, 6)[bodies].ravel(),
        carried=_carried(subsystem, number, relations),
    )
    smaller = kept_joints(smaller, joints)
    return replace(smaller, tree=spanning_tree(smaller.joints))
