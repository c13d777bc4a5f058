"""Bodies without relative motion become one rigid body."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss import rotations
from gauss.scene.body import principal_axes
from gauss.system import frames
from gauss.system.placed_elements import PlacedFrame, PlacedJoint
from gauss.system.subsystem import GROUND, Subsystem, kept_joints, spanning_tree

Poses = dict[int, tuple[int, frames.Pose]]  # body → (body that stands for it, its central frame seen from there)


def weld(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Weld the bodies of fixed joints, and of couplings of ratio 0."""
    locked = {joint.name: np.zeros(0) for joint in subsystem.joints if joint.pair.n_v == 0}
    locked |= {coupling.driven: np.array([coupling.offset]) for coupling in subsystem.couplings if coupling.ratio == 0}
    locked = follow(subsystem, locked)
    if not locked:
        return [subsystem], []
    smaller = welded(subsystem, locked)
    reasons = [f"joint {name!r} lets nothing move" for name in locked]
    return [smaller] if smaller.joints else [], reasons


def follow(subsystem: Subsystem, locked: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Joints that are locked with the given ones: the other side of each coupling follows."""
    locked = dict(locked)
    for _ in subsystem.couplings:
        for coupling in subsystem.couplings:
            driver, driven = locked.get(coupling.driver), locked.get(coupling.driven)
            if driver is not None and driven is None:
                locked[coupling.driven] = coupling.ratio * driver + coupling.offset
            elif driven is not None and driver is None and coupling.ratio:
                locked[coupling.driver] = (driven - coupling.offset) / coupling.ratio
    return locked


def welded(subsystem: Subsystem, locked: dict[str, np.ndarray]) -> Subsystem:
    """Subsystem with the bodies on both sides of locked joints welded; joints that thereby cannot move are removed, too.

    ``locked``: coordinates (k,) at which joints are held, by name.
    """
    poses = _poses(subsystem, locked)
    roots = [body for body in range(subsystem.n_bodies) if poses[body][0] == body]
    number = {root: i for i, root in enumerate(roots)} | {GROUND: GROUND}
    centres, Phi = _rigid_bodies(subsystem, poses, roots)

    def moved(body: int, R, p) -> tuple[int, np.ndarray, np.ndarray]:
        """Frame on a body, seen from the central frame of the rigid body that it is welded into."""
        root, pose = poses[body]
        return number[root], *frames.compose(centres[root], frames.compose(pose, (R, p)))

    joints = [_moved_joint(joint, moved) for joint in subsystem.joints]
    carried = {body: PlacedFrame(*moved(frame.body, frame.R, frame.p)) for body, frame in subsystem.carried.items()}
    smaller = replace(subsystem, names=tuple(subsystem.names[root] for root in roots), Phi=Phi, carried=carried)
    return _without_locked(smaller, joints, locked)


def _without_locked(subsystem: Subsystem, joints: list[PlacedJoint], locked: dict[str, np.ndarray]) -> Subsystem:
    """Subsystem with its joints that move, and the coordinates of the others."""
    moving = [joint for joint in joints if joint.name not in locked and joint.parent != joint.child]
    names = {joint.name for joint in moving}
    still = [joint for joint in joints if joint.name not in names and joint.pair.n_v]
    held = {joint.name: tuple(map(float, locked.get(joint.name, joint.pair.reference))) for joint in still}
    subsystem = kept_joints(subsystem, moving)
    return replace(subsystem, tree=spanning_tree(subsystem.joints), held=subsystem.held | held)


def _rigid_bodies(subsystem: Subsystem, poses: Poses, roots: list[int]) -> tuple[dict[int, frames.Pose], np.ndarray]:
    """Of each rigid body: its root's frame seen from its central frame, and its inertias and masses (6n,)."""
    members = {root: [body for body in poses if poses[body][0] == root] for root in roots}
    centres, Phi = {GROUND: frames.IDENTITY}, []
    for root in roots:
        centre, J, mass = _together(subsystem, [(body, poses[body][1]) for body in members[root]])
        centres[root] = frames.invert(centre)
        Phi += [*J, mass, mass, mass]
    return centres, np.array(Phi)


def _moved_joint(joint: PlacedJoint, moved: Callable) -> PlacedJoint:
    """Joint with its frames on the rigid bodies."""
    parent, R_parent, p_parent = moved(joint.parent, joint.R_parent, joint.p_parent)
    child, R_child, p_child = moved(joint.child, joint.R_child, joint.p_child)
    sides = {"R_parent": R_parent, "p_parent": p_parent, "R_child": R_child, "p_child": p_child}
    return replace(joint, parent=parent, child=child, **sides)


def _poses(subsystem: Subsystem, locked) -> Poses:
    """For every body the one that stands for it, the ground or that of least index, and where it sits on it."""
    beside: dict[int, list] = {}
    for joint in subsystem.joints:
        if joint.name in locked:
            across = joint.pair.pose(locked[joint.name]) if joint.pair.n_v else frames.IDENTITY
            on_parent = frames.compose((joint.R_parent, joint.p_parent), across)
            child = frames.compose(on_parent, frames.invert((joint.R_child, joint.p_child)))
            beside.setdefault(joint.parent, []).append((joint.child, child))
            beside.setdefault(joint.child, []).append((joint.parent, frames.invert(child)))
    poses: Poses = {}
    for root in (GROUND, *range(subsystem.n_bodies)):
        if root in poses:
            continue
        poses[root], waiting = (root, frames.IDENTITY), [root]
        while waiting:
            body = waiting.pop()
            for other, pose in beside.get(body, ()):
                if other not in poses:
                    poses[other] = root, frames.compose(poses[body][1], pose)
                    waiting.append(other)
    return poses


def _together(subsystem: Subsystem, members):
    """Principal central frame, principal inertias and mass of bodies at given poses."""
    if len(members) == 1:
        body = members[0][0]
        return frames.IDENTITY, subsystem.Phi[6 * body : 6 * body + 3], subsystem.Phi[6 * body + 3]
    masses = [subsystem.Phi[6 * body + 3] for body, _ in members]
    total = sum(masses)
    com = sum(m * p for m, (_, (_, p)) in zip(masses, members, strict=True)) / total if total else np.zeros(3)
    inertia = np.zeros((3, 3))
    for m, (body, (R, p)) in zip(masses, members, strict=True):
        arm = rotations.skew(p - com)
        inertia += R @ np.diag(subsystem.Phi[6 * body : 6 * body + 3]) @ R.T - m * arm @ arm
    J, axes = principal_axes(inertia)
    return (axes, com), J, total
