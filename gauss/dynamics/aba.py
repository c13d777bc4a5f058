"""Articulated-body algorithm: Î_i = I_i + Σ_c X_cᵀ (Î_c − U_c D_c⁻¹ U_cᵀ) X_c with U = Î S and D = Sᵀ Î S.

The elimination of ``gauss.backends.tree_factor`` in the moving axes of each link, over numbers or symbols (Featherstone,
Rigid Body Dynamics Algorithms, 2008, sec. 7.3). A tree is eliminated once for any number of right-hand sides. Articulated
inertias are kept as three 3 × 3 blocks [A, B; Bᵀ, C], so that symmetry and zeros are used.
"""

from contextlib import suppress
from copy import copy
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.backends.structure import Edge
from gauss.codegen import LDLT, as_number
from gauss.dynamics.link_frames import Link
from gauss.dynamics.rnea import JointKinematics, KinematicTree, apply, force_to_inner, gyroscopic, to_outer
from gauss.rotations import congruent, skew

ZERO = np.zeros(6)  # spatial vector


class Elimination(NamedTuple):
    """Elimination of a joint: U = Î S, D⁻¹ = (Sᵀ Î S)⁻¹, and the inertia Î − U D⁻¹ Uᵀ that is passed on to the inner link.

    Links of a gear train share one coordinate: D is the sum over all of them, and −U D⁻¹ Uᵀ, with the U of all, is added to
    the inertia of the inner link at once; ``projected`` is then the whole Î of the link.
    """

    U: np.ndarray  # (6, k)
    D_inverse: np.ndarray  # (k, k)
    projected: tuple | None = None  # blocks A, B, C of Î − U D⁻¹ Uᵀ

    def force_inward(self, kin: JointKinematics, force, bias, driven):
        """Joint force u = τ − Sᵀ p, and the bias force p + (Î − U D⁻¹ Uᵀ) c + U D⁻¹ u passed on to the inner link."""
        u = driven - kin.S.T @ force
        return u, force + apply(self.projected, bias) + self.U @ (self.D_inverse @ u)

    def acceleration_outward(self, kin: JointKinematics, u, carried):
        """q̈ = D⁻¹ (u − Uᵀ a) of the joint, and the acceleration a + S q̈ of the link."""
        rates = self.D_inverse @ (u - self.U.T @ carried)
        return rates, carried + kin.S @ rates


class FreeElimination:
    """Elimination of a joint of six freedoms with orthogonal S: D⁻¹ = Sᵀ Î⁻¹ S, and no inertia is passed on.

    ZeroDivisionError if a pivot of Î is a constant zero.

    ``S`` (6, 6): motion subspace.
    """

    projected = (np.zeros((3, 3)),) * 3

    def __init__(self, S: np.ndarray, inertia):
        self.S, self.inertia = S, whole_inertia(inertia)
        self.factor = LDLT(self.inertia)

    @property
    def U(self) -> np.ndarray:
        """Matrix Î S (6, 6)."""
        return self.inertia @ self.S

    @cached_property
    def D_inverse(self) -> np.ndarray:
        """Matrix D⁻¹ (6, 6)."""
        return np.column_stack([self.S.T @ self.spatial(unit) for unit in np.eye(6)])

    def spatial(self, u) -> np.ndarray:
        """Acceleration Î⁻¹ S u (6,) of the link under a force along the joint."""
        force = self.S @ u
        return self.factor.solve(force).astype(np.result_type(force, self.inertia))

    def force_inward(self, kin: JointKinematics, force, bias, driven):
        """Joint force u = τ − Sᵀ p, and the bias force S τ passed on to the inner link."""
        return driven - kin.S.T @ force, kin.S @ driven

    def acceleration_outward(self, kin: JointKinematics, u, carried):
        """q̈ = Sᵀ (Î⁻¹ S u − a) of the joint, and the acceleration of the link."""
        reached = self.spatial(u)
        return kin.S.T @ (reached - carried), reached


