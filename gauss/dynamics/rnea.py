"""A tree in one state, seen from the moving axes of its links: what passes outward along it, and inward.

In link frames (``gauss.dynamics.link_frames``) joint axes and most entries of the inertias are constants. Spatial vectors
are
(angular, linear) about the origin of the link frame. Accelerations are those of the material point there, ü rather than
the spatial one of Featherstone (Rigid Body Dynamics Algorithms, 2008, sec. 2.11): so no linear velocity is ever needed.
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
    """The way across a joint.

    Attributes
    ----------
    R, p : ndarray
        From the link frame to the joint frame on the inner side: rotation (3, 3), origin (3,).
    S : ndarray, shape (6, k)
        Motion subspace in the link frame.
    bias : ndarray, shape (6,)
        Acceleration across the joint that is there without joint acceleration, in the link frame.
    """

    R: np.ndarray
    p: np.ndarray
    S: np.ndarray
    bias: np.ndarray


class KinematicTree:
    """Outward pass over a tree; joints that close loops are left open.

    Parameters
    ----------
    part : Subsystem
        The part of a system.
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates; floats or expressions.

    Attributes
    ----------
    links : dict
        Constants of each body's link; −1 is the ground.
    passages : dict
        Way to each body from the body on its inner side.
    omegas : dict
        Angular velocity (3,) of each link in its frame.
    """

    def __init__(self, part: Subsystem, q, v):
        self.part, self.links = part, link_frames(part)
        self.joint_kinematics, self.omegas = {}, {-1: np.zeros(3)}
        for edge in self.edges:
            joint = part.joints[edge.constraint]
            inner, forward = self.omegas[edge.inner], edge.outer == joint.child
            self.joint_kinematics[edge.outer], self.omegas[edge.outer] = joint_kinematics(
                joint.pair, forward, self.links[edge.outer], q[joint.q], v[joint.v], inner
            )

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Joints of the tree, inner ones first."""
        return self.part.tree

    @property
    def ground(self) -> np.ndarray:
        """Acceleration (6,) of the ground with which weight needs no mention: −g."""
        return np.concatenate([np.zeros(3), -self.part.gravity])

    @cached_property
    def poses(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Rotation (3, 3) and origin (3,) of every link frame in world."""
        found = {-1: (np.eye(3), np.zeros(3))}
        for edge in self.edges:
            link, kin, (R, x) = self.links[edge.outer], self.joint_kinematics[edge.outer], found[edge.inner]
            found[edge.outer] = R @ link.R @ kin.R, x + R @ (link.p + link.R @ kin.p)
        return found

    def accelerations(self, rates) -> dict[int, np.ndarray]:
        """Acceleration (6,) of every link, weight included, given the joint accelerations (n_v,)."""
        return self._outward(rates, self.ground, {body: kin.bias for body, kin in self.joint_kinematics.items()})

    def carried(self, rates) -> dict[int, np.ndarray]:
        """Velocity (6,) of every link given the joint rates (n_v,)."""
        return self._outward(rates, np.zeros(6), dict.fromkeys(self.joint_kinematics, np.zeros(6)))

    def _outward(self, rates, base, biases):
        found = {-1: base}
        for edge in self.edges:
            kin, place = self.joint_kinematics[edge.outer], self.part.joints[edge.constraint].v
            carried = to_outer(self.links[edge.outer], kin, found[edge.inner]) + biases[edge.outer]
            found[edge.outer] = carried + kin.S @ rates[place]
        return found

    def inverse_dynamics(self, rates, pushes=None) -> np.ndarray:
        """Generalised forces (n_v,) with which the tree moves with joint accelerations (n_v,) (Featherstone, sec. 5.3).

        Parameters
        ----------
        rates : ndarray, shape (n_v,)
            Joint accelerations.
        pushes : dict, optional
            Force vectors (6,) on bodies in link frames, {body: push}.
        """
        accelerations, forces = self.accelerations(rates), {}
        for body in self.joint_kinematics:
            forces[body] = inertial(self.links[body], self.omegas[body], accelerations[body])
        for body, push in (pushes or {}).items():
            forces[body] = forces[body] - push
        return self.projected(forces)

    def projected(self, forces) -> np.ndarray:
        """Generalised forces (n_v,) that force vectors (6,) on links, in link frames, amount to, {body: force}."""
        effort, forces = np.zeros(self.part.n_v, dtype=object), self.gathered(forces)
        for edge in self.edges:
            if edge.outer in forces:
                effort[self.part.joints[edge.constraint].v] = self.joint_kinematics[edge.outer].S.T @ forces[edge.outer]
        return effort

    def gathered(self, forces) -> dict[int, np.ndarray]:
        """Force vectors (6,) that joints pass on to the links further in: those on a link and on all that it carries."""
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


def joint_kinematics(pair: Pair, forward: bool, link: Link, q, v, inner: np.ndarray) -> tuple[JointKinematics, np.ndarray]:
    """Way across a joint to a link, and the angular velocity of the link.

    Parameters
    ----------
    pair : Pair
        Kinematics of the joint.
    forward : bool
        Whether the link is the child of the joint.
    link : Link
        Constants of the link.
    q, v : ndarray
        Coordinates and rates of the joint.
    inner : ndarray, shape (3,)
        Angular velocity of the inner link in its frame.
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
    E_omega, E_v = pair.subspace(q)
    return (
        R,
        p,
        np.concatenate([R.T @ E_omega, R.T @ E_v]),
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
    """Force vector of the outer link in the inner link frame."""
    for R, p in ((kin.R, kin.p), (link.R, link.p)):
        linear = R @ force[3:]
        force = np.concatenate([R @ force[:3] + cross(p, linear), linear])
    return force


def gyroscopic(link: Link, omega: np.ndarray) -> np.ndarray:
    """Force vector that a link needs to go on turning as it does: ω × I ω and ω × (ω × m c)."""
    return np.concatenate([cross(omega, link.inertia[0] @ omega), square(omega) @ link.first])


def inertial(link: Link, omega: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Force vector that a link needs to move as it does."""
    return apply(link.inertia, acceleration) + gyroscopic(link, omega)


def square(omega: np.ndarray) -> np.ndarray:
    """Matrix of ω × (ω × ·), [ω]× [ω]× = ω ωᵀ − ω² 1."""
    x, y, z = omega * omega
    xy, xz, yz = omega[0] * omega[1], omega[0] * omega[2], omega[1] * omega[2]
    return np.array([[-y - z, xy, xz], [xy, -x - z, yz], [xz, yz, -x - y]])


def apply(inertia, motion: np.ndarray) -> np.ndarray:
    """Force vector of an inertia [A, B; Bᵀ, C] and a motion."""
    A, B, C = inertia
    return np.concatenate([A @ motion[:3] + B @ motion[3:], B.T @ motion[:3] + C @ motion[3:]])
