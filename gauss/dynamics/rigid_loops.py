"""Loops that cannot move are reduced to rigid bodies in the pose of the reference configuration.

A structure may have several poses, as two rods between two points and their mirror image. A state in another one is no state
of the reduced system.
"""

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.errors import StateError
from gauss.system import System, coordinate_units

OTHER_POSE = 1e-3  # difference of coordinates, relative to the units of the scene, above the accuracy of assembled loops


def pose_difference(system: System, q) -> Scalar:
    """Sum of the squared relative differences of coordinates of :attr:`System.rigid_joints` to the reference configuration.

    Of coordinates (n_q,), or of many states in columns (n_q, k).
    """
    total, reference, units = 0.0, system.reference.q, list(coordinate_units(system).values())
    for name in system.rigid_joints:
        joint = system.joint(name)
        turned = system.quaternions.get(name, slice(0))
        if turned.stop:
            total = total + 1.0 - (q[turned].T @ reference[turned]) ** 2
        for k in range(joint.q.start, turned.start if turned.stop else joint.q.stop):
            off = q[k] - reference[k]
            turns = units[k] == "rad" and joint.pair.kind != "screw"
            total = total + (2.0 - 2.0 * math.cos(off) if turns else (off / system.scale.length) ** 2)
    return total


def is_in_other_pose(system: System, q):
    """Whether a rigid loop has another pose than in the reference configuration; a condition over symbols."""
    return pose_difference(system, q) > OTHER_POSE**2


def refused_in_other_pose(system: System, q, values: np.ndarray) -> np.ndarray:
    """Values of the reduced system, numbers or symbols; NaN where a rigid loop has another pose than it has there."""
    return math.where(is_in_other_pose(system, q), np.nan, values) if system.rigid_joints else values


def refuse_other_pose(system: System, q):
    """Raise a StateError if a rigid loop has another pose than in the reference configuration, in any column of q."""
    joints = system.rigid_joints
    if joints and np.any(is_in_other_pose(system, q)):
        raise StateError(
            f"joints {', '.join(map(repr, joints))} cannot move, and their loops are rigid bodies in the pose of the scene; "
            "the state has another pose of them: give the scene its bodies in that pose."
        )
