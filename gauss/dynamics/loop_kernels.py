"""Kernels of one loop joint for call graphs: :class:`gauss.dynamics.loop_joints.LoopJoint` on vectors of its two links."""

from dataclasses import replace

import numpy as np

from gauss.dynamics.given_link_frames import GivenLinkFrames
from gauss.dynamics.loop_joints import LinkStates, LoopJoint
from gauss.system import PlacedJoint, Subsystem

PARENT, CHILD, GROUND = 0, 1, -1
GROUND_POSE = np.concatenate([np.eye(3).ravel(), np.zeros(3)])


class LoopJointKind:
    """Kind of loop joints: those of one kind differ in their numbers only.

    Parameters
    ----------
    joint : PlacedJoint
        One of them.
    redundant : iterable of int
        Axes of the joint frame along which its rows are left out.
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