class ArticulatedBody:
    """Forward dynamics of an open tree in one state: M q̈ + h = τ."""

    def __init__(self, tree: KinematicTree):
        self.tree = tree
        self.clusters = _clusters(tree)
        self.places = {edge.outer: place for place, cluster in enumerate(self.clusters) for edge, _ in cluster}
        self.outward: dict[int, list[int]] = {body: [] for body in (-1, *self.places)}  # places of the clusters on a link
        for place, ((edge, _), *_) in enumerate(self.clusters):
            self.outward[edge.inner].append(place)
        self.eliminations = self._eliminate()

    def _eliminate(self) -> dict[int, Elimination | FreeElimination]:
        inertias = {body: link.inertia for body, link in self.tree.links.items()}
        found: dict[int, Elimination | FreeElimination] = {}
        for cluster in reversed(self.clusters):
            found |= self._eliminate_cluster(cluster, inertias)
        return found

    def _eliminate_cluster(self, cluster, inertias) -> dict[int, Elimination | FreeElimination]:
        """Elimination of the joints of a cluster; its inertia is added to that of the inner link in place."""
        tree, inner, body = self.tree, cluster[0][0].inner, cluster[0][0].outer
        found: dict[int, Elimination | FreeElimination]
        if len(cluster) == 1:
            found = {body: _eliminated(tree.joint_kinematics[body], inertias[body])}
        else:
            found = self._eliminate_train(cluster, inertias)
        if inner < 0:
            return found
        for edge, _ in cluster:
            body = edge.outer
            moved = inertia_to_inner(tree.links[body], tree.joint_kinematics[body], found[body].projected)
            inertias[inner] = add(inertias[inner], moved)
        if len(cluster) > 1:
            U = sum(self._to_inner(edge, found[edge.outer].U[:, 0]) for edge, _ in cluster)
            D_inverse = found[cluster[0][0].outer].D_inverse
            inertias[inner] = add(inertias[inner], blocks(-np.outer(U, D_inverse @ U[None])))
        return found

    def _eliminate_train(self, cluster, inertias) -> dict[int, Elimination | FreeElimination]:
        """Elimination of the common coordinate of a gear train."""
        subspaces = {edge.outer: ratio * self.tree.joint_kinematics[edge.outer].S for edge, ratio in cluster}
        U = {body: apply(inertias[body], S) for body, S in subspaces.items()}
        D_inverse = invert(sum(S.T @ U[body] for body, S in subspaces.items()))
        return {body: Elimination(U[body], D_inverse, inertias[body]) for body in subspaces}

    def moving(self, tree: KinematicTree) -> "ArticulatedBody":
        """The same elimination, for a tree in the same position at other rates."""
        found = copy(self)
        found.tree = tree
        return found

    def motion(self, tau, wrenches=None):
        """Accelerations by joint and by body under gravity, generalised forces (n_v,) and wrenches {body: (6,)} on links."""
        tree = self.tree
        forces = {body: gyroscopic(tree.links[body], tree.omegas[body]) for body in tree.joint_kinematics}
        for body, wrench in (wrenches or {}).items():
            forces[body] = forces[body] - wrench
        return self._solve(forces, {body: kin.bias for body, kin in tree.joint_kinematics.items()}, tree.ground, tau)

    def response(self, tau, wrenches=None, biases=None):
        """Accelerations by joint and by body that forces alone cause, without gravity and velocities; zeros are left out.

        ``biases`` {body: (6,)} are added to the accelerations across the joints.
        """
        return self._solve({body: -wrench for body, wrench in (wrenches or {}).items()}, biases or {}, None, tau)

    def half_response(self, tau, wrenches=None) -> np.ndarray:
        """Vector w = D^{-½} u (n,), joint by joint, such that wᵀ w′ = fᵀ M⁻¹ f′.

        Small responses keep their digits, which differences of whole responses lose.
        """
        u, _ = self._inward({body: -wrench for body, wrench in (wrenches or {}).items()}, {}, tau)
        found = []
        for (edge, _), *_ in self.clusters:
            D_inverse = self.eliminations[edge.outer].D_inverse
            found.append(_root(D_inverse) @ u[edge.outer] if edge.outer in u else np.zeros(len(D_inverse)))
        return np.concatenate(found)

    def _solve(self, forces, biases, base, tau):
        """Accelerations by joint and by body; missing entries, given or found, are zero."""
        u, loaded = self._inward(forces, biases, tau)
        accelerations, rates = {} if base is None else {-1: base}, dict[int, np.ndarray]()
        moved = self._outward_of(loaded if base is None else range(len(self.clusters)))
        for cluster in (self.clusters[place] for place in sorted(moved)):
            first = cluster[0][0].outer
            own_u = u[first] if first in u else np.zeros(self.tree.joint_kinematics[first].S.shape[1])
            self._carry_outward(cluster, own_u, biases, rates, accelerations)
        return rates, accelerations

    def _carry_outward(self, cluster, own_u, biases, rates: dict, accelerations: dict):
        """Add the accelerations of the joints and links of a cluster."""
        carried = {edge.outer: self._to_outer(edge, accelerations, biases) for edge, _ in cluster}
        if len(cluster) > 1:  # all links of a gear train act on its one coordinate
            own_u = own_u - sum(self.eliminations[body].U.T @ own for body, own in carried.items())
        for edge, ratio in cluster:
            body, kin, elimination = edge.outer, self.tree.joint_kinematics[edge.outer], self.eliminations[edge.outer]
            if len(cluster) == 1:
                rates[edge.constraint], accelerations[body] = elimination.acceleration_outward(kin, own_u, carried[body])
            else:
                rates[edge.constraint] = ratio * (elimination.D_inverse @ own_u)
                accelerations[body] = carried[body] + kin.S @ rates[edge.constraint]

    def _to_outer(self, edge: Edge, accelerations: dict, biases: dict) -> np.ndarray:
        """Acceleration of the inner link carried to the outer link frame, with the bias of the joint."""
        body = edge.outer
        carried = to_outer(self.tree.links[body], self.tree.joint_kinematics[body], accelerations.get(edge.inner, ZERO))
        return carried + biases.get(body, ZERO)

    def _inward(self, forces, biases, tau) -> tuple[dict, set[int]]:
        """Forces u = τ − Sᵀ p by the first body of each cluster, and places of clusters that forces or biases reach."""
        u = {}
        forces = dict(forces)
        loaded = self._loaded(forces, biases, tau)
        for cluster in (self.clusters[place] for place in sorted(loaded, reverse=True)):
            first = cluster[0][0]
            u[first.outer], passed = self._pass_inward(cluster, forces, biases, tau)
            if first.inner >= 0:
                self._gather(cluster, passed, forces)
        return u, loaded

    def _pass_inward(self, cluster, forces, biases, tau) -> tuple[np.ndarray, dict]:
        """Joint force u of a cluster, and the bias forces of its links that are passed on to the inner link."""
        joints = self.tree.subsystem.joints
        driven = {edge.outer: tau[joints[edge.constraint].v] for edge, _ in cluster}
        if len(cluster) > 1:
            return self._train_force_inward(cluster, forces, biases, driven)
        body = cluster[0][0].outer
        given = forces.get(body, ZERO), biases.get(body, ZERO), driven[body]
        u, onward = self.eliminations[body].force_inward(self.tree.joint_kinematics[body], *given)
        return u, {body: onward}

    def _gather(self, cluster, passed, forces: dict):
        """Add the forces that the links of a cluster pass on to those of the inner link."""
        for edge, _ in cluster:
            forces[edge.inner] = forces.get(edge.inner, ZERO) + self._to_inner(edge, passed[edge.outer])

    def _loaded(self, forces, biases, tau) -> set[int]:
        """Places of the clusters with a force or bias, on them or further out."""
        seeds = {self.places[body] for body in (*forces, *biases)}
        if tau.dtype == object or tau.any():
            joints = self.tree.subsystem.joints
            is_idle = lambda edge: is_zero(tau[joints[edge.constraint].v])  # noqa: E731
            seeds |= {self.places[edge.outer] for cluster in self.clusters for edge, _ in cluster if not is_idle(edge)}
        found: set[int] = set()
        for seed in seeds:
            place: int | None = seed
            while place is not None and place not in found:
                found.add(place)
                place = self.places.get(self.clusters[place][0][0].inner)
        return found

    def _outward_of(self, places) -> set[int]:
        """Places of clusters, with those further out."""
        found, waiting = set(places), list(places)
        while waiting:
            for edge, _ in self.clusters[waiting.pop()]:
                further = [place for place in self.outward[edge.outer] if place not in found]
                found.update(further)
                waiting += further
        return found

    def _train_force_inward(self, cluster, forces, biases, driven):
        """Force u of the common coordinate of a gear train, and the bias forces passed on to the inner link."""
        u, of_biases = 0.0, 0.0
        for edge, ratio in cluster:
            body = edge.outer
            u = u + ratio * (driven[body] - self.tree.joint_kinematics[body].S.T @ forces.get(body, ZERO))
            of_biases = of_biases + self.eliminations[body].U.T @ biases.get(body, ZERO)
        passed = {}
        for edge, _ in cluster:
            body, elimination = edge.outer, self.eliminations[edge.outer]
            own = forces.get(body, ZERO) + apply(elimination.projected, biases.get(body, ZERO))
            passed[body] = own + elimination.U @ (elimination.D_inverse @ (u - of_biases))
        return u, passed

    def _to_inner(self, edge: Edge, force):
        return force_to_inner(self.tree.links[edge.outer], self.tree.joint_kinematics[edge.outer], force)


