"""Recursive Newton–Euler algorithm: a_i = X_i a_λ + S_i q̈_i + c_i outward, f_λ += X_iᵀ f_i and τ_i = S_iᵀ f_i inward.

Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 5.3; Luh, Walker, Paul 1980. In link frames
(``gauss.dynamics.link_frames``) joint axes and most entries of the inertias are constants. Spatial vectors are (angular,
linear) about the origin of the link frame. Accelerations are those of the material point there, ü instead of the spatial
acceleration (Featherstone, sec. 2.11): so no linear velocity is needed.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.backends.structure import Edge
from gauss.codegen import Scalar
from gauss.dynamics.link_frames import Link, link_frames
from gauss.rotations import cross, skew
from gauss.scene import Pair
from gauss.system import Subsystem


class JointKinematics(NamedTuple):
    """Kinematics of a joint."""

    R: np.ndarray  # R, p: from the link frame to the joint frame on the inner side: rotation (3, 3), origin (3,)
    p: np.ndarray
    S: np.ndarray  # (6, k) motion subspace in the link frame
    bias: np.ndarray  # (6,) acceleration bias c: acceleration across the joint without joint acceleration, in the link frame


class KinematicTree:
    """Kinematics of an open tree in one state, and its inverse dynamics; loop joints are left out.

    ``q``, ``v`` (n_q,), (n_v,): coordinates and rates; floats or expressions.

    Attributes: ``links``: constants of each body's link; −1 is the ground. ``joint_kinematics``: kinematics of the joint to
    each body from its inner body. ``omegas``: angular velocity (3,) of each link in its frame.
    """

    def __init__(self, subsystem: Subsystem, q, v):
        self.subsystem, self.links = subsystem, link_frames(subsystem)
        self.joint_kinematics, self.omegas = {}, {-1: np.zeros(3)}
        for edge in self.edges:
            joint = subsystem.joints[edge.constraint]
            inner, forward = self.omegas[edge.inner], edge.outer == joint.child
            self.joint_kinematics[edge.outer], self.omegas[edge.outer] = kinematics_of_joint(
                joint.pair, forward, self.links[edge.outer], q[joint.q], v[joint.v], inner
            )

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Joints of the tree, inner ones first."""
        return self.subsystem.tree

    @property
    def ground(self) -> np.ndarray:
        """Acceleration (6,) −g of the ground, which accounts for gravity."""
        return np.concatenate([np.zeros(3), -self.subsystem.gravity])

    @cached_property
    def poses(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Rotation (3, 3) and origin (3,) of every link frame in world."""
        found = {-1: (np.eye(3), np.zeros(3))}
        for edge in self.edges:
            link, kin, (R, x) = self.links[edge.outer], self.joint_kinematics[edge.outer], found[edge.inner]
            found[edge.outer] = R @ link.R @ kin.R, x + R @ (link.p + link.R @ kin.p)
        return found

    def accelerations(self, rates) -> dict[int, np.ndarray]:
        """Acceleration (6,) of every link, less gravity, under joint accelerations (n_v,)."""
        return self._outward(rates, self.ground, {body: kin.bias for body, kin in self.joint_kinematics.items()})

    def biases(self) -> dict[int, np.ndarray]:
        """Acceleration (6,) of every link where the accelerations of all joints are zero."""
        biases = {body: kin.bias for body, kin in self.joint_kinematics.items()}
        return self._outward(np.zeros(self.subsystem.n_v), np.zeros(6), biases)

    def carried(self, rates) -> dict[int, np.ndarray]:
        """Velocity (6,) of every link given the joint rates (n_v,)."""
        return self._outward(rates, np.zeros(6), dict.fromkeys(self.joint_kinematics, np.zeros(6)))

    def _outward(self, rates, base, biases):
        found = {-1: base}
        for edge in self.edges:
            kin, place = self.joint_kinematics[edge.outer], self.subsystem.joints[edge.constraint].v
            carried = to_outer(self.links[edge.outer], kin, found[edge.inner]) + biases[edge.outer]
            found[edge.outer] = carried + kin.S @ rates[place]
        return found

    def inverse_dynamics(self, rates, wrenches=None) -> np.ndarray:
        """Generalised forces (n_v,) of joint accelerations (n_v,): M q̈ + h.

        Parameters
        ----------
        rates : ndarray, shape (n_v,)
            Joint accelerations.
        wrenches : dict, optional
            External wrenches (6,) on bodies in link frames, {body: wrench}.
        """
        forces = self.inertia_forces(rates)
        for body, wrench in (wrenches or {}).items():
            forces[body] = forces[body] - wrench
        return self.projected(forces)

    def inertia_forces(self, rates) -> dict[int, np.ndarray]:
        """Wrench (6,) that each link needs, in its frame, to move with joint accelerations (n_v,) under gravity."""
        accelerations = self.accelerations(rates)
        return {body: inertial(self.links[body], self.omegas[body], accelerations[body]) for body in self.joint_kinematics}

    def projected(self, forces) -> np.ndarray:
        """Generalised forces (n_v,) Jᵀ f of wrenches (6,) on links, in link frames, {body: force}."""
        tau, forces = np.zeros(self.subsystem.n_v, dtype=object), self.gathered(forces)
        for edge in self.edges:
            if edge.outer in forces:
                tau[self.subsystem.joints[edge.constraint].v] = self.joint_kinematics[edge.outer].S.T @ forces[edge.outer]
        return tau

    def gathered(self, forces) -> dict[int, np.ndarray]:
        """Wrenches (6,) summed over each link and all links that it carries."""
        forces = dict(forces)
        for edge in reversed(self.edges):
            if edge.outer in forces and edge.inner >= 0:
                carried = force_to_inner(self.links[edge.outer], self.joint_kinematics[edge.outer], forces[edge.outer])
                forces[edge.inner] = forces[edge.inner] + carried if edge.inner in forces else carried
        return forces

    def kinetic_energy(self, rates) -> Scalar:
        """Kinetic energy [J] when the tree moves with joint rates (n_v,)."""
        carried = self.carried(rates)
        return (
            sum((carried[body] @ apply(self.links[body].inertia, carried[body]) for body in self.joint_kinematics), 0.0)
            / 2.0
        )


def kinematics_of_joint(
    pair: Pair, forward: bool, link: Link, q, v, inner: np.ndarray
) -> tuple[JointKinematics, np.ndarray]:
    """Kinematics of a joint, and the angular velocity of its outer link.

    ``forward``: whether the link is the child of the joint. ``inner`` (3,): angular velocity of the inner link in its frame.
    """
    R, p, S, drift = _from_parent(pair, link.turn, q, v) if forward else _from_child(pair, link.turn, q, v)
    relative = S @ v
    omega = R.T @ (link.R.T @ inner)
    carried = R.T @ (link.R.T @ (square(inner) @ (link.p + link.R @ p))) + 2.0 * cross(omega, relative[3:])
    bias = drift + np.concatenate([cross(omega, relative[:3]), carried])
    return JointKinematics(R, p, S, bias), omega + relative[:3]


def _from_parent(pair: Pair, turn: np.ndarray, q, v):
    """Pose, subspace and drift across a joint whose child is the outer body."""
    R, p = pair.pose(q)
    R = R @ turn
    return (
        R,
        p,
        np.concatenate([turn.T @ part for part in pair.subspace_on_child(q)]),
        np.concatenate([R.T @ part for part in pair.subspace_bias(q, v)]),
    )


def _from_child(pair: Pair, turn: np.ndarray, q, v):
    """Pose, subspace and drift across a joint whose parent is the outer body."""
    R, p = pair.pose(q)
    E_omega, E_v = pair.subspace(q)
    bias_omega, bias_v = pair.subspace_bias(q, v)
    lever = skew(p)
    S = -np.concatenate([turn.T @ E_omega, turn.T @ (E_v + lever @ E_omega)])
    relative = S @ v
    drift = -np.concatenate([turn.T @ bias_omega, turn.T @ (bias_v + cross(E_v @ v, E_omega @ v) + lever @ bias_omega)])
    drift[3:] = drift[3:] + cross(relative[:3], relative[3:])
    return R.T @ turn, -R.T @ p, S, drift


def to_outer(link: Link, kin: JointKinematics, motion: np.ndarray) -> np.ndarray:
    """Acceleration of the inner link carried to the origin and axes of the outer link frame, without bias."""
    alpha, linear = motion[:3], motion[3:]
    linear = link.R.T @ (linear + cross(alpha, link.p))
    alpha = link.R.T @ alpha
    linear = kin.R.T @ (linear + cross(alpha, kin.p))
    return np.concatenate([kin.R.T @ alpha, linear])


def force_to_inner(link: Link, kin: JointKinematics, force: np.ndarray) -> np.ndarray:
    """Wrench of the outer link in the inner link frame."""
    for R, p in ((kin.R, kin.p), (link.R, link.p)):
        linear = R @ force[3:]
        force = np.concatenate([R @ force[:3] + cross(p, linear), linear])
    return force


def gyroscopic(link: Link, omega: np.ndarray) -> np.ndarray:
    """Bias force of a link: ω × I ω and ω × (ω × m c)."""
    return np.concatenate([cross(omega, link.inertia[0] @ omega), square(omega) @ link.first])


def inertial(link: Link, omega: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Inertia force of a link: I a + bias force."""
    return apply(link.inertia, acceleration) + gyroscopic(link, omega)


def square(omega: np.ndarray) -> np.ndarray:
    """Matrix of ω × (ω × ·), [ω]× [ω]× = ω ωᵀ − ω² 1."""
    x, y, z = omega * omega
    xy, xz, yz = omega[0] * omega[1], omega[0] * omega[2], omega[1] * omega[2]
    return np.array([[-y - z, xy, xz], [xy, -x - z, yz], [xz, yz, -x - y]])


def apply(inertia, motion: np.ndarray) -> np.ndarray:
    """Product of an inertia [A, B; Bᵀ, C] and a spatial motion."""
    A, B, C = inertia
    return np.concatenate([A @ motion[:3] + B @ motion[3:], B.T @ motion[:3] + C @ motion[3:]])
