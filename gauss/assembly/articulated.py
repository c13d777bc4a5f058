"""Forward dynamics of a tree in its joint coordinates: the articulated-body recursion, over numbers or symbols.

The same elimination as ``gauss.backends.recursion``, with the compulsion written in the moving axes of each link, where
joint axes and most entries of the inertias are constants. Featherstone, Rigid Body Dynamics Algorithms, 2008, sec. 7.3;
spatial vectors are (angular, linear) about the origin of the link frame.

Link frames are those of ``gauss.assembly.links``. An articulated inertia is kept as three
3 × 3 blocks [A, B; Bᵀ, C], so that symmetry and zeros are used.
"""

from typing import NamedTuple

import numpy as np

from gauss.assembly.links import Link, link_frames
from gauss.compulsion.structure import Edge
from gauss.rotations import cross, skew
from gauss.system import PlacedJoint, System
from gauss.tracing import as_number


class Passage(NamedTuple):
    """What the outward pass finds at a link and the inward pass needs."""

    R: np.ndarray  # from the link frame to the joint frame on the inner side
    p: np.ndarray  # origin of the link frame there
    S: np.ndarray  # motion subspace (6, k)
    bias: np.ndarray  # velocity-dependent acceleration across the joint (6,)


class Elimination(NamedTuple):
    """What the inward pass leaves at a link: U = Î S, (Sᵀ Î S)⁻¹, and the inertia that the inner link still feels."""

    U: np.ndarray
    D_inverse: np.ndarray
    projected: tuple | None  # None for a link on the ground


class Articulated:
    """A tree in one state: outward pass and elimination made once, for any number of right-hand sides.

    Parameters
    ----------
    system : System
        The system; joints that close loops are left open here.
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates; floats or expressions.

    Attributes
    ----------
    links : dict
        Constants of each body's link; −1 is the ground.
    velocities : dict
        Velocity (6,) of each link in its frame.
    """

    def __init__(self, system: System, q, v):
        self.system, self.links = system, link_frames(system)
        self.passages, self.velocities = {}, {-1: np.zeros(6)}
        for edge in system.structure.tree:
            joint = system.joints[edge.constraint]
            passage, relative = _pass(joint, edge, self.links[edge.outer].turn, q[joint.q], v[joint.v])
            velocity = _to_outer(self.links[edge.outer], passage, self.velocities[edge.inner]) + relative
            self.passages[edge.outer] = passage._replace(bias=passage.bias + _rotating(velocity, relative))
            self.velocities[edge.outer] = velocity
        self.eliminations = self._eliminate()

    def _eliminate(self) -> dict[int, Elimination]:
        inertias = {body: link.inertia for body, link in self.links.items()}
        found = {}
        for edge in reversed(self.system.structure.tree):
            body, S = edge.outer, self.passages[edge.outer].S
            U = _apply(inertias[body], S)
            D_inverse, projected = invert(S.T @ U), None
            if edge.inner >= 0:
                projected = _project(inertias[body], U, D_inverse, S)
                moved = _inertia_to_inner(self.links[body], self.passages[body], projected)
                inertias[edge.inner] = _sum(inertias[edge.inner], moved)
            found[body] = Elimination(U, D_inverse, projected)
        return found

    def motion(self, effort, pushes=None):
        """Accelerations under gravity, generalised forces (n_v,) and force vectors {body: (6,)} in link frames."""
        forces = {edge.outer: _gyroscopic(self.links[edge.outer], self.velocities[edge.outer]) for edge in self._edges}
        for body, push in (pushes or {}).items():
            forces[body] = forces[body] - push
        base = np.concatenate([np.zeros(3), -np.array(self.system.scene.gravity)])
        return self._solve(forces, {body: passage.bias for body, passage in self.passages.items()}, base, effort)

    def response(self, effort, pushes):
        """Accelerations that forces alone would cause: nothing moves and nothing weighs."""
        forces = {edge.outer: np.zeros(6) for edge in self._edges}
        for body, push in pushes.items():
            forces[body] = -push
        return self._solve(forces, dict.fromkeys(self.passages, np.zeros(6)), np.zeros(6), effort)

    @property
    def _edges(self):
        return self.system.structure.tree

    def _solve(self, forces, biases, base, effort):
        """Joint accelerations by joint, and link accelerations by body."""
        forces, short = dict(forces), {}
        for edge in reversed(self._edges):
            body, passage = edge.outer, self.passages[edge.outer]
            U, D_inverse, projected = self.eliminations[body]
            short[body] = effort[self.system.joints[edge.constraint].v] - passage.S.T @ forces[body]
            if edge.inner >= 0:
                pull = forces[body] + _apply(projected, biases[body]) + U @ (D_inverse @ short[body])
                forces[edge.inner] = forces[edge.inner] + _force_to_inner(self.links[body], passage, pull)
        accelerations, rates = {-1: base}, {}
        for edge in self._edges:
            body, passage = edge.outer, self.passages[edge.outer]
            U, D_inverse, _ = self.eliminations[body]
            carried = _to_outer(self.links[body], passage, accelerations[edge.inner]) + biases[body]
            rates[edge.constraint] = D_inverse @ (short[body] - U.T @ carried)
            accelerations[body] = carried + passage.S @ rates[edge.constraint]
        return rates, accelerations


