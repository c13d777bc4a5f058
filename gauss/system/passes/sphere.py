"""Spherical mechanisms: all axes meet in one point, which stays where it is in every body.

Every joint can be placed in that point. No lever is left, and the rows of translation of all joints say 0 = 0.
"""

from collections import deque
from dataclasses import replace

import numpy as np

from gauss.system.placed_elements import PlacedJoint
from gauss.system.subsystem import Subsystem

MEETING = 1e-12  # distance from the centre at which an axis still goes through it, relative to the places of joints
KINDS = frozenset({"revolute", "universal", "ball"})


def sphere(part: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Place the joints of a spherical mechanism in its centre; leave any other as it is."""
    centres = _centres(part)
    if centres is None:
        return [part], []
    joints = tuple(replace(j, p_parent=centres[j.parent], p_child=centres[j.child]) for j in part.joints)
    dead = {(i, axis) for i in range(len(joints)) for axis in (3, 4, 5)}
    point = " ".join(f"{entry:.3g}" for entry in centres.get(-1, np.zeros(3)) + 0.0)
    return [replace(part, joints=joints, redundant=part.redundant | dead)], [f"all axes meet in the point ({point})"]


def _centres(part: Subsystem) -> dict[int, np.ndarray] | None:
    """The common point in the central frame of every body and in world; None if there is none."""
    if part.redundant or any(joint.pair.kind not in KINDS for joint in part.joints):
        return None
    beside: dict[int, list[PlacedJoint]] = {}
    for joint in part.joints:
        beside.setdefault(joint.parent, []).append(joint)
        beside.setdefault(joint.child, []).append(joint)
    seed = next(((body, point) for body, joints in beside.items() if (point := _meeting(body, joints)) is not None), None)
    if seed is None:
        return None
    centres, waiting = {seed[0]: seed[1]}, deque([seed[0]])
    while waiting:
        body = waiting.popleft()
        for joint in beside[body]:
            (R, p), (R_other, p_other) = _sides(joint, body)
            along = R.T @ (centres[body] - p)
            free = 2 if joint.pair.kind == "revolute" else 3
            if np.abs(along[:free]).max() > MEETING * part.size:
                return None
            shift = np.array([0.0, 0.0, along[2]]) if free == 2 else np.zeros(3)
            other = joint.child if body == joint.parent else joint.parent
            found = p_other + R_other @ shift
            if other not in centres:
                centres[other] = found
                waiting.append(other)
            elif np.abs(centres[other] - found).max() > MEETING * part.size:
                return None
    return centres


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
        # nearest point of two lines: each projector takes away what lies along its axis
        projectors = [np.eye(3) - np.outer(axis, axis) for axis in (lines[0][1], z)]
        total = projectors[0] + projectors[1]
        if np.linalg.norm(np.cross(lines[0][1], z)) > np.sqrt(MEETING):
            return np.linalg.solve(total, projectors[0] @ lines[0][0] + projectors[1] @ p)
    return None
