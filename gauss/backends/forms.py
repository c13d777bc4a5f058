"""The forms F2 and F2s of the compulsion: quasi-accelerations alone, then scaled.

    F2:   ½ (a − x_free)ᵀ Φ (a − x_free) → min,   C a = d,   K a ≤ k
    F2s:  ½ |x − x_free|² → min,   C x = d,   K x ≤ k,   x = Φ^½ a

The Hessian of the full form F1 is singular in q̈. F2 eliminates q̈ exactly: the rows of a joint are projected on the
complement of its motion subspace, and its drive becomes a moment and a force on the two bodies. F2s scales F2 by
x = Φ^½ a and normalises the rows: the Hessian is the identity (Gauss's principle in the form of Udwadia and Kalaba,
Analytical Dynamics, 1996, ch. 3). F1, and F3 in q̈ alone, are in :mod:`gauss.backends.programme`.
"""

from dataclasses import dataclass, replace

import numpy as np

from gauss.backends.columns import Columns, from_blocks
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Answer
from gauss.errors import BackendError

POINT_GYRATION = 1e-2  # radius of gyration of a point mass, relative to the length of the scene: rows keep it from turning
UNDETERMINED_RATE = 1e-12  # relative pivot of B below which rows leave a joint acceleration undetermined
ROUNDED_STEP = 1e-15  # change of x relative to x at which iterations on F2s have reached round-off


@dataclass(frozen=True)
class Cluster:
    """Constraints that share columns of B, with the orthogonal split B = Q_range R of their rows."""

    constraints: tuple[int, ...]
    columns: np.ndarray
    Q_range: np.ndarray
    Q_rest: np.ndarray
    R_inverse: np.ndarray


@dataclass(frozen=True)
class Eliminated:
    """F2 or F2s: ½ (x − x_free)ᵀ W (x − x_free) → min subject to C x = d, K x ≤ k, with x = root · a.

    Parameters
    ----------
    compulsion : Compulsion
        The full form.
    clusters : tuple of Cluster
        Elimination of q̈, cluster by cluster.
    weights : ndarray, shape (6n,)
        Diagonal of W: Φ in F2, ones in F2s.
    C : Columns, shape (m, 6n)
        Equality rows, of unit length in F2s, with the pattern of their blocks.
    d, x_free : ndarray
        Right-hand side (m,) and free solution (6n,).
    K, k : ndarray
        Inequality rows (s, 6n), (s,).
    root : ndarray, shape (6n,)
        Ones in F2, Φ^½ in F2s.
    lengths : ndarray, shape (m,)
        Lengths of the rows before they were normalised; ones in F2.
    """

    compulsion: Compulsion
    clusters: tuple[Cluster, ...]
    weights: np.ndarray
    C: Columns
    d: np.ndarray
    x_free: np.ndarray
    K: np.ndarray
    k: np.ndarray
    root: np.ndarray
    lengths: np.ndarray

    def answer(self, x, y, z=None, **outcome) -> Answer:
        """Accelerations and multipliers of the full form from x, multipliers y of C x = d and z of K x ≤ k."""
        compulsion = self.compulsion
        z = np.zeros(compulsion.h.size) if z is None else z
        a = x / self.root
        qdd = np.zeros(compulsion.structure.n_columns)
        multipliers = np.zeros(compulsion.structure.n_rows)
        drive = compulsion.P - compulsion.G[:, a.size :].T @ z
        y, start = y / self.lengths, 0
        for cluster in self.clusters:
            rest = compulsion.D[_rows(compulsion, cluster)] - _apply(compulsion, cluster, a)
            qdd[cluster.columns] = cluster.R_inverse @ (cluster.Q_range.T @ rest)
            own = y[start : start + cluster.Q_rest.shape[1]]
            start += own.size
            held = cluster.Q_rest @ own + cluster.Q_range @ (cluster.R_inverse.T @ drive[cluster.columns])
            multipliers[_rows(compulsion, cluster)] = held
        return Answer(a, qdd, multipliers, z, **outcome)


