"""Factorisation of S + μ 1, S = K M⁻¹ Kᵀ, as recorded calls: the loops of a root are eliminated there as one front.

The unit forces of rows i, carried inward from the links on which they act, are û_i on the joints that they cross and H_i on
their root, the innermost link of the loop. With the root given its acceleration a, and rows p that cross the same joints but
are eliminated further in,

    (S_rr + μ) y_r + H_rᵀ a + S_rp y_p = r,    S = Σ_joints û_iᵀ D⁻¹ û_j,

so the multipliers y_r leave the root an articulated inertia larger by H_r (S_rr + μ)⁻¹ H_rᵀ (constraint embedding: Jain,
Robot and Multibody Dynamics, 2011, sec. 10). Where all roots are the ground, this is the factorisation of S itself.
"""

from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gauss.backends.structure import GROUND
from gauss.codegen.kernels import BlockLDLT, Operand
from gauss.dynamics.aba import ZERO
from gauss.dynamics.link_kernels import acceleration, add_to_inertia, eliminate_link, force, row_inward

if TYPE_CHECKING:
    from gauss.dynamics.call_graph import CallGraph


class RowFront(NamedTuple):
    """Rows that are eliminated at one root."""

    factor: BlockLDLT  # factorisation of S_rr + μ
    H: dict  # wrenches (6, m) on the root, by block of rows
    across: dict  # (S_rr + μ)⁻¹ H_rᵀ, by block of rows; empty for the ground
    # coupled, pending: S_rp and (S_rr + μ)⁻¹ S_rp, by block of rows p that are eliminated further in
    coupled: dict[int, dict]
    pending: dict[int, dict]
    S: dict  # blocks of S_rr


