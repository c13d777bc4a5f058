"""Rigid loops, such as a triangle of rods, become rigid bodies.

A loop whose joints admit no relative velocity at the reference configuration, where it is assembled, cannot move: rigidity
at first order implies rigidity. A loop that can move at first order is left as it is, and so is one that is not assembled
at the reference configuration.
"""

import numpy as np

from gauss.rotations import cross
from gauss.system import frames
from gauss.system.passes.weld import follow, welded
from gauss.system.subsystem import GROUND, Subsystem

CLOSED = 1e-6  # rad, and relative to the size of the subsystem: frames of a closed loop with 7 digits
RIGID_LOOP = 1e-9  # smallest singular value of the unit twists of a rigid loop, relative to the largest


def rigid(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Weld the bodies of every loop that cannot move, until there is no such loop any more."""
    reasons = []
    while (loop := _rigid_loop(subsystem)) is not None:
        names = [subsystem.joints[i].name for i in loop]
        reasons.append(f"the loop of {', '.join(map(repr, names))} leaves its joints no freedom")
        subsystem = welded(
            subsystem, follow(subsystem, {name: np.array(subsystem.joint(name).pair.reference) for name in names})
        )
        if not subsystem.joints:
            return [], reasons
    return [subsystem], reasons


def _rigid_loop(subsystem: Subsystem) -> list[int] | None:
    """Joints of a loop that cannot move."""
    poses = _reference(subsystem)
    for loop_joint in subsystem.loop_joints:
        if not _is_closed(subsystem, loop_joint, poses):
            continue
        loop = loop_of(subsystem, loop_joint)
        twists = np.concatenate([_twists(subsystem, index, poses) for index in loop], axis=1)
        twists[3:] /= subsystem.size or 1.0
        sizes = np.linalg.svd(twists / np.linalg.norm(twists, axis=0), compute_uv=False)
        if twists.shape[1] <= 6 and sizes.size and sizes.min() > RIGID_LOOP * sizes.max():
            return loop
    return None


def _is_closed(subsystem: Subsystem, loop_joint: int, poses) -> bool:
    """Whether a loop is closed at the reference configuration."""
    joint = subsystem.joints[loop_joint]
    across = joint.pair.pose(np.array(joint.pair.reference))
    R_parent, p_parent = frames.compose(frames.compose(poses[joint.parent], (joint.R_parent, joint.p_parent)), across)
    R_child, p_child = frames.compose(poses[joint.child], (joint.R_child, joint.p_child))
    apart = max(np.abs(R_parent - R_child).max(), np.abs(p_parent - p_child).max() / (subsystem.size or 1.0))
    return bool(apart <= CLOSED)


def loop_of(subsystem: Subsystem, loop_joint: int) -> list[int]:
    """Joints of the loop that a joint closes in the tree."""
    inward = {edge.outer: edge for edge in subsystem.tree}

    def path(body: int) -> list[int]:
        found = []
        while body != GROUND:
            found.append(inward[body].constraint)
            body = inward[body].inner
        return found

    one, other = path(subsystem.joints[loop_joint].parent), path(subsystem.joints[loop_joint].child)
    return [loop_joint, *(set(one) ^ set(other))]


def _reference(subsystem: Subsystem) -> dict[int, frames.Pose]:
    """World poses of the central frames at the reference configuration."""
    poses = {GROUND: frames.IDENTITY}
    for edge in subsystem.tree:
        joint = subsystem.joints[edge.constraint]
        parent, child = (joint.R_parent, joint.p_parent), (joint.R_child, joint.p_child)
        across = joint.pair.pose(np.array(joint.pair.reference))
        if edge.outer == joint.child:
            relative = frames.compose(frames.compose(parent, across), frames.invert(child))
        else:
            relative = frames.compose(frames.compose(child, frames.invert(across)), frames.invert(parent))
        poses[edge.outer] = frames.compose(poses[edge.inner], relative)
    return poses


def _twists(subsystem: Subsystem, index: int, poses) -> np.ndarray:
    """Velocities (6, k) that a joint allows at the reference configuration: rotation, and motion of the world's origin."""
    joint = subsystem.joints[index]
    R, p = frames.compose(poses[joint.parent], (joint.R_parent, joint.p_parent))
    E_omega, E_v = joint.pair.subspace(np.array(joint.pair.reference))
    _, point = joint.pair.pose(np.array(joint.pair.reference))
    omega, at = R @ E_omega, p + R @ point
    linear = R @ E_v - np.array([cross(column, at) for column in omega.T]).T.reshape(3, -1)
    return np.concatenate([omega, linear])
