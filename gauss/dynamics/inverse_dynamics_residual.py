"""The bodies asked about accelerations: which forces along the joints are out of balance when these accelerate so.

Outward along the spanning tree the rows A a + B q̈ = D give the accelerations of the bodies, inward stationarity
Φ a + Aᵀλ = Φ a_free gives the multipliers; what is left is Bᵀλ = P. This is the recursion of Newton and Euler (Luh, Walker,
Paul 1980) on the scene as it is written: nothing is reduced or regrouped, and no axes move but those of the bodies.
"""

import numpy as np

from gauss.dynamics.assemble import impressed
from gauss.dynamics.constraint_rows import joint_rows
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.loads import Applied
from gauss.rotations import cross


def inverse_dynamics_residual(motion: Kinematics, applied: Applied, rates) -> np.ndarray:
    """Generalised forces (n_v,) of loads, weight and inertia together; numbers or expressions.

    Parameters
    ----------
    motion : Kinematics
        Poses and velocities.
    applied : Applied
        Loads there.
    rates : ndarray, shape (n_v,)
        Joint accelerations.

    Returns
    -------
    ndarray, shape (n_v,)
        Zero where they are the accelerations of a tree that nothing else ties. Joints that close loops exert no force here,
        and their own coordinates are left out.
    """
    system, impelled = motion.system, impressed(motion, applied)
    accelerations, pulls = {-1: (np.zeros(3), np.zeros(3))}, {}
    short = np.zeros(system.n_v, dtype=np.result_type(float, impelled, rates))
    for edge in system.structure.tree:
        joint, at = system.joints[edge.constraint], motion.joints[edge.constraint]
        _, (B,), D = joint_rows(motion, joint, at)
        sign, inner_arm, outer_arm = _sides(edge, joint, at)
        alpha, linear = accelerations[edge.inner]
        across = sign * (D - B @ rates[joint.v])
        outer = alpha + across[:3]
        moved = linear - cross(inner_arm, alpha) + across[3:] + cross(outer_arm, outer)
        accelerations[edge.outer] = outer, moved
        R, place = motion.R[edge.outer], slice(6 * edge.outer, 6 * edge.outer + 6)
        left = impelled[place] - system.Phi[place] * np.concatenate([R.T @ outer, moved])
        pulls[edge.outer] = R @ left[:3], left[3:]
    for edge in reversed(system.structure.tree):
        joint, at = system.joints[edge.constraint], motion.joints[edge.constraint]
        sign, inner_arm, outer_arm = _sides(edge, joint, at)
        moment, force = pulls[edge.outer]
        moment = moment - cross(outer_arm, force)  # about the joint point
        short[joint.v] = applied.P[joint.v] + sign * (at.E_omega.T @ moment + at.E_v.T @ force)
        if edge.inner >= 0:
            other = pulls[edge.inner]
            pulls[edge.inner] = other[0] + moment + cross(inner_arm, force), other[1] + force
    return short


def _sides(edge, joint, at):
    """Whether the tree goes from parent to child, +1, or back, −1; levers of the joint point on the inner and outer body."""
    return (1.0, at.s, at.r) if edge.outer == joint.child else (-1.0, at.r, at.s)
