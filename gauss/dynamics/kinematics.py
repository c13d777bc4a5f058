"""Kinematics of one state: poses and velocities of all bodies, outward along the spanning tree.

R_c = R_p R_parent R(q) R_childᵀ, ω_c = ω_p + E_ω q̇, and ẋ_c = ẋ_p + ω_p × s + E_v q̇ − ω_c × r at the joint point P.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss.errors import StateError, require
from gauss.rotations import cross
from gauss.system import PlacedJoint, State, System, View

ORIGIN = np.zeros(3)
WORLD_AXES = np.eye(3)


@dataclass(frozen=True)
class JointMotion:
    """Kinematics of a joint in world axes."""

    P: np.ndarray  # (3,) joint point, fixed in the child [m]
    r: np.ndarray  # r, s (3,): from the centre of mass of the child, of the parent, to P [m]
    s: np.ndarray
    E_omega: np.ndarray  # E_omega, E_v (3, k): motion subspace
    E_v: np.ndarray
    bias_omega: np.ndarray  # bias_omega, bias_v (3,): E° q̇, rate of the subspace at fixed parent times the rates
    bias_v: np.ndarray
    R_predicted: np.ndarray  # (3, 3) joint frame of the child by the parent and the coordinates


@dataclass
class _Poses:
    """Result of :func:`_outward`, as the attributes of :class:`Kinematics`; index −1 is the ground."""

    state: State
    R: list
    x: list
    W: list
    u: list
    joints: list


FOUND = frozenset(("R", "x", "W", "u", "joints"))  # attributes computed on first access
BLOCKS = {"R": (0, 9, (3, 3)), "x": (9, 12, (3,)), "W": (12, 15, (3,)), "u": (15, 18, (3,))}  # of poses in one array
NUMBERS = 18  # of a body in that array


class Kinematics(View):
    """Poses and velocities of all bodies in one state; the argument of laws of forces and drives.

    They are computed on first access: many laws need coordinates and rates only.

    Parameters
    ----------
    system : System
        The system.
    state : State
        The state.

    Attributes
    ----------
    system, state
        System and state.
    R, x : list of ndarray
        Rotation (3, 3) from principal axes to world, and centre of mass (3,) [m], of each body; −1 is the ground.
    W, u : list of ndarray
        Angular velocity (3,) [rad/s] and velocity of the centre of mass (3,) [m/s] in world axes.
    joints : list of JointMotion
        The joints, in order.

    Raises
    ------
    ArgumentError
        If these are no system and no state.
    StateError
        If the state has not as many coordinates or rates as the system.
    """

    R: list[np.ndarray]
    x: list[np.ndarray]
    W: list[np.ndarray]
    u: list[np.ndarray]

    def __init__(self, system: System, state: State):
        require(system, (System,), "Kinematics")
        require(state, (State,), "Kinematics: state")
        self.system, self.state = system, state

    def __getattr__(self, name: str):
        if name not in FOUND:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        self._take(_outward(self.system, self.state))
        return self.__dict__[name]

    @classmethod
    def of_bodies(cls, system: System, state: State, R, x, W, u) -> "Kinematics":
        """Given poses and velocities of the bodies, without joints."""
        found = cls(system, state)
        poses = [*R, WORLD_AXES], [*x, ORIGIN], [*W, ORIGIN], [*u, ORIGIN]  # and those of the ground
        found._take(_Poses(state, *poses, [None] * len(system.joints)))
        return found

    def _take(self, poses: _Poses):
        """Set all attributes at once: no other thread sees half of them."""
        self.__dict__.update({name: getattr(poses, name) for name in FOUND})

    def quasi_velocities(self) -> np.ndarray:
        """Return v (6n,): ω in principal axes, velocity of the centre of mass in world, body by body."""
        n = self.system.structure.n_bodies
        return np.concatenate([part for i in range(n) for part in (self.R[i].T @ self.W[i], self.u[i])])


class KinematicsOnAccess(Kinematics):
    """Poses and velocities of all bodies by a function, called on first access; without joints.

    ``poses``: () → rotations (n + 1, 3, 3), centres of mass, angular velocities and velocities (n + 1, 3) of the bodies,
    then of the ground, as one array.
    """

    def __init__(self, system: System, state: State, poses: Callable[[], np.ndarray]):
        self.system, self.state, self._bodies = system, state, poses

    def __getattr__(self, name: str):
        if name not in FOUND:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        if name not in BLOCKS:
            return self.__dict__.setdefault(name, [None] * len(self.system.joints))
        known = self.__dict__
        numbers = known["_numbers"] if "_numbers" in known else known.setdefault("_numbers", self._bodies())
        (first, last, shape), n = BLOCKS[name], numbers.size // NUMBERS
        return known.setdefault(name, numbers[first * n : last * n].reshape(n, *shape))


def kinematics(system: System, state: State) -> Kinematics:
    """Poses and velocities of all bodies and joints, computed now."""
    found = Kinematics(system, state)
    found._take(_outward(system, state))
    return found


def _outward(system: System, state: State) -> _Poses:
    """Poses and velocities, from the ground outward."""
    if (len(state.q), len(state.v)) != (system.n_q, system.n_v):
        raise StateError(
            f"scene {system.scene.name!r} has {system.n_q} coordinates and {system.n_v} rates, the state has {len(state.q)} "
            f"and {len(state.v)}; system.state(q, v) makes one that fits."
        )
    places = system.structure.n_bodies + 1
    at = ([WORLD_AXES] * places, [ORIGIN] * places, [ORIGIN] * places, [ORIGIN] * places)
    found = _Poses(state, *at, [None] * len(system.joints))
    for edge in system.structure.tree:
        joint = system.joints[edge.constraint]
        if edge.outer == joint.child:
            _reach_child(found, edge.constraint, joint)
        else:
            _reach_parent(found, edge.constraint, joint)
    for index in system.structure.closures:
        if index < len(system.joints):
            _close(found, index, system.joints[index])
    return found


def _subspace(joint: PlacedJoint, R: np.ndarray, state: State):
    q, v = state.q[joint.q], state.v[joint.v]
    E_omega, E_v = joint.pair.subspace(q)
    bias_omega, bias_v = joint.pair.subspace_bias(q, v)
    return R @ E_omega, R @ E_v, R @ bias_omega, R @ bias_v


def _reach_child(motion: _Poses, index: int, joint: PlacedJoint):
    p, c = joint.parent, joint.child
    R_pose, p_pose = joint.pair.pose(motion.state.q[joint.q])
    R = motion.R[p] @ joint.R_parent
    R_predicted = R @ R_pose
    s = motion.R[p] @ joint.p_parent + R @ p_pose
    motion.R[c] = R_predicted @ joint.R_child.T
    r = motion.R[c] @ joint.p_child
    P = motion.x[p] + s
    motion.x[c] = P - r
    E_omega, E_v, bias_omega, bias_v = _subspace(joint, R, motion.state)
    rates = motion.state.v[joint.v]
    motion.W[c] = motion.W[p] + E_omega @ rates
    motion.u[c] = motion.u[p] + cross(motion.W[p], s) + E_v @ rates - cross(motion.W[c], r)
    motion.joints[index] = JointMotion(P, r, s, E_omega, E_v, bias_omega, bias_v, R_predicted)


def _reach_parent(motion: _Poses, index: int, joint: PlacedJoint):
    p, c = joint.parent, joint.child
    R_pose, p_pose = joint.pair.pose(motion.state.q[joint.q])
    R_predicted = motion.R[c] @ joint.R_child
    R = R_predicted @ R_pose.T
    motion.R[p] = R @ joint.R_parent.T
    r = motion.R[c] @ joint.p_child
    s = motion.R[p] @ joint.p_parent + R @ p_pose
    P = motion.x[c] + r
    motion.x[p] = P - s
    E_omega, E_v, bias_omega, bias_v = _subspace(joint, R, motion.state)
    rates = motion.state.v[joint.v]
    motion.W[p] = motion.W[c] - E_omega @ rates
    motion.u[p] = motion.u[c] + cross(motion.W[c], r) - E_v @ rates - cross(motion.W[p], s)
    motion.joints[index] = JointMotion(P, r, s, E_omega, E_v, bias_omega, bias_v, R_predicted)


def _close(motion: _Poses, index: int, joint: PlacedJoint):
    p, c = joint.parent, joint.child
    R_pose, p_pose = joint.pair.pose(motion.state.q[joint.q])
    R = motion.R[p] @ joint.R_parent
    r = motion.R[c] @ joint.p_child
    s = motion.R[p] @ joint.p_parent + R @ p_pose
    E_omega, E_v, bias_omega, bias_v = _subspace(joint, R, motion.state)
    motion.joints[index] = JointMotion(motion.x[c] + r, r, s, E_omega, E_v, bias_omega, bias_v, R @ R_pose)
