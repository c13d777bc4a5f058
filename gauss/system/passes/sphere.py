"""Spherical mechanisms: all axes meet in one point, which is fixed in every body.

Every joint can be placed in that point. No lever arms are left, and the translational rows of all joints are 0 = 0.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from gauss.system.passes.propagation import neighbours, propagated
from gauss.system.placed_elements import PlacedJoint
from gauss.system.subsystem import Subsystem

SAME_CENTRE = 1e-12  # distance of an axis from the centre, relative to the positions of joints
SPHERICAL_KINDS = frozenset({"revolute", "universal", "ball"})


def sphere(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Place the joints of a spherical mechanism in its centre; leave any other as it is."""
    centres = _centres(subsystem)
    if centres is None:
        return [subsystem], []
    joints = tuple(replace(j, p_parent=centres[j.parent], p_child=centres[j.child]) for j in subsystem.joints)
    trivial = {(i, axis) for i in range(len(joints)) for axis in (3, 4, 5)}
    point = " ".join(f"{entry:.3g}" for entry in centres.get(-1, np.zeros(3)) + 0.0)
    return [replace(subsystem, joints=joints, redundant=subsystem.redundant | trivial)], [
        f"all axes meet in the point ({point})"
    ]


def _centres(subsystem: Subsystem) -> dict[int, np.ndarray] | None:
    """The common point in the central frame of every body and in world; None if there is none."""
    if subsystem.redundant or any(joint.pair.kind not in SPHERICAL_KINDS for joint in subsystem.joints):
        return None
    beside, tolerance = neighbours(subsystem.joints), SAME_CENTRE * subsystem.size
    seed = next(((body, point) for body, joints in beside.items() if (point := _meeting(body, joints)) is not None), None)
    if seed is None:
        return None
    return propagated(subsystem.joints, seed, partial(_centre_beyond, tolerance), tolerance)


def _centre_beyond(tolerance: float, joint: PlacedJoint, body: int, centre: np.ndarray) -> np.ndarray | None:
    """Centre in the other body of a joint; None if it does not lie on the axes of the joint."""
    (R, p), (R_other, p_other) = _sides(joint, body)
    along = R.T @ (centre - p)
    free = 2 if joint.pair.kind == "revolute" else 3
    if np.abs(along[:free]).max() > tolerance:
        return None
    return p_other + R_other @ (np.array([0.0, 0.0, along[2]]) if free == 2 else np.zeros(3))


def _sides(joint: PlacedJoint, body: int):
    sides = [(joint.R_parent, joint.p_parent), (joint.R_child, joint.p_child)]
    return sides if body == joint.parent else sides[::-1]


def _meeting(body: int, joints: list[PlacedJoint]) -> np.ndarray | None:
    """Point that the joints of one body determine: that of a ball, or where two axes come closest."""
    lines = []
    for joint in joints:
        (R, p), _ = _sides(joint, body)
        if joint.pair.kind != "revolute":
            return p
        lines.append((p, R[:, 2]))
    for p, z in lines[1:]:
        # nearest point of two lines: each projector removes the component along its axis
        projectors = [np.eye(3) - np.outer(axis, axis) for axis in (lines[0][1], z)]
        total = projectors[0] + projectors[1]
        if np.linalg.norm(np.cross(lines[0][1], z)) > np.sqrt(SAME_CENTRE):
            return np.linalg.solve(total, projectors[0] @ lines[0][0] + projectors[1] @ p)
    return None