def eliminated(compulsion: Compulsion) -> Eliminated:
    """F2 of a compulsion, in its own units.

    BackendError if a body has no mass (its acceleration has no weight), or the rows leave a q̈ free.
    """
    structure = compulsion.structure
    Phi = _filled(compulsion)
    clusters = tuple(_split(compulsion, *cluster) for cluster in structure.clusters)
    entries, targets, force, start = [], [np.zeros(0)], compulsion.impressed.copy(), 0
    q0, K = np.zeros(structure.n_columns), compulsion.G[:, : Phi.size].copy()
    for cluster in clusters:
        rows = _rows(compulsion, cluster)
        targets.append(cluster.Q_rest.T @ compulsion.D[rows])
        q0[cluster.columns] = cluster.R_inverse @ (cluster.Q_range.T @ compulsion.D[rows])
        held = cluster.Q_range @ (cluster.R_inverse.T @ compulsion.P[cluster.columns])
        G_q = compulsion.G[:, Phi.size + cluster.columns] @ cluster.R_inverse @ cluster.Q_range.T
        at = 0
        for i in cluster.constraints:
            size = compulsion.D[structure.constraints[i].rows].size
            for body, block in zip(structure.constraints[i].bodies, compulsion.A_blocks[i], strict=True):
                columns = slice(6 * body, 6 * body + 6)
                entries.append((cluster.Q_rest[at : at + size].T @ block, start, columns.start))
                force[columns] -= block.T @ held[at : at + size]
                K[:, columns] -= G_q[:, at : at + size] @ block
            at += size
        start += cluster.Q_rest.shape[1]
    C = from_blocks(entries, (start, Phi.size))
    k = compulsion.h - compulsion.G[:, Phi.size :] @ q0
    d = np.concatenate(targets)
    return Eliminated(compulsion, clusters, Phi, C, d, force / Phi, K, k, np.ones(Phi.size), np.ones(start))


def scaled(compulsion: Compulsion) -> Eliminated:
    """F2s of a compulsion: F2 in x = Φ^½ a, with rows of unit length.

    BackendError as :func:`eliminated`.
    """
    form = eliminated(compulsion)
    root = np.sqrt(form.weights)
    C = form.C
    entries = C.data / np.repeat(root, np.diff(C.indptr))
    lengths = np.sqrt(np.bincount(C.indices, entries**2, minlength=C.shape[0]))
    lengths[lengths == 0] = 1.0
    C = replace(C, data=entries / lengths[C.indices])
    return replace(
        form,
        weights=np.ones(root.size),
        C=C,
        d=form.d / lengths,
        x_free=root * form.x_free,
        K=form.K / root,
        root=root,
        lengths=lengths,
    )


def massless(compulsion: Compulsion) -> list[str]:
    """Names of the bodies without mass: their accelerations have no weight, and F2 does not determine them."""
    return [compulsion.structure.bodies[i] for i in np.flatnonzero(compulsion.Phi[3::6] <= 0)]


def _filled(compulsion: Compulsion) -> np.ndarray:
    """Φ with a moment of inertia where a body has none: exact as long as rows keep the body from turning about that axis.

    A link of a planar mechanism is such a body; the certificate of the answer finds any other.
    """
    parts = compulsion.Phi.reshape(-1, 6)
    if without := massless(compulsion):
        remedy = "form 'F3' of a QP solver" + ("" if compulsion.h.size else ", or backend 'recursion' or 'kkt'")
        raise BackendError(f"bodies without mass ({', '.join(without)}) have no form F2; use {remedy}.")
    moments = parts[:, :3]
    largest = moments.max(axis=1, keepdims=True)
    fill = np.where(largest > 0, largest, parts[:, 3:4] * (POINT_GYRATION * compulsion.units[3]) ** 2)
    return np.concatenate([np.where(moments > 0, moments, fill), parts[:, 3:]], axis=1).ravel()


def _split(compulsion: Compulsion, constraints, columns) -> Cluster:
    structure = compulsion.structure
    index = np.concatenate([np.arange(c.start, c.stop) for c in columns]) if columns else np.zeros(0, int)
    place = {column: i for i, column in enumerate(index)}
    blocks = []
    for i in constraints:
        constraint = structure.constraints[i]
        block = np.zeros((constraint.rows.stop - constraint.rows.start, index.size))
        for c, part in zip(constraint.columns, compulsion.B_blocks[i], strict=True):
            if c.stop > c.start:
                block[:, place[c.start] : place[c.start] + part.shape[1]] = part
        blocks.append(block)
    Q, R = np.linalg.qr(np.concatenate(blocks), mode="complete")
    size = index.size
    diagonal = np.abs(np.diag(R))
    if size and diagonal.min() <= UNDETERMINED_RATE * diagonal.max():
        names = [structure.coordinates[j] for j in index]
        raise BackendError(f"the rows of {', '.join(names)} leave one of these accelerations undetermined.")
    return Cluster(tuple(constraints), index, Q[:, :size], Q[:, size:], np.linalg.inv(R[:size]))


def _rows(compulsion: Compulsion, cluster: Cluster) -> np.ndarray:
    rows = [compulsion.structure.constraints[i].rows for i in cluster.constraints]
    return np.concatenate([np.arange(r.start, r.stop) for r in rows])


def _apply(compulsion: Compulsion, cluster: Cluster, a: np.ndarray) -> np.ndarray:
    parts = []
    for i in cluster.constraints:
        constraint = compulsion.structure.constraints[i]
        product = np.zeros(constraint.rows.stop - constraint.rows.start)
        for body, block in zip(constraint.bodies, compulsion.A_blocks[i], strict=True):
            product += block @ a[6 * body : 6 * body + 6]
        parts.append(product)
    return np.concatenate(parts)
