"""Rigid loops, such as a triangle of rods, become rigid bodies.

A loop whose joints admit no relative velocity at the reference configuration, where it is assembled, cannot move: rigidity
at first order implies rigidity. A loop that can move at first order is left as it is.
"""

import numpy as np

from gauss.rotations import cross
from gauss.system import frames
from gauss.system.passes.weld import follow, welded
from gauss.system.subsystem import GROUND, Subsystem

RIGID_LOOP = 1e-9  # smallest singular value of the unit twists of a rigid loop, relative to the largest


def rigid(part: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Weld the bodies of every loop that cannot move, until there is no such loop any more."""
    reasons = []
    while (loop := _rigid_loop(part)) is not None:
        names = [part.joints[i].name for i in loop]
        reasons.append(f"the loop of {', '.join(map(repr, names))} leaves its joints no freedom")
        part = welded(part, follow(part, {name: np.array(part.joint(name).pair.reference) for name in names}))
        if not part.joints:
            return [], reasons
    return [part], reasons


def _rigid_loop(part: Subsystem) -> list[int] | None:
    """Joints of a loop that cannot move."""
    poses = _reference(part)
    for closing in part.closing:
        loop = _loop(part, closing)
        twists = np.concatenate([_twists(part, index, poses) for index in loop], axis=1)
        twists[3:] /= part.size or 1.0
        sizes = np.linalg.svd(twists / np.linalg.norm(twists, axis=0), compute_uv=False)
        if twists.shape[1] <= 6 and sizes.size and sizes.min() > RIGID_LOOP * sizes.max():
            return loop
    return None


def _loop(part: Subsystem, closing: int) -> list[int]:
    """Joints of the loop that a joint closes in the tree."""
    inward = {edge.outer: edge for edge in part.tree}

    def path(body: int) -> list[int]:
        found = []
        while body != GROUND:
            found.append(inward[body].constraint)
            body = inward[body].inner
        return found

    one, other = path(part.joints[closing].parent), path(part.joints[closing].child)
    return [closing, *(set(one) ^ set(other))]


def _reference(part: Subsystem) -> dict[int, frames.Pose]:
    """World poses of the central frames at the reference configuration."""
    poses = {GROUND: frames.IDENTITY}
    for edge in part.tree:
        joint = part.joints[edge.constraint]
        parent, child = (joint.R_parent, joint.p_parent), (joint.R_child, joint.p_child)
        across = joint.pair.pose(np.array(joint.pair.reference))
        if edge.outer == joint.child:
            relative = frames.compose(frames.compose(parent, across), frames.invert(child))
        else:
            relative = frames.compose(frames.compose(child, frames.invert(across)), frames.invert(parent))
        poses[edge.outer] = frames.compose(poses[edge.inner], relative)
    return poses


def _twists(part: Subsystem, index: int, poses) -> np.ndarray:
    """Velocities (6, k) that a joint allows at the reference configuration: rotation, and motion of the world's origin."""
    joint = part.joints[index]
    R, p = frames.compose(poses[joint.parent], (joint.R_parent, joint.p_parent))
    E_omega, E_v = joint.pair.subspace(np.array(joint.pair.reference))
    _, point = joint.pair.pose(np.array(joint.pair.reference))
    omega, at = R @ E_omega, p + R @ point
    linear = R @ E_v - np.array([cross(column, at) for column in omega.T]).T.reshape(3, -1)
    return np.concatenate([omega, linear])
