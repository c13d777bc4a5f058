"""Where everything is and how fast it moves: State → Motion, outward along the spanning tree."""

from dataclasses import dataclass

import numpy as np

from gauss.rotations import cross
from gauss.system import PlacedJoint, State, System, View

ORIGIN = np.zeros(3)
AXES = np.eye(3)


@dataclass(frozen=True)
class JointMotion:
    """A joint in the world now.

    Parameters
    ----------
    P : ndarray, shape (3,)
        Joint point, fixed in the child [m].
    r, s : ndarray, shape (3,)
        From the centre of mass of the child, of the parent, to P [m].
    E_omega, E_v : ndarray, shape (3, k)
        Motion subspace in world axes.
    bias_omega, bias_v : ndarray, shape (3,)
        E° q̇: rate of the subspace at fixed parent times the rates.
    R_predicted : ndarray, shape (3, 3)
        Joint frame of the child as the parent and the coordinates place it.
    """

    P: np.ndarray
    r: np.ndarray
    s: np.ndarray
    E_omega: np.ndarray
    E_v: np.ndarray
    bias_omega: np.ndarray
    bias_v: np.ndarray
    R_predicted: np.ndarray


class Motion(View):
    """Poses and velocities of all bodies in one state; what laws of forces and drives are given.

    Parameters
    ----------
    system : System
        What moves.
    state : State
        Where it is, and how fast.

    Attributes
    ----------
    system, state
        What moves, and its state.
    R, x : list of ndarray
        Rotation (3, 3) from principal axes to world, and centre of mass (3,) [m], of each body.
    W, u : list of ndarray
        Angular velocity (3,) [rad/s] and velocity of the centre of mass (3,) [m/s] in world axes.
    joints : list of JointMotion
        The joints, in order.
    """

    def __init__(self, system: System, state: State):
        self.system, self.state = system, state
        n = system.structure.n_bodies
        # one place more: index −1 is the ground
        self.R, self.x = [AXES] * (n + 1), [ORIGIN] * (n + 1)
        self.W, self.u = [ORIGIN] * (n + 1), [ORIGIN] * (n + 1)
        self.joints: list[JointMotion] = [None] * len(system.joints)

    def quasi_velocities(self) -> np.ndarray:
        """Return v (6n,): ω in principal axes, velocity of the centre of mass in world, body by body."""
        n = self.system.structure.n_bodies
        return np.concatenate([part for i in range(n) for part in (self.R[i].T @ self.W[i], self.u[i])])


def kinematics(system: System, state: State) -> Motion:
    """Poses and velocities of all bodies and joints."""
    motion = Motion(system, state)
    for edge in system.structure.tree:
        joint = system.joints[edge.constraint]
        if edge.outer == joint.child:
            _reach_child(motion, edge.constraint, joint)
        else:
            _reach_parent(motion, edge.constraint, joint)
    for index in system.structure.closures:
        if index < len(system.joints):
            _close(motion, index, system.joints[index])
    return motion


def _subspace(joint: PlacedJoint, R: np.ndarray, state: State):
    q, v = state.q[joint.q], state.v[joint.v]
    E_omega, E_v = joint.pair.subspace(q)
    bias_omega, bias_v = joint.pair.subspace_bias(q, v)
    return R @ E_omega, R @ E_v, R @ bias_omega, R @ bias_v


def _reach_child(motion: Motion, index: int, joint: PlacedJoint):
    p, c = joint.parent, joint.child
    R_pose, p_pose = joint.pair.pose(motion.state.q[joint.q])
    R = motion.R[p] @ joint.R_parent
    R_predicted = R @ R_pose
    s = motion.R[p] @ joint.p_parent + R @ p_pose
    motion.R[c] = R_predicted @ joint.R_child.T
    r = motion.R[c] @ joint.p_child
    P = motion.x[p] + s
    motion.x[c] = P - r
    E_omega, E_v, *bias = _subspace(joint, R, motion.state)
    rates = motion.state.v[joint.v]
    motion.W[c] = motion.W[p] + E_omega @ rates
    motion.u[c] = motion.u[p] + cross(motion.W[p], s) + E_v @ rates - cross(motion.W[c], r)
    motion.joints[index] = JointMotion(P, r, s, E_omega, E_v, *bias, R_predicted)


def _reach_parent(motion: Motion, index: int, joint: PlacedJoint):
    p, c = joint.parent, joint.child
    R_pose, p_pose = joint.pair.pose(motion.state.q[joint.q])
    R_predicted = motion.R[c] @ joint.R_child
    R = R_predicted @ R_pose.T
    motion.R[p] = R @ joint.R_parent.T
    r = motion.R[c] @ joint.p_child
    s = motion.R[p] @ joint.p_parent + R @ p_pose
    P = motion.x[c] + r
    motion.x[p] = P - s
    E_omega, E_v, *bias = _subspace(joint, R, motion.state)
    rates = motion.state.v[joint.v]
    motion.W[p] = motion.W[c] - E_omega @ rates
    motion.u[p] = motion.u[c] + cross(motion.W[c], r) - E_v @ rates - cross(motion.W[p], s)
    motion.joints[index] = JointMotion(P, r, s, E_omega, E_v, *bias, R_predicted)


def _close(motion: Motion, index: int, joint: PlacedJoint):
    p, c = joint.parent, joint.child
    R_pose, p_pose = joint.pair.pose(motion.state.q[joint.q])
    R = motion.R[p] @ joint.R_parent
    r = motion.R[c] @ joint.p_child
    s = motion.R[p] @ joint.p_parent + R @ p_pose
    motion.joints[index] = JointMotion(motion.x[c] + r, r, s, *_subspace(joint, R, motion.state), R @ R_pose)
