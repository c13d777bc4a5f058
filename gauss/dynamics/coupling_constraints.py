"""Rows that tie what no joint ties: couplings of coordinates, and relations between bodies, coordinates and time."""

import numpy as np

from gauss.codegen import as_number
from gauss.dynamics.rnea import KinematicTree, square
from gauss.rotations import cross
from gauss.system import Subsystem


class Couplings:
    """Rows K q̇ = 0: q̇_driven − ratio · q̇_driver.

    Parameters
    ----------
    part : Subsystem
        What they belong to.
    """

    def __init__(self, part: Subsystem):
        self.K = np.zeros((len(part.couplings), part.n_v))
        for row, tie in zip(self.K, part.couplings, strict=True):
            row[part.joint(tie.driven).v] = 1.0
            row[part.joint(tie.driver).v] = -tie.ratio
        self.actions = [({}, row) for row in self.K]
        self.sizes = [float(row @ row) for row in self.K]
        self.moving = np.zeros(len(self.K))

    def value(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the rows (m,), given all joint accelerations (n_v,)."""
        return self.K @ rates


class RelationRows:
    """Rows of one relation, A a + B q̈ = D, seen from the links.

    Parameters
    ----------
    tree : KinematicTree
        The open tree in its state.
    relation : Bound
        Which bodies of the system and joints of the part it binds.
    rows : Rows
        Its blocks.
    """

    def __init__(self, tree: KinematicTree, relation, rows):
        self.tree, self.relation, self.rows = tree, relation, rows
        self.moving, part = rows.C, tree.part
        # a joint that cannot move, and a body that rides on the ground, take no part
        self.joints = [(part.joint(j).v, B) for j, B in zip(relation.joints, rows.B, strict=True) if part.has(j)]
        frames = [(part.carried[body], A) for body, A in zip(relation.bodies, rows.A, strict=True)]
        self.riders = [_Rider(tree, frame, A) for frame, A in frames if frame.body >= 0]
        self.actions, self.sizes = [], []
        for k in range(relation.size):
            effort, pushes = np.zeros(part.n_v, dtype=object), {}
            for place, B in self.joints:
                effort[place] = B[k]
            for rider in self.riders:
                pushes[rider.body] = pushes.get(rider.body, np.zeros(6)) + rider.push(k)
            self.actions.append((pushes, effort))
            size = sum((B[k] @ B[k] for _, B in self.joints), 0.0) + sum(rider.unbound(k) for rider in self.riders)
            self.sizes.append(1.0 if as_number(size) == 0 else size)

    def value(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the rows less the right (m,), given accelerations of joints (n_v,) and links."""
        total = np.zeros(self.relation.size) if still else -self.rows.D
        for rider in self.riders:
            total = total + rider.A @ rider.quasi_acceleration(accelerations.get(rider.body), still)
        for place, B in self.joints:
            total = total + B @ rates[place]
        return total


class _Rider:
    """Body of the system on the link that carries it, with its block of the rows.

    Parameters
    ----------
    tree : KinematicTree
        The open tree.
    frame : PlacedFrame
        Principal central frame of the body on the body of the part that carries it.
    A : ndarray, shape (m, 6)
        Its block.
    """

    def __init__(self, tree: KinematicTree, frame, A):
        self.tree, self.frame, self.A, self.body = tree, frame, A, frame.body
        link = tree.links[frame.body]
        self.turn = frame.R.T @ link.R_central  # from the axes of the link to the principal axes of the body
        self.lever = link.R_central.T @ (frame.p - link.p_central)

    def quasi_acceleration(self, acceleration, still: bool) -> np.ndarray:
        """Acceleration (6,) in principal and world axes when the link has this one."""
        if acceleration is None:
            return np.zeros(6)
        R, _ = self.tree.poses[self.body]
        alpha, linear = acceleration[:3], acceleration[3:] + cross(acceleration[:3], self.lever)
        if still:
            return np.concatenate([self.turn @ alpha, R @ linear])
        weightless = self.tree.ground[3:]  # links are accelerated against free fall
        linear = linear + square(self.tree.omegas[self.body]) @ self.lever
        return np.concatenate([self.turn @ alpha, R @ linear - weightless])

    def push(self, k: int) -> np.ndarray:
        """Force vector (6,) on the link: row k as a moment in principal and a force in world axes at the centre."""
        R, _ = self.tree.poses[self.body]
        force = R.T @ self.A[k, 3:]
        return np.concatenate([self.turn.T @ self.A[k, :3] + cross(self.lever, force), force])

    def unbound(self, k: int):
        """Row k if no joint bound the body: what its rounding is measured against."""
        Phi = self.tree.part.Phi[6 * self.body : 6 * self.body + 6]
        row = np.concatenate([self.frame.R @ self.A[k, :3], self.A[k, 3:]])
        return sum((entry * entry / own for entry, own in zip(row, Phi, strict=True) if as_number(own) != 0), 0.0)
