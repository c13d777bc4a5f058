"""Coriolis matrix by composite bodies: each link with all links that it carries as one body, in the link frame.

A composite body has its inertia I, and at rates v its momentum p = ∫ ẋ dm and the moments P = ∫ ẋ xᵀ dm, which become
P + p rᵀ about an origin from which the present one lies at r. With D = tr P − P and a motion s = (α, β) its bias force is
linear in s, B s = (D α, α × p), in spatial vectors ½ [v×* I + (I v)×̄* − I v×]. Of a joint i that carries j

    C_ij = S_iᵀ (I_j Ṡ_j + B_j S_j),    C_ji = S_jᵀ (I_j Ṡ_i + B_j S_i):

the Christoffel symbols, so that Ṁ = C + Cᵀ (Echeandia and Wensing, Numerical methods to compute the Coriolis matrix and
Christoffel symbols for rigid-body systems, 2021).
"""

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression
from gauss.dynamics.aba import mirrored
from gauss.dynamics.link_frames import Link
from gauss.dynamics.rnea import JointKinematics, KinematicTree, apply
from gauss.rotations import congruent, cross, skew


class Moments(NamedTuple):
    """Moments of the velocities of a body."""

    momentum: np.ndarray  # (3,) p = ∫ ẋ dm
    mixed: np.ndarray  # (3, 3) P = ∫ ẋ xᵀ dm

    def turned(self, R: np.ndarray, r: np.ndarray) -> "Moments":
        """Moments in the axes and about the origin of a frame from which the present one is turned by R and lies at r."""
        momentum = R @ self.momentum
        return Moments(momentum, congruent(R, self.mixed) + np.outer(momentum, r))

    @property
    def of_rotation(self) -> np.ndarray:
        """D (3, 3), the part of B that takes an angular velocity to a moment."""
        return np.trace(self.mixed) * np.eye(3) - self.mixed

    def bias_force(self, S: np.ndarray) -> np.ndarray:
        """B S (6, k)."""
        return np.concatenate([self.of_rotation @ S[:3], -skew(self.momentum) @ S[:3]])

    def transposed_bias_moment(self, S: np.ndarray) -> np.ndarray:
        """Moment (3, k) of Bᵀ S, whose force is zero."""
        return self.of_rotation.T @ S[:3] + skew(self.momentum) @ S[3:]


