"""Articulated-body algorithm with loops eliminated where they close: constraint embedding (Jain 2011, sec. 10 ff.).

The forces of a loop act on its own links only, so its multipliers y are eliminated at its root, the innermost link of the
loop, onto the articulated inertia there. Each row K q̈ = k is carried inward as a column W of wrenches beside the force
p, by the same recursion; Σ û D⁻¹ ûᵀ of its joint forces is its share of S = K M⁻¹ Kᵀ under a root at rest:

    f = Î a + p + W y,   Wᵀ a − S y = r.

A hub, a link where many chains meet, is eliminated as a free body: its inner joint is cut, like a loop joint. So the legs of
a parallel robot are eliminated one by one, with small matrices, before their platform. Such a front, [Î, W; Wᵀ, −S] of
hubs and rows, is quasi-definite where each chain by itself can meet its own rows; near other states it has small pivots,
and the accelerations are not accurate there.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.structure import GROUND
from gauss.codegen import LDLT
from gauss.dynamics.aba import ZERO, ArticulatedBody, blocks, free_axes, is_zero, whole_inertia
from gauss.dynamics.rnea import KinematicTree, force_to_inner

LEAST_RELATIVE_PIVOT = 1e-6  # of a front, over its diagonal entry; accelerations lose that share of their digits


class LoopRow(NamedTuple):
    """Row of the loop constraints."""

    wrenches: dict[int, np.ndarray]  # wrenches (6,) on links of a unit multiplier
    tau: np.ndarray  # (n_v,) generalised forces of a unit multiplier
    root: int  # link at which the row is eliminated; −1 for the ground


class Front(NamedTuple):
    """Rows and hubs that are eliminated at one root: F z + B b = r for the acceleration of the root and pending rows b."""

    # rows, hubs, pending: rows and hubs of z; rows that act on the same chains, and are eliminated further in
    rows: list[int]
    hubs: list[int]
    pending: list[int]
    factor: LDLT  # factorisation F = L D Lᵀ
    G: np.ndarray  # (n, 6 + p) L⁻¹ B
    carried: np.ndarray  # (n, 6 + p) D⁻¹ G
    inverse_pivots: list  # entries of the diagonal of F over those of D


class HubJoint(NamedTuple):
    """Inner joint of a hub, which is cut."""

    T: np.ndarray  # (6, 6 − k) constrained directions of its wrenches
    dual: np.ndarray  # (6, k) dual of its motion subspace
    rows: list[int]  # its rows


class EmbeddedLoops(ArticulatedBody):
    """Forward dynamics of a tree with loop constraints in one state.

    ``hubs``: roots of the fronts of hubs, {hub: root}.
    """

    def __init__(self, tree: KinematicTree, rows, hubs: dict[int, int]):
        self.rows, self.hubs = list(rows), hubs
        self.n_rows = len(self.rows)
        self.S: dict[tuple[int, int], object] = {}
        self.columns: dict[int, dict[int, np.ndarray]] = {}  # û of each row, by the first body of a cluster
        self.passed: dict[int, dict[int, np.ndarray]] = {}  # W + U D⁻¹ û of each row, by body
        self.fronts: dict[int, Front] = {}
        self.hub_joints = {body: self._cut(tree, body, root) for body, root in hubs.items()}
        super().__init__(tree)

    def _cut(self, tree: KinematicTree, body: int, root: int) -> HubJoint:
        """Rows of the inner joint of a hub."""
        kin, link = tree.joint_kinematics[body], tree.links[body]
        edge = next(edge for edge in tree.edges if edge.outer == body)
        pair, first = tree.subsystem.joints[edge.constraint].pair, len(self.rows)
        free = range(3) if pair.kind == "ball" else free_axes(kin.S)  # axes of the link frame
        T, dual = np.eye(6)[:, [axis for axis in range(6) if axis not in free]], kin.S
        for direction in T.T:
            wrenches = {body: direction, edge.inner: -force_to_inner(link, kin, direction)}
            self.rows.append(LoopRow(wrenches, np.zeros(tree.subsystem.n_v), root))
        return HubJoint(T, dual, list(range(first, len(self.rows))))

    @property
    def inverse_pivots(self) -> list:
        """Diagonal entries of the fronts over the pivots that they become; large where a front is near singular."""
        return [share for front in self.fronts.values() for share in front.inverse_pivots]

    @property
    def is_regular(self):
        """Whether no pivot of a front is below :data:`LEAST_RELATIVE_PIVOT`; a condition over symbols."""
        return sum((share * share for share in self.inverse_pivots), 0.0) <= LEAST_RELATIVE_PIVOT**-2  # false for NaN

    @property
    def row_pivots(self) -> dict[int, object]:
        """Pivots of S of the rows in fronts without hubs, by row: those that vanish only where K loses rank."""
        plain = [front for front in self.fronts.values() if not front.hubs]
        return {row: -1.0 / front.factor.inverse_pivots[i] for front in plain for i, row in enumerate(front.rows)}

    def _eliminate(self):
        inertias = {body: link.inertia for body, link in self.tree.links.items()}
        self.eliminations = {}
        columns: dict[int, dict[int, np.ndarray]] = {body: {} for body in inertias}  # W of each row, by body
        for row, own in enumerate(self.rows):
            for body, wrench in own.wrenches.items():
                columns[body][row] = wrench
        for cluster in reversed(self.clusters):
            for edge, _ in cluster:
                inertias[edge.outer] = self._close(edge.outer, inertias, columns)
            if cluster[0][0].outer not in self.hubs:
                self.eliminations |= self._eliminate_cluster(cluster, inertias)
                self._carry_rows(cluster, columns)
        self._close(GROUND, inertias, columns)
        return self.eliminations

    def _carry_rows(self, cluster, columns):
        """Carry the columns of rows across a cluster, and add its share of S."""
        joints, first = self.tree.subsystem.joints, cluster[0][0]
        on_joints = {
            row for row, own in enumerate(self.rows)
            for edge, _ in cluster if not is_zero(own.tau[joints[edge.constraint].v])
        }  # fmt: skip
        found = self.columns[first.outer] = {}
        for row in sorted(on_joints.union(*(columns[edge.outer] for edge, _ in cluster))):
            forces = {edge.outer: columns[edge.outer].get(row, ZERO) for edge, _ in cluster}
            found[row], passed = self._pass_inward(cluster, forces, {}, -self.rows[row].tau)
            inward = {first.inner: columns[first.inner].get(row, ZERO)}
            self._gather(cluster, passed, inward)
            columns[first.inner][row] = inward[first.inner]
            self.passed.setdefault(row, {}).update(passed)
        D_inverse = self.eliminations[first.outer].D_inverse
        for i, one in found.items():
            share = D_inverse @ one
            for j, other in found.items():
                if j <= i:
                    self.S[i, j] = self.S.get((i, j), 0.0) + share @ other

    def _close(self, body: int, inertias, columns):
        """Inertia of a link with the rows and hubs eliminated whose root it is; their columns end there."""
        rows = [row for row, own in enumerate(self.rows) if own.root == body]
        if not rows:
            return inertias[body]
        hubs = [hub for hub, root in self.hubs.items() if root == body]
        pending = self._pending(rows, hubs, columns)
        F, B = self._front_matrices(body, rows, hubs, pending, inertias, columns)
        factor = LDLT(F)
        G = np.column_stack([factor.forward(column) for column in B.T])
        inverse = np.array([factor.inverse_pivots[i] for i in range(len(F))], dtype=object)
        carried = inverse[:, None] * G
        self.fronts[body] = Front(rows, hubs, pending, factor, G, carried, list(inverse * np.diag(F)))
        return self._corrected(body, inertias, columns, pending, G, carried)

    def _pending(self, rows, hubs, columns) -> list[int]:
        """Rows that act on the chains of some rows or on hubs, and are eliminated further in."""
        own = set(rows)
        closed = own.union(*(front.rows for front in self.fronts.values()))
        touched = {row for hub in hubs for row in columns[hub]}
        return sorted(touched.union(*(pair for pair in self.S if not own.isdisjoint(pair))) - closed)

    def _front_matrices(self, body: int, rows, hubs, pending, inertias, columns) -> tuple[np.ndarray, np.ndarray]:
        """Matrices F and B of a front; the columns of its rows end here."""
        m, n = len(rows), len(rows) + 6 * len(hubs)
        F, B = np.zeros((n, n), dtype=object), np.zeros((n, 6 + len(pending)), dtype=object)
        for i, row in enumerate(rows):
            F[i, :m] = [-self._entry(row, other) for other in rows]
            B[i, :6] = columns[body].pop(row, ZERO)
            B[i, 6:] = [-self._entry(row, other) for other in pending]
        for hub, place in zip(hubs, range(m, n, 6), strict=True):
            block = slice(place, place + 6)
            F[block, block] = whole_inertia(inertias[hub])
            F[block, :m] = np.column_stack([columns[hub].get(row, ZERO) for row in rows])
            F[:m, block] = F[block, :m].T
            B[block, 6:] = np.array([columns[hub].get(row, ZERO) for row in pending], dtype=object).reshape(-1, 6).T
        return F, B

    def _corrected(self, body: int, inertias, columns, pending, G, carried):
        """Inertia of a root, the columns of pending rows there and their S after the elimination of a front."""
        change = np.array([[G[:, min(i, j)] @ carried[:, max(i, j)] for j in range(G.shape[1])] for i in range(G.shape[1])])
        for k, row in enumerate(pending, start=6):
            columns[body][row] = columns[body].get(row, ZERO) - change[:6, k]
            for other, after in zip(pending[: k - 5], range(6, k + 1), strict=True):
                self.S[row, other] = self._entry(row, other) + change[k, after]
        A, B, C = inertias[body]
        moved = blocks(change[:6, :6])
        return A - moved[0], B - moved[1], C - moved[2]

    def _entry(self, i: int, j: int):
        return self.S.get((max(i, j), min(i, j)), 0.0)

    def solve(self, forces, biases, base, tau, rhs):
        """Accelerations by joint and by body, and multipliers (m,), with K a = rhs for accelerations that are added.

        Parameters
        ----------
        forces, biases : dict
            Bias forces (6,) on links, and accelerations (6,) across joints, by body.
        base : ndarray, shape (6,)
            Acceleration of the ground.
        tau : ndarray, shape (n_v,)
            Generalised forces.
        rhs : ndarray, shape (m,)
            Right side of the rows.
        """
        starts = [edge for cluster in self.clusters for edge, _ in cluster if edge.inner == GROUND]
        biases = biases | {edge.outer: self._to_outer(edge, {GROUND: base}, biases) for edge in starts}
        u, reduced = self._reduced(forces, biases, tau, rhs)
        y: dict[int, object] = {}
        accelerations, rates = {GROUND: ZERO}, {}  # that of the ground is in the biases of the joints on it
        self._open(GROUND, accelerations, y, reduced)
        for cluster in self.clusters:
            first = cluster[0][0]
            if first.outer in self.hubs:
                apart = accelerations[first.outer] - self._to_outer(first, accelerations, biases)
                rates[first.constraint] = self.hub_joints[first.outer].dual.T @ apart
            else:
                own = u[first.outer] + sum((force * y[row] for row, force in self.columns[first.outer].items()), 0.0)
                self._carry_outward(cluster, own, biases, rates, accelerations)
            for edge, _ in cluster:
                self._open(edge.outer, accelerations, y, reduced)
        accelerations[GROUND] = base
        return rates, accelerations, np.array([*(y[row] for row in range(self.n_rows)), None], dtype=object)[:-1]

    def _reduced(self, forces, biases, tau, rhs) -> tuple[dict, dict]:
        """Joint forces u by the first body of each cluster, and L⁻¹ r of each front by its root."""
        forces, u, reduced = dict(forces), {}, dict[int, np.ndarray]()
        r = dict(enumerate(rhs))
        for body, cut in self.hub_joints.items():
            r |= zip(cut.rows, cut.T.T @ biases.get(body, ZERO), strict=True)
        for cluster in reversed(self.clusters):
            first = cluster[0][0]
            for edge, _ in cluster:
                self._close_forces(edge.outer, forces, r, reduced)
            if first.outer in self.hubs:
                along = self.hub_joints[first.outer].dual @ tau[self.tree.subsystem.joints[first.constraint].v]
                forces[first.outer] = forces.get(first.outer, ZERO) - along
                self._gather(cluster, {first.outer: along}, forces)
                continue
            u[first.outer], passed = self._pass_inward(cluster, forces, biases, tau)
            self._gather(cluster, passed, forces)
            free = self.eliminations[first.outer].D_inverse @ u[first.outer]
            for row, force in self.columns[first.outer].items():
                carried = sum((self.passed[row][edge.outer] @ biases.get(edge.outer, ZERO) for edge, _ in cluster), 0.0)
                r[row] = r[row] + force @ free - carried
        self._close_forces(GROUND, forces, r, reduced)
        return u, reduced

    def _close_forces(self, body: int, forces, r, reduced):
        """Add what a front passes on to the force on its root, and to the right sides of pending rows."""
        if body not in self.fronts:
            return
        front = self.fronts[body]
        own = [np.array([r[row] for row in front.rows], dtype=object), *(-forces.get(hub, ZERO) for hub in front.hubs)]
        reduced[body] = front.factor.forward(np.concatenate(own))
        change = front.carried.T @ reduced[body]
        forces[body] = forces.get(body, ZERO) + change[:6]
        for row, moved in zip(front.pending, change[6:], strict=True):
            r[row] = r[row] - moved

    def _open(self, body: int, accelerations, y, reduced):
        """Find the multipliers and the accelerations of hubs of a front, once those of its root are known."""
        if body not in self.fronts:
            return
        front = self.fronts[body]
        known = np.concatenate([accelerations[body], np.array([y[row] for row in front.pending], dtype=object)])
        z = front.factor.backward(reduced[body] - front.G @ known)
        y |= zip(front.rows, z, strict=False)
        for hub, place in zip(front.hubs, range(len(front.rows), len(z), 6), strict=True):
            accelerations[hub] = z[place : place + 6]