def eliminate(kin: JointKinematics, inertia) -> Elimination:
    """Eliminate the joint of a link with articulated inertia Î."""
    U = apply(inertia, kin.S)
    D_inverse = invert(kin.S.T @ U)
    return Elimination(U, D_inverse, _project(inertia, U, D_inverse, kin.S))


def _eliminated(kin: JointKinematics, inertia) -> Elimination | FreeElimination:
    """Eliminate the joint of a link, with six freedoms on their own."""
    if kin.S.shape[1] == 6 and is_zero(kin.S[3:, 3:].ravel()):  # a free joint whose child is the link
        with suppress(ZeroDivisionError):
            return FreeElimination(kin.S, inertia)
    return eliminate(kin, inertia)


def is_zero(part: np.ndarray) -> bool:
    """Whether all entries are constant zeros."""
    return not any(as_number(entry) != 0 for entry in part)


def _clusters(tree: KinematicTree) -> list[list[tuple[Edge, float]]]:
    """Joints that share coordinates, with their ratios: single joints and gear trains, inner ones first."""
    trains = {joint: train for train in tree.subsystem.trains for joint in train.joints}
    edges = {edge.constraint: edge for edge in tree.edges}
    clusters = []
    for edge in tree.edges:
        train = trains.get(edge.constraint)
        if train is None:
            clusters.append([(edge, 1.0)])
        elif edge.constraint == train.joints[0]:
            clusters.append([(edges[joint], ratio) for joint, ratio in zip(train.joints, train.ratios, strict=True)])
    return clusters