class CompositeBodies:
    """Composite bodies of a tree in one state.

    ``rate_of``: time derivative of functions of the coordinates at these rates; needed where subspaces move in their link
    frames.
    """

    def __init__(self, tree: KinematicTree, v: np.ndarray, rate_of: Callable = np.zeros_like):
        self.tree, self.v, self.rate_of = tree, v, rate_of
        self.velocities, self.inertias = tree.carried(v), composite_inertias(tree)
        self.subspaces = {body: kin.S for body, kin in tree.joint_kinematics.items()}

    @cached_property
    def moments(self) -> dict[int, Moments]:
        """Moments of the composite body of each link, in its link frame."""
        tree, found = self.tree, {body: self._own(body) for body in self.tree.joint_kinematics}
        for edge in reversed(tree.edges):
            if edge.inner >= 0:
                link, kin = tree.links[edge.outer], tree.joint_kinematics[edge.outer]
                carried = found[edge.outer].turned(kin.R, kin.p).turned(link.R, link.p)
                found[edge.inner] = Moments(*(a + b for a, b in zip(found[edge.inner], carried, strict=True)))
        return found

    def _own(self, body: int) -> Moments:
        link, omega, linear = self.tree.links[body], self.velocities[body][:3], self.velocities[body][3:]
        (J, _, mass), h = link.inertia, link.first
        second = np.trace(J) / 2.0 * np.eye(3) - J
        return Moments(mass[0, 0] * linear + cross(omega, h), np.outer(linear, h) + skew(omega) @ second)

    @property
    def has_constant_subspaces(self) -> bool:
        """Whether all motion subspaces are constants of their link frames."""
        return all(_is_constant(S) for S in self.subspaces.values())

    @cached_property
    def subspace_rates(self) -> dict[int, np.ndarray]:
        """Time derivative Ṡ (6, k) of each motion subspace: v × S, and that of S in the link frame."""
        found = {body: motion_cross(self.velocities[body], S) for body, S in self.subspaces.items()}
        for body, S in self.subspaces.items():
            if not _is_constant(S):
                found[body] = found[body] + self.rate_of(S)
        return found

    def mass_matrix(self) -> np.ndarray:
        """M (n_v, n_v)."""
        S, none = self.subspaces, {body: np.zeros((6, S.shape[1])) for body, S in self.subspaces.items()}
        forces = {body: apply(self.inertias[body], S[body]) for body in S}
        return self._paired(forces, forces, S, none)

    def coriolis_matrix(self) -> np.ndarray:
        """C (n_v, n_v); zero rows and columns for joints outside the tree."""
        S, rates = self.subspaces, self.subspace_rates
        forces = {body: apply(self.inertias[body], rates[body]) + self.moments[body].bias_force(S[body]) for body in S}
        return self._paired(forces, forces, rates, S)

    def inverse_dynamics_derivatives(self, acceleration) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of M q̈ + h, each (n_v, n_v), by displacements along the rates, and by rates.

        The subspaces are constants of the link frames. With v, a of the inner body, Ψ̇ = v × S and Ψ̈ = a × S + v × Ψ̇, and
        with the force f of the composite body, joint j changes the force of a joint i that carries it at the rates
        S_iᵀ (I_j Ψ̈_j + 2 B_j Ψ̇_j + S_j ×* f_j) and S_iᵀ (I_j (Ψ̇_j + Ṡ_j) + 2 B_j S_j) (Singh, Russell and Wensing,
        Efficient analytical derivatives of rigid-body dynamics using spatial vector algebra, 2022).

        ``acceleration`` (n_v,): joint accelerations.
        """
        S, inertias, B, inner = self.subspaces, self.inertias, self.moments, self._inner_motions(acceleration)
        slow = {body: motion_cross(inner[body][0], S[body]) for body in S}
        fast = {body: motion_cross(inner[body][1], S[body]) + motion_cross(inner[body][0], slow[body]) for body in S}
        loads = self.tree.gathered(self.tree.inertia_forces(acceleration))
        within = {body: apply(inertias[body], fast[body]) + 2.0 * B[body].bias_force(slow[body]) for body in S}
        carried = {body: within[body] + _force_cross(S[body], loads[body]) for body in S}
        by_q = self._paired(within, carried, fast, {body: 2.0 * slow[body] for body in S})
        turning = {body: slow[body] + self.subspace_rates[body] for body in S}
        forces = {body: apply(inertias[body], turning[body]) + 2.0 * B[body].bias_force(S[body]) for body in S}
        return by_q, self._paired(forces, forces, turning, {body: 2.0 * S[body] for body in S})

    def _inner_motions(self, acceleration) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Spatial velocity and acceleration (6,) of the inner link of each link, in the frame of the latter."""
        tree, accelerations, found = self.tree, self.tree.accelerations(acceleration), {}
        for edge in tree.edges:
            body, place = edge.outer, tree.subsystem.joints[edge.constraint].v
            S, v, a = tree.joint_kinematics[body].S, self.velocities[body], accelerations[body]
            spatial = np.concatenate([a[:3], a[3:] - cross(v[:3], v[3:])])
            across = S @ self.v[place]
            found[body] = v - across, spatial - S @ acceleration[place] - motion_cross(v, across)
        return found

    def _paired(self, within: dict, carried: dict, rates: dict, motions: dict) -> np.ndarray:
        """Matrix (n_v, n_v) of entries S_iᵀ F_j, and I_j S_j · A_i + B_jᵀ S_j · C_i, for joints i that carry j.

        ``within``, ``carried``: wrenches F (6, k) of each joint, at the joint itself and at those that carry it. ``rates``,
        ``motions``: A and C (6, k) of each joint.
        """
        tree, to = self.tree, {edge.outer: edge for edge in self.tree.edges}
        found = np.zeros((self.v.size, self.v.size), dtype=object)
        for edge in tree.edges:
            body, place = edge.outer, tree.subsystem.joints[edge.constraint].v
            S, force, here = self.subspaces[body], carried[body], edge
            momentum, moment = apply(self.inertias[body], S), self.moments[body].transposed_bias_moment(S)
            found[place, place] = S.T @ within[body]
            while here.inner >= 0:
                link, kin = tree.links[here.outer], tree.joint_kinematics[here.outer]
                force, momentum = _to_inner(link, kin, force), _to_inner(link, kin, momentum)
                moment, here = link.R @ (kin.R @ moment), to[here.inner]
                rows = tree.subsystem.joints[here.constraint].v
                found[rows, place] = self.subspaces[here.outer].T @ force
                found[place, rows] = (rates[here.outer].T @ momentum + motions[here.outer][:3].T @ moment).T
        return found


