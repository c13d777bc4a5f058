"""Joints that close loops, seen from their own axes: relative acceleration, and the wrench that holds them together."""

import numpy as np

from gauss import rotations
from gauss.assembly.tree import Tree, square
from gauss.rotations import cross


class Closing:
    """A joint that closes a loop, seen from the axes of its frame on the parent.

    Parameters
    ----------
    tree : Tree
        The open tree in its state.
    index : int
        Index of the joint in its part.
    q, v : ndarray
        All coordinates and rates.
    """

    def __init__(self, tree: Tree, index: int, q, v):
        joint = tree.part.joints[index]
        self.tree, self.index, self.joint = tree, index, joint
        self.R, self.p = joint.pair.pose(q[joint.q])
        E_omega, E_v = joint.pair.subspace(q[joint.q])
        self.free = [int(np.argmax(column)) for column in np.concatenate([E_omega, E_v]).T]
        self.held = [axis for axis in range(6) if axis not in self.free and (index, axis) not in tree.part.redundant]
        self.turning, self.sliding = E_omega @ v[joint.v], E_v @ v[joint.v]
        self.sides = {
            body: _side(tree, body, R, p)
            for body, R, p in ((joint.parent, joint.R_parent, joint.p_parent), (joint.child, joint.R_child, joint.p_child))
        }

    def relative(self, accelerations, still: bool = False) -> np.ndarray:
        """Acceleration (6,) of the child against the parent at the joint point: E q̈ when the loop is closed."""
        parent, child = (accelerations.get(body) for body in (self.joint.parent, self.joint.child))
        if still and parent is None and child is None:
            return np.zeros(6)
        alpha_c, a_c, _ = self._at_joint(self.joint.child, child, np.zeros(3), still)
        alpha_p, a_p, omega_p = self._at_joint(self.joint.parent, parent, self.p, still)
        angular, linear = self.R @ alpha_c - alpha_p, self.R @ a_c - a_p
        if still:
            return np.concatenate([angular, linear])
        return np.concatenate([angular - cross(omega_p, self.turning), linear - 2.0 * cross(omega_p, self.sliding)])

    def _at_joint(self, body: int, acceleration, point, still: bool):
        """Angular acceleration, acceleration of a point of the joint frame, angular velocity, in the joint axes."""
        R, p = self.sides[body]
        acceleration = np.zeros(6) if acceleration is None else acceleration
        omega = np.zeros(3) if still else self.tree.omegas[body]
        lever = p + R @ point
        linear = acceleration[3:] + cross(acceleration[:3], lever) + square(omega) @ lever
        return R.T @ acceleration[:3], R.T @ linear, R.T @ omega

    def gap(self) -> np.ndarray:
        """How far the child is from where parent and coordinates place it (6,), in the joint axes [rad, m].

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

    def wrench(self, axis: int) -> dict[int, np.ndarray]:
        """Unit force or moment along a joint axis on the child at the joint point, its opposite on the parent."""
        unit = np.eye(6)[axis]
        pushes = {}
        for body, turn, point, sign in (
            (self.joint.child, self.R.T, np.zeros(3), 1.0),
            (self.joint.parent, np.eye(3), self.p, -1.0),
        ):
            if body >= 0:
                R, p = self.sides[body]
                force = sign * (R @ (turn @ unit[3:]))
                moment = sign * (R @ (turn @ unit[:3])) + cross(p + R @ point, force)
                pushes[body] = np.concatenate([moment, force])
        return pushes

    def unbound(self, axis: int) -> float:
        """Row of this axis if no joint bound its bodies: what its rounding is measured against."""
        Phi = self.tree.part.Phi
        bodies = [body for body in (self.joint.parent, self.joint.child) if body >= 0]
        sizes = [Phi[6 * body + 3] if axis >= 3 else Phi[6 * body : 6 * body + 3].sum() / 2 for body in bodies]
        return float(sum(1.0 / size for size in sizes if size)) or 1.0


def _side(tree: Tree, body: int, R, p):
    link = tree.links[body]
    return rotations.clean(link.R_central.T @ R), link.R_central.T @ (p - link.p_central)
