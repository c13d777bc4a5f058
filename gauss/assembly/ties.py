"""Rows that tie what no joint ties: couplings of coordinates, and relations between bodies, coordinates and time."""

import numpy as np

from gauss.assembly.tree import Tree, square
from gauss.rotations import cross
from gauss.system import Part


class Couplings:
    """Rows K q̇ = 0: q̇_driven − ratio · q̇_driver.

    Parameters
    ----------
    part : Part
        What they belong to.
    """

    def __init__(self, part: Part):
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
    tree : Tree
        The open tree in its state; its part is the whole system, which relations are about.
    relation : PlacedRelation
        Which bodies and joints it binds.
    rows : Rows
        Its blocks.
    """

    def __init__(self, tree: Tree, relation, rows):
        self.tree, self.relation, self.rows = tree, relation, rows
        self.moving = rows.C
        self.places = [tree.part.joints[j].v for j in relation.joints]
        self.actions, self.sizes = [], []
        for k in range(relation.size):
            effort = np.zeros(tree.part.n_v, dtype=object)
            for place, B in zip(self.places, rows.B, strict=True):
                effort[place] = B[k]
            pushes = {body: self._push(body, A[k]) for body, A in zip(relation.bodies, rows.A, strict=True)}
            self.actions.append((pushes, effort))
            self.sizes.append(self._unbound(k))

    def value(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the rows less the right (m,), given accelerations of joints (n_v,) and links."""
        total = np.zeros(self.relation.size) if still else -self.rows.D
        for body, A in zip(self.relation.bodies, self.rows.A, strict=True):
            total = total + A @ self._quasi_acceleration(body, accelerations.get(body), still)
        for place, B in zip(self.places, self.rows.B, strict=True):
            total = total + B @ rates[place]
        return total

    def _quasi_acceleration(self, body: int, acceleration, still: bool) -> np.ndarray:
        """Acceleration (6,) in principal and world axes of a body whose link has this one."""
        if acceleration is None:
            return np.zeros(6)
        link, (R, _) = self.tree.links[body], self.tree.poses[body]
        lever = -link.R_central.T @ link.p_central
        alpha, linear = acceleration[:3], acceleration[3:] + cross(acceleration[:3], lever)
        if still:
            return np.concatenate([link.R_central @ alpha, R @ linear])
        weightless = self.tree.ground[3:]  # links are accelerated against free fall
        linear = linear + square(self.tree.omegas[body]) @ lever
        return np.concatenate([link.R_central @ alpha, R @ linear - weightless])

    def _push(self, body: int, row: np.ndarray) -> np.ndarray:
        """Force vector (6,) in the link frame of a moment in principal axes and a force in world axes through the centre."""
        link, (R, _) = self.tree.links[body], self.tree.poses[body]
        force = R.T @ row[3:]
        lever = -link.R_central.T @ link.p_central
        return np.concatenate([link.R_central.T @ row[:3] + cross(lever, force), force])

    def _unbound(self, k: int):
        """Row k if no joint bound its bodies: what its rounding is measured against."""
        Phi = self.tree.part.Phi
        total = sum((B[k] @ B[k] for B in self.rows.B), 0.0)
        for body, A in zip(self.relation.bodies, self.rows.A, strict=True):
            inverse = np.divide(1.0, Phi[6 * body : 6 * body + 6], out=np.zeros(6), where=Phi[6 * body : 6 * body + 6] > 0)
            total = total + A[k] @ (inverse * A[k])
        return total
