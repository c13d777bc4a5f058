"""Kernels of one link for call graphs: steps of the articulated-body and Newton–Euler recursions.

Each takes the link, the pair of the joint to its inner link, whether the link is the child there, and vectors of the link
and its neighbours.
"""

import numpy as np

from gauss.dynamics.aba import Elimination, add, blocks, eliminate, inertia_to_inner
from gauss.dynamics.rnea import JointKinematics, force_to_inner, gyroscopic, inertial, kinematics_of_joint, to_outer
from gauss.dynamics.tree_recursion import UPPER, symmetric


def _kinematics(R, p, S, bias=None) -> JointKinematics:
    return JointKinematics(R, p, S, np.zeros(6) if bias is None else bias)


def forward_kinematics(link, pair, forward, q, v, inner):
    """Kinematics of the joint, angular velocity and bias force of the link."""
    kin, omega = kinematics_of_joint(pair, forward, link, q, v, inner)
    return *kin, omega, gyroscopic(link, omega)


def pose(link, pair, forward, q, inner):
    """Pose (12,) of the link in world: rotation and origin."""
    kin, _ = kinematics_of_joint(pair, forward, link, q, np.zeros(pair.n_v), np.zeros(3))
    R, x = inner[:9].reshape(3, 3), inner[9:]
    R_here = R @ link.R @ kin.R
    return (np.concatenate([R_here.ravel(), x + R @ (link.p + link.R @ kin.p)]),)


def eliminate_link(link, pair, forward, R, p, S, collected, inner):
    """Elimination of the joint, and the articulated inertia of the inner link with the share of this one."""
    kin = _kinematics(R, p, S)
    found = eliminate(kin, add(link.inertia, _inertia(collected)))
    moved = add(_inertia(inner), inertia_to_inner(link, kin, found.projected))
    return found.U, found.D_inverse, _flat(found.projected), _flat(moved)


def _inertia(numbers):
    A, B, C = np.split(numbers, [6, 15])
    return symmetric(A), B.reshape(3, 3), symmetric(C)


def _flat(inertia) -> np.ndarray:
    A, B, C = inertia
    return np.concatenate([A[UPPER], B.ravel(), C[UPPER]])


def add_to_inertia(collected, H, across):
    """Articulated inertia with the product H (6, m) across (m, 6) added, one share of a symmetric sum."""
    return collected + _flat(blocks(H @ across))


def row_inward(link, pair, forward, R, p, S, U, D_inverse, wrenches, forces):
    """Joint forces u (k, m) of wrenches (6, m) on the link and forces (k, m) along the joint; wrenches on the inner link."""
    kin, eliminated = _kinematics(R, p, S), Elimination(U, D_inverse, (np.zeros((3, 3)),) * 3)
    joint_forces, onward = [], []
    for wrench, tau in zip(wrenches.T, forces.T, strict=True):
        u, passed = eliminated.force_inward(kin, -wrench, np.zeros(6), tau)
        joint_forces.append(u)
        onward.append(-force_to_inner(link, kin, passed))
    return np.array(joint_forces, dtype=object).T, np.array(onward, dtype=object).T


def force(link, pair, forward, R, p, S, U, D_inverse, projected, own, bias, tau, inner):
    """Joint force u = τ − Sᵀ p, and the bias force of the inner link with the share of this one."""
    kin, eliminated = _kinematics(R, p, S, bias), Elimination(U, D_inverse, _inertia(projected))
    u, passed = eliminated.force_inward(kin, own, bias, tau)
    return u, inner + force_to_inner(link, kin, passed)


def acceleration(link, pair, forward, R, p, S, U, D_inverse, u, bias, inner):
    """Accelerations of the joint and the link."""
    kin, eliminated = _kinematics(R, p, S, bias), Elimination(U, D_inverse)
    return eliminated.acceleration_outward(kin, u, to_outer(link, kin, inner) + bias)


def link_acceleration(link, pair, forward, R, p, S, bias, rates, inner):
    """Acceleration of the link, given that of the joint."""
    kin = _kinematics(R, p, S, bias)
    return (to_outer(link, kin, inner) + bias + S @ rates,)


def residual_force(link, pair, forward, R, p, S, omega, acceleration, external, tau, inner):
    """Residual τ − Sᵀ f of the joint force by inverse dynamics, and the wrench of the inner link."""
    kin, force = _kinematics(R, p, S), inertial(link, omega, acceleration) + external
    return tau - S.T @ force, inner + force_to_inner(link, kin, force)