def _pass(joint: PlacedJoint, edge: Edge, turn: np.ndarray, q, v) -> tuple[Passage, np.ndarray]:
    """Pose, subspace and its own rate across a joint in the outer link frame, and the velocity across it."""
    R, p = joint.pair.pose(q)
    E_omega, E_v = joint.pair.subspace(q)
    bias_omega, bias_v = joint.pair.subspace_bias(q, v)
    if edge.outer == joint.child:
        R = R @ turn
        S = np.concatenate([R.T @ E_omega, R.T @ E_v])
        relative = S @ v
        drift = np.concatenate([R.T @ bias_omega, R.T @ bias_v - cross(relative[:3], relative[3:])])
        return Passage(R, p, S, drift), relative
    lever = skew(p)
    S = -np.concatenate([turn.T @ E_omega, turn.T @ (E_v + lever @ E_omega)])
    relative = S @ v
    drift = -np.concatenate([turn.T @ bias_omega, turn.T @ (bias_v + cross(E_v @ v, E_omega @ v) + lever @ bias_omega)])
    return Passage(R.T @ turn, -R.T @ p, S, drift), relative


def _to_outer(link: Link, passage: Passage, motion: np.ndarray) -> np.ndarray:
    """Motion vector of the inner link in the outer link frame."""
    omega, linear = motion[:3], motion[3:]
    linear = link.R.T @ (linear + cross(omega, link.p))
    omega = link.R.T @ omega
    linear = passage.R.T @ (linear + cross(omega, passage.p))
    return np.concatenate([passage.R.T @ omega, linear])


def _force_to_inner(link: Link, passage: Passage, force: np.ndarray) -> np.ndarray:
    """Force vector of the outer link in the inner link frame."""
    for R, p in ((passage.R, passage.p), (link.R, link.p)):
        linear = R @ force[3:]
        force = np.concatenate([R @ force[:3] + cross(p, linear), linear])
    return force


def _inertia_to_inner(link: Link, passage: Passage, inertia):
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


def _gyroscopic(link: Link, velocity: np.ndarray) -> np.ndarray:
    """Force vector v ×* I v of a rigid link."""
    omega, linear = velocity[:3], velocity[3:]
    angular_momentum = link.inertia[0] @ omega + cross(link.first, linear)
    momentum = link.mass * linear - cross(link.first, omega)
    return np.concatenate([cross(omega, angular_momentum) + cross(linear, momentum), cross(omega, momentum)])


def _rotating(velocity: np.ndarray, relative: np.ndarray) -> np.ndarray:
    """Motion vector v × s: what a velocity across the joint gains in the moving frame."""
    omega, linear = velocity[:3], velocity[3:]
    return np.concatenate([cross(omega, relative[:3]), cross(omega, relative[3:]) + cross(linear, relative[:3])])


def _apply(inertia, motion: np.ndarray) -> np.ndarray:
    A, B, C = inertia
    return np.concatenate([A @ motion[:3] + B @ motion[3:], B.T @ motion[:3] + C @ motion[3:]])


def _sum(one, two):
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
