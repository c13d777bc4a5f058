"""Loop joints: the rows held ᵀ (a_child − a_parent) = held ᵀ c of joints outside the spanning tree, in their own axes.

Position error, relative acceleration and constraint wrenches of one joint; its free directions give its own coordinates.
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import as_number
from gauss.dynamics.link_frames import joint_sides
from gauss.dynamics.rnea import KinematicTree, square
from gauss.rotations import cross
from gauss.scene import Pair
from gauss.system import Subsystem

UNIT_TWISTS = np.eye(6)


class LinkStates(NamedTuple):
    """Links of a loop joint, without the rest of the tree."""

    subsystem: Subsystem  # a subsystem with this joint
    omegas: dict  # omegas, poses: as those of :class:`gauss.dynamics.rnea.KinematicTree`, of its two bodies and the ground
    poses: dict
    links: dict = {}


class LoopJoint:
    """A joint outside the spanning tree, in the axes of its frame on the parent; its rows are its constrained directions.

    ``q``, ``v``: all coordinates and rates.

    Attributes: ``held`` (6, m): constrained directions: those of its constraint wrenches. ``free`` (6, k): dual of its
    motion subspace E: ``free.T @ E`` is one.
    """

    def __init__(self, tree: KinematicTree | LinkStates, index: int, q, v):
        joint = tree.subsystem.joints[index]
        self.tree, self.index, self.joint = tree, index, joint
        self.R, self.p = joint.pair.pose(q[joint.q])
        E_omega, E_v = joint.pair.subspace(q[joint.q])
        self.held, self.free = _directions(joint.pair, np.concatenate([E_omega, E_v]))
        needed = [k for k, row in enumerate(self.held.T) if (index, _axis(row)) not in tree.subsystem.redundant]
        self.held = self.held[:, needed]
        self.turning, self.sliding = E_omega @ v[joint.v], E_v @ v[joint.v]
        self.drift = np.concatenate(joint.pair.subspace_bias(q[joint.q], v[joint.v]))
        self.sides = joint_sides(tree.subsystem, tree.links, index)
        none = np.zeros(tree.subsystem.n_v)
        self.unit_forces = [(self.wrench(direction), none) for direction in self.held.T]
        self.sizes = [self._size_on_free_bodies(direction) for direction in self.held.T]
        self.velocity_rhs = np.zeros(self.held.shape[1])

    def value(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of its rows (m,), given link accelerations."""
        if still and not self._moves(accelerations):
            return self.velocity_rhs
        return self.held.T @ self.relative(accelerations, still)

    def rates(self, accelerations, still: bool) -> np.ndarray:
        """Joint accelerations (k,) that follow from those of the links."""
        return self.free.T @ self.relative(accelerations, still)

    def relative(self, accelerations, still: bool = False) -> np.ndarray:
        """Acceleration (6,) of the child against the parent at the joint point: E q̈ when the loop is closed."""
        if still and not self._moves(accelerations):
            return np.zeros(6)
        parent, child = (accelerations.get(body) for body in (self.joint.parent, self.joint.child))
        alpha_c, a_c, _ = self._at_joint(self.joint.child, child, np.zeros(3), still)
        alpha_p, a_p, omega_p = self._at_joint(self.joint.parent, parent, self.p, still)
        angular, linear = self.R @ alpha_c - alpha_p, self.R @ a_c - a_p
        if still:
            return np.concatenate([angular, linear])
        carried = np.concatenate([cross(omega_p, self.turning), 2.0 * cross(omega_p, self.sliding)])
        return np.concatenate([angular, linear]) - carried - self.drift

    def _moves(self, accelerations) -> bool:
        """Whether one of its links moves."""
        return self.joint.parent in accelerations or self.joint.child in accelerations

    def _at_joint(self, body: int, acceleration, point, still: bool):
        """Angular acceleration, acceleration of a point of the joint frame, angular velocity, in the joint axes."""
        R, p = self.sides[body]
        acceleration = np.zeros(6) if acceleration is None else acceleration
        omega = np.zeros(3) if still else self.tree.omegas[body]
        lever = p + R @ point
        linear = acceleration[3:] + cross(acceleration[:3], lever) + square(omega) @ lever
        return R.T @ acceleration[:3], R.T @ linear, R.T @ omega

    def position_error(self) -> np.ndarray:
        """Pose of the child relative to its pose by parent and coordinates (6,), in the joint axes [rad, m].

        The angular part is the axis times the sine of the angle.
        """
        (R_p, x_p), (R_c, x_c) = (self._joint_frame(body) for body in (self.joint.parent, self.joint.child))
        off = R_p.T @ R_c @ self.R.T
        angular = np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]]) / 2.0
        return np.concatenate([angular, R_p.T @ (x_c - x_p) - self.p])

    def _joint_frame(self, body: int):
        """Rotation and origin of the joint frame on a body, in world."""
        (R_link, x_link), (R, p) = self.tree.poses[body], self.sides[body]
        return R_link @ R, x_link + R_link @ p

    def wrench(self, direction: np.ndarray) -> dict[int, np.ndarray]:
        """Unit wrench (6,) in joint axes on the child at the joint point, and its opposite on the parent."""
        wrenches = {}
        for body, turn, point, sign in (
            (self.joint.child, self.R.T, np.zeros(3), 1.0),
            (self.joint.parent, np.eye(3), self.p, -1.0),
        ):
            if body >= 0:
                R, p = self.sides[body]
                force = sign * (R @ (turn @ direction[3:]))
                moment = sign * (R @ (turn @ direction[:3])) + cross(p + R @ point, force)
                wrenches[body] = np.concatenate([moment, force])
        return wrenches

    def _size_on_free_bodies(self, direction):
        """K M⁻¹ Kᵀ of this direction on free bodies: the scale of its round-off."""
        Phi, total = self.tree.subsystem.Phi, 0.0
        for body in (self.joint.parent, self.joint.child):
            if body >= 0:
                mass, moment = Phi[6 * body + 3], Phi[6 * body : 6 * body + 3].sum() / 2
                total = total + (direction[:3] @ direction[:3] / moment if as_number(moment) != 0 else 0.0)
                total = total + (direction[3:] @ direction[3:] / mass if as_number(mass) != 0 else 0.0)
        return total


def _directions(pair: Pair, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Constrained directions of a pair, and the dual of its motion subspace E (6, k)."""
    if pair.kind == "free":
        return UNIT_TWISTS[:, :0], E
    if pair.kind == "ball":
        return UNIT_TWISTS[:, 3:], E
    if pair.kind == "universal":
        return np.column_stack([np.concatenate([cross(E[:3, 0], E[:3, 1]), np.zeros(3)]), UNIT_TWISTS[:, 3:]]), E
    if pair.kind == "screw":
        pitch, length = E[5, 0], np.sqrt(E[:, 0] @ E[:, 0])
        along = (UNIT_TWISTS[:, 5] - pitch * UNIT_TWISTS[:, 2]) / length
        return np.column_stack([UNIT_TWISTS[:, [0, 1, 3, 4]], along]), E / length**2
    free = [int(np.argmax(column)) for column in E.T]  # axes of the joint frame
    return UNIT_TWISTS[:, [axis for axis in range(6) if axis not in free]], E


def _axis(direction) -> int | None:
    """Axis of the joint frame along a direction; None for other directions."""
    numbers = [as_number(entry) for entry in direction]
    return numbers.index(1.0) if sorted(map(str, numbers)) == sorted(map(str, UNIT_TWISTS[0])) else None
