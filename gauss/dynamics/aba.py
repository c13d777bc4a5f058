"""Articulated inertias: the elimination of a tree, leaf by leaf, in its joint coordinates, over numbers or symbols.

The same elimination as ``gauss.backends.recursion``, with the compulsion written in the moving axes of each link
(Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 7.3). An articulated inertia is kept as three 3 × 3 blocks
[A, B; Bᵀ, C], so that symmetry and zeros are used.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.structure import Edge
from gauss.codegen import as_number
from gauss.dynamics.link_frames import Link
from gauss.dynamics.rnea import JointKinematics, KinematicTree, apply, force_to_inner, gyroscopic, to_outer
from gauss.rotations import congruent, skew

NOTHING = np.zeros(6)


class Elimination(NamedTuple):
    """What the inward pass leaves at a link: U = Î S, (Sᵀ Î S)⁻¹, and the inertia that the inner link still feels.

    Links of a train share one coordinate: D is the sum over all of them, and what is removed along it, −U D⁻¹ Uᵀ with the
    U of all, is taken from the inner link at once; here they have their whole inertia.
    """

    U: np.ndarray
    D_inverse: np.ndarray
    projected: tuple


class ArticulatedBody:
    """A tree in one state, eliminated once for any number of right-hand sides.

    Parameters
    ----------
    tree : KinematicTree
        The tree.
    """

    def __init__(self, tree: KinematicTree):
        self.tree = tree
        self.clusters = _clusters(tree)
        self.places = {edge.outer: place for place, cluster in enumerate(self.clusters) for edge, _ in cluster}
        self.outward = {body: [] for body in (-1, *self.places)}  # places of the clusters on a link
        for place, ((edge, _), *_) in enumerate(self.clusters):
            self.outward[edge.inner].append(place)
        self.eliminations = self._eliminate()

    def _eliminate(self) -> dict[int, Elimination]:
        tree = self.tree
        inertias = {body: link.inertia for body, link in tree.links.items()}
        found = {}
        for cluster in reversed(self.clusters):
            inner = cluster[0][0].inner
            if len(cluster) == 1:
                body = cluster[0][0].outer
                found[body] = eliminate(tree.joint_kinematics[body], inertias[body])
            else:
                found |= self._eliminate_train(cluster, inertias)
            if inner < 0:
                continue
            for edge, _ in cluster:
                body = edge.outer
                moved = inertia_to_inner(tree.links[body], tree.joint_kinematics[body], found[body].projected)
                inertias[inner] = add(inertias[inner], moved)
            if len(cluster) > 1:
                pull = sum(self._to_inner(edge, found[edge.outer].U[:, 0]) for edge, _ in cluster)
                D_inverse = found[cluster[0][0].outer].D_inverse
                inertias[inner] = add(inertias[inner], _blocks(-np.outer(pull, D_inverse @ pull[None])))
        return found

    def _eliminate_train(self, cluster, inertias) -> dict[int, Elimination]:
        """Eliminate the common coordinate of a train; what it frees is taken from the inertia of the inner link."""
        moves = {edge.outer: ratio * self.tree.joint_kinematics[edge.outer].S for edge, ratio in cluster}
        U = {body: apply(inertias[body], S) for body, S in moves.items()}
        D_inverse = invert(sum(S.T @ U[body] for body, S in moves.items()))
        return {body: Elimination(U[body], D_inverse, inertias[body]) for body in moves}

    def motion(self, effort, pushes=None):
        """Accelerations under weight, generalised forces (n_v,) and force vectors {body: (6,)} in link frames."""
        tree = self.tree
        forces = {body: gyroscopic(tree.links[body], tree.omegas[body]) for body in tree.joint_kinematics}
        for body, push in (pushes or {}).items():
            forces[body] = forces[body] - push
        return self._solve(forces, {body: kin.bias for body, kin in tree.joint_kinematics.items()}, tree.ground, effort)

    def response(self, effort, pushes=None, slips=None):
        """Accelerations that forces alone would cause, where they cause any: nothing moves and nothing weighs.

        With ``slips`` {body: (6,)} links accelerate by so much more than their joints and the inner links make them.
        """
        return self._solve({body: -push for body, push in (pushes or {}).items()}, slips or {}, None, effort)

    def half_response(self, effort, pushes=None) -> np.ndarray:
        """Halves w (n,) of responses to forces: wᵀ w′ is what one set of forces does along another, f M⁻¹ f′.

        They are D^{-½} u, joint by joint, of what drives fall short of: no digits of small responses are lost, as they are
        where responses are subtracted from each other.
        """
        short, _ = self._inward({body: -push for body, push in (pushes or {}).items()}, {}, effort)
        found = []
        for (edge, _), *_ in self.clusters:
            D_inverse = self.eliminations[edge.outer].D_inverse
            found.append(_root(D_inverse) @ short[edge.outer] if edge.outer in short else np.zeros(len(D_inverse)))
        return np.concatenate(found)

    def _solve(self, forces, biases, base, effort):
        """Joint accelerations by joint, and link accelerations by body; what is missing, given or found, is zero."""
        short, pulled = self._inward(forces, biases, effort)
        accelerations, rates = {} if base is None else {-1: base}, {}
        moved = self._outward_of(pulled if base is None else range(len(self.clusters)))
        for cluster in (self.clusters[place] for place in sorted(moved)):
            first = cluster[0][0]
            lacking = short.get(first.outer, np.zeros(1))
            carried = {
                edge.outer: to_outer(
                    self.tree.links[edge.outer],
                    self.tree.joint_kinematics[edge.outer],
                    accelerations.get(edge.inner, NOTHING),
                )
                + biases.get(edge.outer, NOTHING)
                for edge, _ in cluster
            }
            if len(cluster) > 1:  # what the other links of a train are carried with, its one coordinate feels as well
                lacking = lacking - sum(self.eliminations[body].U.T @ own for body, own in carried.items())
            for edge, ratio in cluster:
                body, kin, elimination = edge.outer, self.tree.joint_kinematics[edge.outer], self.eliminations[edge.outer]
                if len(cluster) == 1:
                    rates[edge.constraint], accelerations[body] = acceleration_outward(
                        kin, elimination, lacking, carried[body]
                    )
                else:
                    rates[edge.constraint] = ratio * (elimination.D_inverse @ lacking)
                    accelerations[body] = carried[body] + kin.S @ rates[edge.constraint]
        return rates, accelerations

    def _inward(self, forces, biases, effort) -> tuple[dict, set[int]]:
        """What drives fall short of, by the first body of a cluster, and the places of the clusters that are pulled at."""
        joints, short = self.tree.part.joints, {}
        forces = dict(forces)
        pulled = self._pulled(forces, biases, effort)
        for cluster in (self.clusters[place] for place in sorted(pulled, reverse=True)):
            driven = {edge.outer: effort[joints[edge.constraint].v] for edge, _ in cluster}
            first = cluster[0][0]
            if len(cluster) == 1:
                body = first.outer
                given = forces.get(body, NOTHING), biases.get(body, NOTHING), driven[body]
                short[body], pull = force_inward(self.tree.joint_kinematics[body], self.eliminations[body], *given)
                pulls = {body: pull}
            else:
                short[first.outer], pulls = self._pull_train(cluster, forces, biases, driven)
            if first.inner >= 0:
                for edge, _ in cluster:
                    forces[edge.inner] = forces.get(edge.inner, NOTHING) + self._to_inner(edge, pulls[edge.outer])
        return short, pulled

    def _pulled(self, forces, biases, effort) -> set[int]:
        """Places of clusters that something pulls at, there or further out."""
        seeds = {self.places[body] for body in (*forces, *biases)}
        if effort.dtype == object or effort.any():
            joints = self.tree.part.joints
            nothing = lambda edge: _is_nothing(effort[joints[edge.constraint].v])  # noqa: E731
            seeds |= {self.places[edge.outer] for cluster in self.clusters for edge, _ in cluster if not nothing(edge)}
        found: set[int] = set()
        for place in seeds:
            while place is not None and place not in found:
                found.add(place)
                place = self.places.get(self.clusters[place][0][0].inner)
        return found

    def _outward_of(self, places) -> set[int]:
        """Places of clusters with all that are further out."""
        found, waiting = set(places), list(places)
        while waiting:
            for edge, _ in self.clusters[waiting.pop()]:
                further = [place for place in self.outward[edge.outer] if place not in found]
                found.update(further)
                waiting += further
        return found

    def _pull_train(self, cluster, forces, biases, driven):
        """What the drives of a train fall short of together, and the force vectors that remain for the inner link."""
        short, pulled = 0.0, 0.0
        for edge, ratio in cluster:
            body = edge.outer
            short = short + ratio * (driven[body] - self.tree.joint_kinematics[body].S.T @ forces.get(body, NOTHING))
            pulled = pulled + self.eliminations[body].U.T @ biases.get(body, NOTHING)
        pulls = {}
        for edge, _ in cluster:
            body, (U, D_inverse, inertia) = edge.outer, self.eliminations[edge.outer]
            held = forces.get(body, NOTHING) + apply(inertia, biases.get(body, NOTHING))
            pulls[body] = held + U @ (D_inverse @ (short - pulled))
        return short, pulls

    def _to_inner(self, edge: Edge, force):
        return force_to_inner(self.tree.links[edge.outer], self.tree.joint_kinematics[edge.outer], force)


def eliminate(kin: JointKinematics, inertia) -> Elimination:
    """Eliminate the joint of a link with articulated inertia Î."""
    U = apply(inertia, kin.S)
    D_inverse = invert(kin.S.T @ U)
    return Elimination(U, D_inverse, _project(inertia, U, D_inverse, kin.S))


def force_inward(kin: JointKinematics, elimination: Elimination, force, bias, driven):
    """What the drive of a joint falls short of, and the force vector that remains for the inner link."""
    short = driven - kin.S.T @ force
    return short, force + apply(elimination.projected, bias) + elimination.U @ (elimination.D_inverse @ short)


def acceleration_outward(kin: JointKinematics, elimination: Elimination, short, carried):
    """Joint accelerations, and the acceleration of the link."""
    rates = elimination.D_inverse @ (short - elimination.U.T @ carried)
    return rates, carried + kin.S @ rates


def _is_nothing(part: np.ndarray) -> bool:
    return not any(as_number(entry) != 0 for entry in part)


def _clusters(tree: KinematicTree) -> list[list[tuple[Edge, float]]]:
    """Edges that one set of coordinates moves, with their ratios: single joints and trains, inner ones first."""
    trains = {joint: train for train in tree.part.trains for joint in train.joints}
    edges = {edge.constraint: edge for edge in tree.edges}
    clusters = []
    for edge in tree.edges:
        train = trains.get(edge.constraint)
        if train is None:
            clusters.append([(edge, 1.0)])
        elif edge.constraint == train.joints[0]:
            clusters.append([(edges[joint], ratio) for joint, ratio in zip(*train, strict=True)])
    return clusters


def inertia_to_inner(link: Link, kin: JointKinematics, inertia):
    """Inertia of the outer link in the inner link frame."""
    for R, p in ((kin.R, kin.p), (link.R, link.p)):
        A, B, C = (congruent(R, block) for block in inertia)
        A, C = _symmetric(A), _symmetric(C)
        lever = skew(p)
        shifted = B + lever @ C
        A = A - shifted @ lever + lever @ B.T
        inertia = _symmetric(A), shifted, C
    return inertia


def _symmetric(A: np.ndarray) -> np.ndarray:
    """The same matrix with its upper triangle mirrored: equal entries are one expression."""
    return np.array([[A[min(i, j), max(i, j)] for j in range(len(A))] for i in range(len(A))])


def add(one, two):
    """Sum of two inertias in the same frame."""
    return tuple(a + b for a, b in zip(one, two, strict=True))


def _project(inertia, U, D_inverse, S):
    """Î − U D⁻¹ Uᵀ; along a coordinate axis that the joint frees it is exactly zero."""
    A, B, C = inertia
    removed = U @ D_inverse @ U.T
    blocks = A - removed[:3, :3], B - removed[:3, 3:], C - removed[3:, 3:]
    full = np.concatenate([np.concatenate(blocks[:2], axis=1), np.concatenate([blocks[1].T, blocks[2]], axis=1)])
    for axis in _free_axes(S):
        full[axis, :] = 0.0
        full[:, axis] = 0.0
    return _blocks(_symmetric(full))


def _blocks(full: np.ndarray):
    return full[:3, :3], full[:3, 3:], full[3:, 3:]


def _free_axes(S: np.ndarray) -> list[int]:
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
