"""Constraint rows A v + B q̇ = C of joints and couplings, and their derivative A a + B q̈ = D.

Six rows for every pair, about the joint point P fixed in the child:

    R_c ω_c − R_p ω_p − E_ω q̇ = 0
    ẋ_c + W_c × r − ẋ_p − W_p × s − E_v q̇ = 0
"""

import numpy as np

from gauss.dynamics.kinematics import JointMotion, Kinematics
from gauss.rotations import cross, skew, to_rotation_vector
from gauss.system import PlacedJoint

ONE = np.eye(3)


def joint_rows(motion: Kinematics, joint: PlacedJoint, at: JointMotion):
    """Blocks of A for the bodies of a joint, block of B, and D (6,)."""
    p, c = joint.parent, joint.child
    blocks = []
    for body, arm, sign in ((p, at.s, -1.0), (c, at.r, 1.0)):
        if body >= 0:
            blocks.append(sign * _block(motion.R[body], arm))
    B = -np.concatenate([at.E_omega, at.E_v])
    rates = motion.state.v[joint.v]
    W_p, W_c = motion.W[p], motion.W[c]
    D_omega = cross(W_p, at.E_omega @ rates) + at.bias_omega
    D_v = cross(W_p, cross(W_p, at.s)) - cross(W_c, cross(W_c, at.r)) + 2.0 * cross(W_p, at.E_v @ rates) + at.bias_v
    return tuple(blocks), (B,), np.concatenate([D_omega, D_v])


def _block(R: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """[R, 0; −[arm]× R, 1]."""
    block = np.zeros((6, 6), dtype=np.result_type(R, arm))
    block[:3, :3], block[3:, :3], block[3:, 3:] = R, -skew(arm) @ R, ONE
    return block


def joint_rate_residual(motion: Kinematics, joint: PlacedJoint, at: JointMotion) -> np.ndarray:
    """Velocity residual A v + B q̇ (6,) of :func:`joint_rows` [rad/s, m/s]."""
    p, c = joint.parent, joint.child
    rates, W_p, W_c = motion.state.v[joint.v], motion.W[p], motion.W[c]
    linear = motion.u[c] + cross(W_c, at.r) - motion.u[p] - cross(W_p, at.s)
    return np.concatenate([W_c - W_p - at.E_omega @ rates, linear - at.E_v @ rates])


def joint_residual(motion: Kinematics, joint: PlacedJoint, at: JointMotion) -> np.ndarray:
    """Pose of the child relative to its pose by parent and coordinates (6,): rotation vector [rad], distance [m]."""
    R_actual = motion.R[joint.child] @ joint.R_child
    angular = to_rotation_vector(R_actual @ at.R_predicted.T)
    return np.concatenate([angular, at.P - motion.x[joint.parent] - at.s])


def joint_distance(motion: Kinematics, joint: PlacedJoint, at: JointMotion) -> np.ndarray:
    """Smooth measure of the same (4,): twice the sine of half the angle, components of the distance."""
    off = (motion.R[joint.child] @ joint.R_child - at.R_predicted).ravel()
    return np.array([np.sqrt(off @ off / 2.0), *(at.P - motion.x[joint.parent] - at.s)])
