"""Coupling constraints q̇_driven − ratio · q̇_driver = 0, and relations A a + B q̈ = D of bodies, coordinates and time."""

import numpy as np

from gauss.codegen import as_number
from gauss.dynamics.rnea import KinematicTree, square
from gauss.rotations import cross
from gauss.system import Subsystem


class Couplings:
    """Rows K q̇ = 0: q̇_driven − ratio · q̇_driver."""

    def __init__(self, subsystem: Subsystem):
        self.K = np.zeros((len(subsystem.couplings), subsystem.n_v))
        for row, coupling in zip(self.K, subsystem.couplings, strict=True):
            row[subsystem.joint(coupling.driven).v] = 1.0
            row[subsystem.joint(coupling.driver).v] = -coupling.ratio
        self.unit_forces: list[tuple[dict[int, np.ndarray], np.ndarray]] = [({}, row) for row in self.K]
        self.sizes = [float(row @ row) for row in self.K]
        self.velocity_rhs = np.zeros(len(self.K))

    def value(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the rows (m,), given all joint accelerations (n_v,)."""
        return self.K @ rates


class RelationRows:
    """Rows of one relation, A a + B q̈ = D, in link frames.

    ``relation``: its bodies of the system and joints of the subsystem.
    """

    def __init__(self, tree: KinematicTree, relation, rows):
        self.tree, self.relation, self.rows = tree, relation, rows
        self.velocity_rhs, subsystem = rows.C, tree.subsystem
        # joints that cannot move, and bodies fixed to the ground, have no columns
        self.joints = [(subsystem.joint(j).v, B) for j, B in zip(relation.joints, rows.B, strict=True) if subsystem.has(j)]
        frames = [(subsystem.carried[body], A) for body, A in zip(relation.bodies, rows.A, strict=True)]
        self.carried = [_CarriedBody(tree, frame, A) for frame, A in frames if frame.body >= 0]
        self.unit_forces, self.sizes = [], []
        for k in range(relation.size):
            tau = np.zeros(subsystem.n_v, dtype=object)
            wrenches: dict[int, np.ndarray] = {}
            for place, B in self.joints:
                tau[place] = B[k]
            for own in self.carried:
                wrenches[own.body] = wrenches.get(own.body, np.zeros(6)) + own.wrench(k)
            self.unit_forces.append((wrenches, tau))
            size = sum((B[k] @ B[k] for _, B in self.joints), 0.0) + sum(own.size_on_free_body(k) for own in self.carried)
            self.sizes.append(1.0 if as_number(size) == 0 else size)

    def value(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the rows less the right (m,), given accelerations of joints (n_v,) and links."""
        total = np.zeros(self.relation.size) if still else -self.rows.D
        for own in self.carried:
            total = total + own.A @ own.quasi_acceleration(accelerations.get(own.body), still)
        for place, B in self.joints:
            total = total + B @ rates[place]
        return total


class _CarriedBody:
    """Body of the system on the link that carries it, with its block A of the rows.

    ``frame``: principal central frame of the body on the body of the subsystem that carries it.
    """

    def __init__(self, tree: KinematicTree, frame, A):
        self.tree, self.frame, self.A, self.body = tree, frame, A, frame.body
        link = tree.links[frame.body]
        self.turn = frame.R.T @ link.R_central  # from link axes to the principal axes of the body
        self.lever = link.R_central.T @ (frame.p - link.p_central)

    def quasi_acceleration(self, acceleration, still: bool) -> np.ndarray:
        """Acceleration (6,) in principal and world axes when the link has this one."""
        if acceleration is None:
            return np.zeros(6)
        R, _ = self.tree.poses[self.body]
        alpha, linear = acceleration[:3], acceleration[3:] + cross(acceleration[:3], self.lever)
        if still:
            return np.concatenate([self.turn @ alpha, R @ linear])
        weightless = self.tree.ground[3:]  # accelerations of links are less gravity
        linear = linear + square(self.tree.omegas[self.body]) @ self.lever
        return np.concatenate([self.turn @ alpha, R @ linear - weightless])

    def wrench(self, k: int) -> np.ndarray:
        """Wrench (6,) on the link: row k as a moment in principal axes and a force in world axes at the centre."""
        R, _ = self.tree.poses[self.body]
        force = R.T @ self.A[k, 3:]
        return np.concatenate([self.turn.T @ self.A[k, :3] + cross(self.lever, force), force])

    def size_on_free_body(self, k: int):
        """A Φ⁻¹ Aᵀ of row k: the scale of its round-off."""
        Phi = self.tree.subsystem.Phi[6 * self.body : 6 * self.body + 6]
        row = np.concatenate([self.frame.R @ self.A[k, :3], self.A[k, 3:]])
        return sum((entry * entry / own for entry, own in zip(row, Phi, strict=True) if as_number(own) != 0), 0.0)
