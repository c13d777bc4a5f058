"""Articulated inertias: the elimination of a tree, leaf by leaf, in its joint coordinates, over numbers or symbols.

The same elimination as ``gauss.backends.recursion``, with the compulsion written in the moving axes of each link
(Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 7.3). An articulated inertia is kept as three 3 × 3 blocks
[A, B; Bᵀ, C], so that symmetry and zeros are used.
"""

from typing import NamedTuple

import numpy as np

from gauss.assembly.links import Link
from gauss.assembly.tree import Passage, Tree, apply, force_to_inner, gyroscopic, to_outer
from gauss.rotations import skew
from gauss.tracing import as_number

NOTHING = np.zeros(6)


class Elimination(NamedTuple):
    """What the inward pass leaves at a link: U = Î S, (Sᵀ Î S)⁻¹, and the inertia that the inner link still feels."""

    U: np.ndarray
    D_inverse: np.ndarray
    projected: tuple


class Articulated:
    """A tree in one state, eliminated once for any number of right-hand sides.

    Parameters
    ----------
    tree : Tree
        The tree.
    """

    def __init__(self, tree: Tree):
        self.tree = tree
        self.eliminations = self._eliminate()

    def _eliminate(self) -> dict[int, Elimination]:
        tree = self.tree
        inertias = {body: link.inertia for body, link in tree.links.items()}
        found = {}
        for edge in reversed(tree.edges):
            body = edge.outer
            found[body] = eliminate(tree.passages[body], inertias[body])
            if edge.inner >= 0:
                moved = inertia_to_inner(tree.links[body], tree.passages[body], found[body].projected)
                inertias[edge.inner] = add(inertias[edge.inner], moved)
        return found

    def motion(self, effort, pushes=None):
        """Accelerations under weight, generalised forces (n_v,) and force vectors {body: (6,)} in link frames."""
        tree = self.tree
        forces = {body: gyroscopic(tree.links[body], tree.omegas[body]) for body in tree.passages}
        for body, push in (pushes or {}).items():
            forces[body] = forces[body] - push
        return self._solve(forces, {body: passage.bias for body, passage in tree.passages.items()}, tree.ground, effort)

    def response(self, effort, pushes=None):
        """Accelerations that forces alone would cause, where they cause any: nothing moves and nothing weighs."""
        return self._solve({body: -push for body, push in (pushes or {}).items()}, {}, None, effort)

    def _solve(self, forces, biases, base, effort):
        """Joint accelerations by joint, and link accelerations by body; what is missing, given or found, is zero."""
        tree, joints, short = self.tree, self.tree.system.joints, {}
        forces = dict(forces)
        for edge in reversed(tree.edges):
            body, passage, driven = edge.outer, tree.passages[edge.outer], effort[joints[edge.constraint].v]
            if body not in forces and body not in biases and _is_nothing(driven):
                continue
            short[body], pull = pull_inward(
                passage, self.eliminations[body], forces.get(body, NOTHING), biases.get(body, NOTHING), driven
            )
            if edge.inner >= 0:
                forces[edge.inner] = forces.get(edge.inner, NOTHING) + force_to_inner(tree.links[body], passage, pull)
        accelerations, rates = {} if base is None else {-1: base}, {}
        for edge in tree.edges:
            body, passage = edge.outer, tree.passages[edge.outer]
            if edge.inner not in accelerations and body not in biases and body not in short:
                continue
            carried = to_outer(tree.links[body], passage, accelerations.get(edge.inner, NOTHING)) + biases.get(body, NOTHING)
            rates[edge.constraint], accelerations[body] = carry_outward(
                passage, self.eliminations[body], short.get(body, np.zeros(1)), carried
            )
        return rates, accelerations


def eliminate(passage: Passage, inertia) -> Elimination:
    """Eliminate the joint of a link with articulated inertia Î."""
    U = apply(inertia, passage.S)
    D_inverse = invert(passage.S.T @ U)
    return Elimination(U, D_inverse, _project(inertia, U, D_inverse, passage.S))


def pull_inward(passage: Passage, elimination: Elimination, force, bias, driven):
    """What the drive of a joint falls short of, and the force vector that remains for the inner link."""
    short = driven - passage.S.T @ force
    return short, force + apply(elimination.projected, bias) + elimination.U @ (elimination.D_inverse @ short)


def carry_outward(passage: Passage, elimination: Elimination, short, carried):
    """Joint accelerations, and the acceleration of the link."""
    rates = elimination.D_inverse @ (short - elimination.U.T @ carried)
    return rates, carried + passage.S @ rates


def _is_nothing(part: np.ndarray) -> bool:
    return not any(as_number(entry) != 0 for entry in part)


def inertia_to_inner(link: Link, passage: Passage, inertia):
    """Inertia of the outer link in the inner link frame."""
    for R, p in ((passage.R, passage.p), (link.R, link.p)):
        A, B, C = (R @ block @ R.T for block in inertia)
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
    full = _symmetric(full)
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