def inertia_to_inner(link: Link, kin: JointKinematics, inertia):
    """Inertia of the outer link in the inner link frame."""
    for R, p in ((kin.R, kin.p), (link.R, link.p)):
        A, B, C = (congruent(R, block) for block in inertia)
        A, C = mirrored(A), mirrored(C)
        lever = skew(p)
        shifted = B + lever @ C
        A = A - shifted @ lever + lever @ B.T
        inertia = mirrored(A), shifted, C
    return inertia


def mirrored(A: np.ndarray) -> np.ndarray:
    """The same matrix with its upper triangle mirrored: equal entries are one expression."""
    return np.array([[A[min(i, j), max(i, j)] for j in range(len(A))] for i in range(len(A))])


def add(one, two):
    """Sum of two inertias in the same frame."""
    return tuple(a + b for a, b in zip(one, two, strict=True))


def _project(inertia, U, D_inverse, S):
    """Î − U D⁻¹ Uᵀ; along a coordinate axis that the joint frees it is exactly zero."""
    A, B, C = inertia
    removed = U @ D_inverse @ U.T
    full = whole_inertia((A - removed[:3, :3], B - removed[:3, 3:], C - removed[3:, 3:]))
    for axis in free_axes(S):
        full[axis, :] = 0.0
        full[:, axis] = 0.0
    return blocks(mirrored(full))


def whole_inertia(inertia) -> np.ndarray:
    """Inertia (6, 6) of its blocks A, B, C."""
    A, B, C = inertia
    return np.concatenate([np.concatenate([A, B], axis=1), np.concatenate([B.T, C], axis=1)])


def blocks(full: np.ndarray):
    """Blocks A, B, C of a symmetric matrix (6, 6)."""
    return full[:3, :3], full[:3, 3:], full[3:, 3:]


def free_axes(S: np.ndarray) -> list[int]:
    """Coordinate axes among the columns of the subspace."""
    columns = [[as_number(entry) for entry in column] for column in S.T]
    known = [np.array(column) for column in columns if None not in column]
    return [int(np.argmax(np.abs(column))) for column in known if np.count_nonzero(column) == 1]


def invert(D: np.ndarray) -> np.ndarray:
    """Inverse of a small positive definite matrix, by elimination without pivoting."""
    k = len(D)
    if k == 1:
        return 1.0 / D
    work = np.concatenate([D, np.eye(k)], axis=1)
    for i in range(k):
        work[i] = work[i] / work[i, i]
        for j in range(k):
            if j != i:
                work[j] = work[j] - work[j, i] * work[i]
    return work[:, k:]


def _root(D_inverse: np.ndarray) -> np.ndarray:
    """Upper triangular C with Cᵀ C = D⁻¹ (Cholesky)."""
    k = len(D_inverse)
    C, rest = np.zeros((k, k), dtype=object), D_inverse.copy()
    for i in range(k):
        C[i, i:] = rest[i, i:] / np.sqrt(rest[i, i])
        rest = rest - np.outer(C[i], C[i])
    return C
