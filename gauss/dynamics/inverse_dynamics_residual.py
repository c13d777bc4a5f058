"""Residual P − Bᵀλ of inverse dynamics in body coordinates, with A a + B q̈ = D outward and Φ a + Aᵀλ = Φ a_free inward.

The recursive Newton–Euler algorithm (Luh, Walker, Paul 1980) on the bodies of the scene, without reductions and link frames:
an independent check of compiled forward dynamics.
"""

from collections.abc import Iterator

import numpy as np

from gauss.backends.structure import Edge
from gauss.dynamics.assemble import impressed, joint_rows
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.loads import Applied
from gauss.rotations import cross


def inverse_dynamics_residual(motion: Kinematics, applied: Applied, rates) -> np.ndarray:
    """Residual (n_v,) of the equations of motion under joint accelerations (n_v,): loads, gravity and inertia.

    Numbers or expressions; zero for the accelerations of a tree without loop constraints. Loop joints exert no force here,
    and their coordinates are left out.
    """
    system, wrenches = motion.system, body_residuals(motion, applied, rates)
    parts = [part for wrench in wrenches.values() for part in wrench]
    residual = np.zeros(system.n_v, dtype=np.result_type(float, applied.P, rates, *parts))
    along = along_rates(motion, wrenches)
    for edge in system.structure.tree:
        place = system.joints[edge.constraint].v
        residual[place] = applied.P[place] + along[place]
    return residual


def body_residuals(motion: Kinematics, applied: Applied, rates) -> dict[int, tuple]:
    """Loads, gravity and inertia of each body under joint accelerations (n_v,): what its joints balance, with their drives.

    {body: (moment about the centre of mass, force)} in world axes.
    """
    system, inertial_forces, wrenches = motion.system, impressed(motion, applied), {}
    for edge, outer, moved in outward_accelerations(motion, rates):
        R, place = motion.R[edge.outer], slice(6 * edge.outer, 6 * edge.outer + 6)
        left = inertial_forces[place] - system.Phi[place] * np.concatenate([R.T @ outer, moved])
        wrenches[edge.outer] = R @ left[:3], left[3:]
    return wrenches


def outward_accelerations(motion: Kinematics, rates) -> Iterator[tuple[Edge, np.ndarray, np.ndarray]]:
    """Accelerations of the bodies under those of the joints (n_v,), A a + B q̈ = D outward along the spanning tree.

    The edge of the tree to each body, its angular acceleration, and the acceleration of its centre of mass (3,), in world
    axes; numbers or expressions.
    """
    accelerations = {-1: (np.zeros(3), np.zeros(3))}
    for edge in motion.system.structure.tree:
        joint, at = motion.system.joints[edge.constraint], motion.joints[edge.constraint]
        _, (B,), D = joint_rows(motion, joint, at)
        sign, inner_arm, outer_arm = joint_sides_of(edge, joint, at)
        alpha, linear = accelerations[edge.inner]
        across = sign * (D - B @ rates[joint.v])
        outer = alpha + across[:3]
        moved = linear - cross(inner_arm, alpha) + across[3:] + cross(outer_arm, outer)
        accelerations[edge.outer] = outer, moved
        yield edge, outer, moved


def along_rates(motion: Kinematics, wrenches: dict[int, tuple]) -> np.ndarray:
    """Wrenches on bodies along the rates (n_v,), carried inward along the spanning tree: ±(E_ωᵀ M_P + E_vᵀ F) at joint P.

    The transposed Jacobian (Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 2.10).

    Parameters
    ----------
    motion : Kinematics
        Poses, with the joints.
    wrenches : dict
        {body: (moment about the centre of mass, force)}; the others are zero. Wrenches of outer bodies are added to it.
    """
    system = motion.system
    along = np.zeros(
        system.n_v, dtype=np.result_type(float, *(part for own in wrenches.values() for part in own), *motion.x)
    )
    for edge in reversed(system.structure.tree):
        if edge.outer not in wrenches:
            continue
        joint, at = system.joints[edge.constraint], motion.joints[edge.constraint]
        sign, inner_arm, outer_arm = joint_sides_of(edge, joint, at)
        moment, force = wrenches[edge.outer]
        moment = moment - cross(outer_arm, force)  # about the joint point
        along[joint.v] = sign * (at.E_omega.T @ moment + at.E_v.T @ force)
        if edge.inner >= 0:
            other = wrenches.get(edge.inner, (0.0, 0.0))
            wrenches[edge.inner] = other[0] + moment + cross(inner_arm, force), other[1] + force
    return along


def joint_sides_of(edge, joint, at):
    """Sign +1 if the tree goes from parent to child, else −1; levers of the joint point on the inner and outer body."""
    return (1.0, at.s, at.r) if edge.outer == joint.child else (-1.0, at.r, at.s)
