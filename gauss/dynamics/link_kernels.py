"""Kernels of one link, and of one loop joint, for call graphs.

Those of a link are steps of the articulated-body and Newton–Euler recursions: each takes the link, the pair of the joint to
its inner link, whether the link is the child there, and vectors of the link and its neighbours. Those of a loop joint are
:class:`gauss.dynamics.loop_joints.LoopJoint` on vectors of its two links.
"""

from dataclasses import replace

import numpy as np

from gauss.dynamics.aba import Elimination, add, blocks, eliminate, inertia_to_inner
from gauss.dynamics.given_link_frames import GivenLinkFrames
from gauss.dynamics.loop_joints import LinkStates, LoopJoint
from gauss.dynamics.rnea import JointKinematics, force_to_inner, gyroscopic, inertial, kinematics_of_joint, to_outer
from gauss.dynamics.tree_recursion import UPPER, symmetric
from gauss.system import PlacedJoint, Subsystem


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


PARENT, CHILD, GROUND = 0, 1, -1
GROUND_POSE = np.concatenate([np.eye(3).ravel(), np.zeros(3)])


class LoopJointKind:
    """Kind of loop joints: those of one kind differ in their numbers only.

    ``joint``: one of them. ``redundant``: axes of the joint frame along which its rows are left out.
    """

    def __init__(self, joint: PlacedJoint, redundant):
        self.pair = joint.pair
        self.free, self.n_q = joint.pair.n_v, len(joint.pair.reference)
        self.joint = replace(
            joint,
            parent=GROUND if joint.parent < 0 else PARENT,
            child=GROUND if joint.child < 0 else CHILD,
            q=slice(0, self.n_q),
            v=slice(0, self.free),
        )
        self.redundant = frozenset((0, axis) for axis in redundant)

    def key(self) -> tuple:
        """Key of the kind."""
        subspace = tuple(np.concatenate(self.pair.subspace(np.array(self.pair.reference))).ravel())
        return self.pair.kind, subspace, self.joint.parent, self.joint.child, self.redundant

    def forces(self, numbers, q, v):
        """Unit wrenches (6, m) on parent and child of each row, and (6, k) of each free direction; scales of the rows."""
        loop_joint = self._loop_joint(numbers, q, v)
        scale = np.array([1.0 / np.sqrt(size) for size in loop_joint.sizes] + [None], dtype=object)[:-1]
        held = self._sides([wrenches for wrenches, _ in loop_joint.unit_forces])
        free = self._sides([loop_joint.wrench(direction) for direction in loop_joint.free.T])
        return *(block * scale for block in held), *free, scale

    def value(self, numbers, q, v, scale, motions, still: bool):
        """Left side of the rows less the right (m,), scaled, and accelerations of the joint (k,) that follow.

        Motions are the angular velocities (3,) of parent and child, and the accelerations (6,) of both and of the ground.
        """
        omega_parent, omega_child, on_parent, on_child, ground = motions
        loop_joint = self._loop_joint(numbers, q, v, {PARENT: omega_parent, CHILD: omega_child, GROUND: np.zeros(3)})
        relative = loop_joint.relative({PARENT: on_parent, CHILD: on_child, GROUND: ground}, still)
        return scale * (loop_joint.held.T @ relative), loop_joint.free.T @ relative

    def position_residual(self, numbers, q, *poses):
        """Position residual of the rows (m,) [rad, m], and errors of the coordinates of the joint (k,).

        Poses (12,) are rotation and origin of the links of parent and child in world.
        """
        parent, child, ground = ((pose[:9].reshape(3, 3), pose[9:]) for pose in (*poses, GROUND_POSE))
        loop_joint = self._loop_joint(numbers, q, np.zeros(self.free), poses={PARENT: parent, CHILD: child, GROUND: ground})
        error = loop_joint.position_error()
        return loop_joint.held.T @ error, loop_joint.free.T @ error

    def _loop_joint(self, numbers, q, v, omegas=None, poses=None) -> LoopJoint:
        R_parent, p_parent, R_child, p_child, inertias = np.split(numbers, np.cumsum([9, 3, 9, 3]))
        sides = {self.joint.parent: (R_parent.reshape(3, 3), p_parent), self.joint.child: (R_child.reshape(3, 3), p_child)}
        subsystem = GivenLinkFrames(
            names=("parent", "child"),
            Phi=inertias,
            gravity=np.zeros(3),
            joints=(self.joint,),
            couplings=(),
            tree=(),
            carried={},
            q=np.arange(self.n_q),
            v=np.arange(self.free),
            redundant=self.redundant,
            sides={0: sides},
        )
        return LoopJoint(LinkStates(subsystem, omegas or {}, poses or {}), 0, q, v)

    def _sides(self, wrenches) -> tuple[np.ndarray, np.ndarray]:
        """Wrenches (6, m) on parent and child."""
        none = np.zeros(6)
        on = lambda body: np.array([wrench.get(body, none) for wrench in wrenches], dtype=object).reshape(-1, 6).T  # noqa: E731
        return on(PARENT), on(CHILD)


def loop_joint_numbers(subsystem: Subsystem, index: int, sides) -> np.ndarray:
    """Numbers of a loop joint: its frames on both links, and inertias Φ of both bodies."""
    joint = subsystem.joints[index]
    frames = [np.concatenate([np.ravel(R), p]) for R, p in (sides[joint.parent], sides[joint.child])]
    Phi = [subsystem.Phi[6 * body : 6 * body + 6] if body >= 0 else np.zeros(6) for body in (joint.parent, joint.child)]
    return np.concatenate([*frames, *Phi])