def _is_constant(S: np.ndarray) -> bool:
    return all(entry.is_constant for entry in S.flat if isinstance(entry, Expression))


def motion_cross(motion: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Spatial cross product v × S of a motion (6,) and motions (6,) or (6, k)."""
    turn = skew(motion[:3])
    return np.concatenate([turn @ S[:3], turn @ S[3:] + skew(motion[3:]) @ S[:3]])


def _force_cross(S: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Spatial cross products S ×* f (6, k) of motions and a wrench (6,)."""
    moment, linear = skew(force[:3]), skew(force[3:])
    return -np.concatenate([moment @ S[:3] + linear @ S[3:], linear @ S[:3]])


def _to_inner(link: Link, kin: JointKinematics, forces: np.ndarray) -> np.ndarray:
    """Wrenches (6, k) of the outer link in the inner link frame."""
    for R, p in ((kin.R, kin.p), (link.R, link.p)):
        linear = R @ forces[3:]
        forces = np.concatenate([R @ forces[:3] + skew(p) @ linear, linear])
    return forces


def first_moments(tree: KinematicTree) -> dict[int, tuple[float, np.ndarray]]:
    """Mass, and mass times its centre (3,) in the link frame, of each link with all links that it carries."""
    found = {body: (tree.links[body].inertia[2][0, 0], tree.links[body].first) for body in tree.joint_kinematics}
    for edge in reversed(tree.edges):
        if edge.inner >= 0:
            link, kin, (mass, first) = tree.links[edge.outer], tree.joint_kinematics[edge.outer], found[edge.outer]
            carried = link.R @ (kin.R @ first + mass * kin.p) + mass * link.p
            found[edge.inner] = found[edge.inner][0] + mass, found[edge.inner][1] + carried
    return found


def composite_inertias(tree: KinematicTree) -> dict:
    """Inertia of each link with all links that it carries, in its link frame: those of rigid bodies, I, m c and m."""
    moments = first_moments(tree)
    inertias = {body: tree.links[body].inertia[0] for body in moments}
    for edge in reversed(tree.edges):
        if edge.inner >= 0:
            link, kin, (mass, first) = tree.links[edge.outer], tree.joint_kinematics[edge.outer], moments[edge.outer]
            turned = _about_inner(kin.R, kin.p, mass, kin.R @ first, inertias[edge.outer])
            first = kin.R @ first + mass * kin.p
            turned = _about_inner(link.R, link.p, mass, link.R @ first, turned)
            inertias[edge.inner] = inertias[edge.inner] + turned
    return {body: (inertias[body], skew(first), mass * np.eye(3)) for body, (mass, first) in moments.items()}


def _about_inner(R, p, mass, first, inertia) -> np.ndarray:
    """Inertia (3, 3), turned by R and about an origin from which the present one lies at p; ``first`` is m c, turned.

    I + 2 (p · g) 1 − p gᵀ − g pᵀ with g = m c + m p / 2.
    """
    g = first + (mass / 2.0) * p
    (x, y, z), added = 2.0 * p * g, np.outer(-p, g) - np.outer(g, p)
    added[np.diag_indices(3)] = y + z, x + z, x + y
    return mirrored(congruent(R, inertia) + added)