class LoopFronts:
    """Factorisation of S + μ 1 of a subsystem.

    ``graph``: the subsystem; its kinematics and the elimination of its tree are recorded. ``roots``: root of each block of
    rows, :data:`GROUND` or a link.
    """

    def __init__(self, graph: "CallGraph", mu: float, roots: dict[int, int]):
        self.graph, self.recorder, self.mu, self.roots = graph, graph.recorder, mu, roots
        self.place = {block: place for place, block in enumerate(roots)}
        self.S: dict[tuple[int, int], Operand] = {}
        self.joint_forces: dict[int, dict[int, Operand]] = {}  # û of each block of rows, by the outer link of the joint
        self.summed = set[int]()  # links at whose joints they are in S
        self.fronts: dict[int, RowFront] = {}
        self.eliminated = dict(graph.eliminated)
        self.enlarged = {body for root in set(roots.values()) for body in graph.path(root)[:-1]}  # with a root at or beyond
        self._eliminate()

    def damped(self, mu: float) -> "LoopFronts":
        """Record the factorisation with another μ, which articulated inertias depend on beyond the ground."""
        if self.enlarged:
            return LoopFronts(self.graph, mu, self.roots)
        found = copy(self)
        found.fronts = {
            root: front._replace(factor=BlockLDLT(self.recorder, front.S, mu)) for root, front in self.fronts.items()
        }
        return found

    def _eliminate(self):
        graph = self.graph
        H: dict[int, dict[int, Operand]] = {body: {} for body in (GROUND, *graph.order)}
        along = {}
        for block, wrenches, forces in graph.unit_forces():
            along[block] = forces
            for body, wrench in wrenches.items():
                if body != GROUND and wrench.shape[1]:
                    H[body][block] = wrench
        collected = graph.collected | {body: np.zeros(21) for body in self.enlarged}
        for edge in reversed(graph.edges):
            body, inner = edge.outer, edge.inner
            self._close(body, H[body], collected)
            if body in self.enlarged or inner in self.enlarged:
                more = collected[inner] if inner != GROUND else np.zeros(21)
                *found, moved = graph.inward(
                    "eliminate", body, eliminate_link, *graph.kinematics[body], collected[body], more
                )
                self.eliminated[body] = found
                if inner != GROUND:
                    collected[inner] = moved
            self._carry_rows(body, H, along)
        self._close(GROUND, {}, collected)

    def _carry_rows(self, body: int, H: dict, along: dict):
        """Carry the unit forces of rows across the joint of a link."""
        graph, inner, freedoms = self.graph, self.graph.inner[body], self.graph.joint[body].pair.n_v
        across = (*graph.kinematics[body], *self.eliminated[body][:2])
        self.joint_forces[body] = {}
        for block in sorted(H[body], key=self.place.__getitem__):
            wrench = H[body].pop(block)
            own = along[block].get(body, np.zeros((freedoms, wrench.shape[1])))
            u, onward = graph.inward("carry row", body, row_inward, *across, wrench, own)
            self.joint_forces[body][block] = u
            if inner != GROUND:
                H[inner][block] = graph.sum(H[inner][block], onward) if block in H[inner] else onward

    def _close(self, root: int, H: dict, collected: dict):
        """Eliminate the rows of a root."""
        rows = {block for block, own in self.roots.items() if own == root}
        if rows:
            self._eliminate_rows(root, rows, H, collected)

    def _eliminate_rows(self, root: int, rows: set[int], H: dict, collected: dict):
        self._sum_blocks(root)
        S_rr = {pair: block for pair, block in self.S.items() if rows.issuperset(pair)}
        factor = BlockLDLT(self.recorder, S_rr, self.mu)
        coupled = {p: {i: self._entry(i, p) for i in factor.inverse} for p in self._pending(rows)}
        pending = {p: factor.solve(blocks) for p, blocks in coupled.items()}
        carried = {i: H.pop(i) for i in factor.inverse if i in H}  # none on the ground
        across = self._enlarge(root, factor, carried, collected)
        self._correct(coupled, pending, carried, H)
        self.S = {pair: block for pair, block in self.S.items() if rows.isdisjoint(pair)}
        self.fronts[root] = RowFront(factor, carried, across, coupled, pending, S_rr)

    def _enlarge(self, root: int, factor: BlockLDLT, H: dict, collected: dict) -> dict:
        """Add H_r (S_rr + μ)⁻¹ H_rᵀ to the articulated inertia of a root; its second factor by block."""
        if not H:
            return {}
        across = factor.solve({i: self._call("transposed", lambda A: A.T, own) for i, own in H.items()})
        for i, own in H.items():
            collected[root] = self._call("front inertia", add_to_inertia, collected[root], own, across[i])
        return across

    def _pending(self, rows: set[int]) -> list[int]:
        """Rows that cross the same joints as some and are eliminated further in."""
        touched = {row for pair in self.S if not rows.isdisjoint(pair) for row in pair}
        return sorted(touched - rows, key=self.place.__getitem__)

    def _correct(self, coupled: dict, pending: dict, carried: dict, H: dict):
        """Subtract H_r (S_rr + μ)⁻¹ S_rp from the wrenches of pending rows, and S_pr (S_rr + μ)⁻¹ S_rp from their blocks."""
        for p, found in pending.items():
            for i, own in carried.items():
                H[p] = self._call("less product", _less, H[p], own, found[i])
        for place, p in enumerate(coupled):
            for q in list(coupled)[: place + 1]:
                one, other = self._pair(p, q)
                for i, own in coupled[one].items():
                    known = self._entry(one, other)
                    self.S[one, other] = self._call("less transposed", _less_transposed, known, own, pending[other][i])

    def _sum_blocks(self, root: int):
        """Add the blocks ûᵀ D⁻¹ ŵ over the joints beyond a root that two loops share."""
        for body in self.graph.order:
            beyond = root == GROUND or root in self.graph.path(self.graph.inner[body])
            if not beyond or body in self.summed:
                continue
            self.summed.add(body)
            D_inverse, shares = self.eliminated[body][1], list(self.joint_forces[body].items())
            for i, (one, u) in enumerate(shares):
                for other, w in shares[: i + 1]:
                    pair, (first, second) = self._pair(one, other), (u, w) if one >= other else (w, u)
                    known = self.S[pair] if pair in self.S else np.zeros((first.shape[1], second.shape[1]))
                    self.S[pair] = self._call("gram", _gram, known, first, D_inverse, second)

    @staticmethod
    def _pair(one: int, other: int) -> tuple[int, int]:
        return max(one, other), min(one, other)

    def _entry(self, i: int, j: int):
        """Block S_ij, zero where the rows share no joint."""
        if self._pair(i, j) not in self.S:
            sizes = self.graph.scale
            return np.zeros((sizes[i].shape[0], sizes[j].shape[0]))
        block = self.S[self._pair(i, j)]
        return block if i >= j else self._call("transposed", lambda A: A.T, block)

    def _call(self, name, function, *arguments) -> Operand:
        return self.recorder.call(name, lambda *given: (function(*given),), *arguments)[0]

    def solve(self, parts: dict) -> dict:
        """Record the solution of a right-hand side; both are dicts by block of rows."""
        reduced: dict[int, dict] = {}  # solutions of fronts with roots at rest
        u = self._reduce(dict(parts), reduced)
        y: dict[int, Operand] = {}
        accelerations = {GROUND: ZERO}
        self._open(GROUND, accelerations, reduced, y)
        for edge in self.graph.edges:
            body = edge.outer
            if body in self.enlarged:
                pushed = u[body]
                for block, own in self.joint_forces[body].items():
                    pushed = self._call("plus product", lambda x, A, y: x + A @ y, pushed, own, y[block])
                given = (
                    *self.graph.kinematics[body],
                    *self.eliminated[body][:2],
                    pushed,
                    ZERO,
                    accelerations[edge.inner],
                )
                _, accelerations[body] = self.graph.at_link("carry", body, acceleration, *given)
                self._open(body, accelerations, reduced, y)
        return y

    def _reduce(self, parts: dict, reduced: dict[int, dict]) -> dict[int, Operand]:
        """Solutions of fronts with roots at rest, from the outermost on; forces along joints that they cause."""
        graph, u = self.graph, dict[int, Operand]()
        forces: dict[int, Operand] = {}  # bias forces on links
        for edge in reversed(graph.edges):
            body, inner = edge.outer, edge.inner
            self._solve_front(body, parts, forces, reduced)
            if body not in forces:
                continue
            across, none = (*graph.kinematics[body], *self.eliminated[body]), np.zeros(graph.joint[body].pair.n_v)
            given = (*across, forces[body], ZERO, none, forces.get(inner, ZERO))
            u[body], onward = graph.inward("pull", body, force, *given)
            if inner != GROUND:
                forces[inner] = onward
            D_inverse = self.eliminated[body][1]
            for block, own in self.joint_forces[body].items():
                parts[block] = self._call("less share", _less_share, parts[block], own, D_inverse, u[body])
        self._solve_front(GROUND, parts, forces, reduced)
        return u

    def _solve_front(self, root: int, parts: dict, forces: dict, reduced: dict):
        if root not in self.fronts:
            return
        front = self.fronts[root]
        reduced[root] = z = front.factor.solve({i: parts.pop(i) for i in front.factor.inverse})
        for i, own in front.H.items():
            forces[root] = self._call("less product", _less, forces.get(root, ZERO), own, z[i])
        for p in front.pending:
            for i, own in front.coupled[p].items():
                parts[p] = self._call("less transposed", _less_transposed, parts[p], own, z[i])

    def _open(self, root: int, accelerations: dict, reduced: dict, y: dict):
        """Multipliers of a front, once the acceleration of its root is known."""
        if root not in self.fronts:
            return
        front = self.fronts[root]
        for i, found in reduced[root].items():
            if front.across:
                found = self._call("less product", _less, found, front.across[i], accelerations[root])
            for p, own in front.pending.items():
                found = self._call("less product", _less, found, own[i], y[p])
            y[i] = found


def _gram(known, one, D_inverse, other):
    return known + one.T @ D_inverse @ other


def _less(known, A, B):
    return known - A @ B


def _less_transposed(known, A, B):
    return known - A.T @ B


def _less_share(known, own, D_inverse, u):
    return known - own.T @ (D_inverse @ u)
