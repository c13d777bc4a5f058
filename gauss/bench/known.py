"""Known solution of a programme, and errors of an answer: of x, and of the multipliers that the rows determine."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from gauss.backends.dual_certificate import LEAST_SHARE

DEPENDENT = 1e-10  # relative singular value: scaled rows dependent but for their rounding are below 1e-11, others above 1e-7
AT_REST = 1e-12  # of what has the same energy: smaller ones are zero but for the rounding of the reference
DENSE = 1500  # rows that hold, up to which the directions that they determine are found by a dense factorisation


@dataclass(frozen=True, eq=False)
class KnownSolution:
    """Solution of a programme, and what errors of it are compared with, in whatever units it is written."""

    x: np.ndarray  # (n,) solution
    scale: np.ndarray  # (n,) what errors of x are compared with, see :func:`scales`
    multipliers: np.ndarray | None  # multipliers of the equality and of the inequality rows; None if they are not known
    # (m + s,) size of the terms of each row, by which multipliers of all units compare: their product is the work of the row
    work: np.ndarray
    load: float  # largest work of an entry of the linear term
    held: np.ndarray  # rows that hold with equality
    # orthonormal directions of the works of the rows that hold which these rows determine; None if all are determined
    basis: np.ndarray | None

    def error(self, x) -> float:
        """Largest relative error of an answer x; nan if it is not finite."""
        if x is None or not np.isfinite(x).all():
            return np.nan
        return float((np.abs(x - self.x) / self.scale).max(initial=0.0))

    def dual_error(self, multipliers) -> float:
        """Largest relative error of multipliers (m + s,), row by row, without the directions that redundant rows leave open.

        A multiplier is compared with its own size; a small one with a share of the largest, or of the loads.
        """
        if self.multipliers is None or not np.isfinite(multipliers).all():
            return np.nan
        right = self._determined(self.work * self.multipliers)
        off = self._determined(self.work * (multipliers - self.multipliers))
        size = np.abs(right)
        size = np.maximum(size, LEAST_SHARE * max(size.max(initial=0.0), self.load))
        return float(np.divide(np.abs(off), size, out=np.where(off != 0.0, np.inf, 0.0), where=size > 0.0).max(initial=0.0))

    def _determined(self, works: np.ndarray) -> np.ndarray:
        if self.basis is None:
            return works
        found = works.copy()
        found[self.held] = self.basis @ (self.basis.T @ works[self.held])
        return found


def known(programme, x, units=None, multipliers=None, held=None, unique: bool = True) -> KnownSolution:
    """Known solution of a programme with matrices P, q, A, b, G, h.

    Parameters
    ----------
    programme : Matrices
        The programme.
    x : ndarray, shape (n,)
        Its solution.
    units : sequence of str, optional
        Units of the unknowns; one for all when not given.
    multipliers : ndarray, shape (m + s,), optional
        Multipliers of its rows.
    held : ndarray of int, optional
        Rows that hold; needed if the multipliers are not unique.
    unique : bool
        Whether the multipliers are. Where they are not and rows are too many to tell what they determine, they do not count
        as known.
    """
    x = np.asarray(x, dtype=float)
    size = scales(programme, x, np.asarray(["1"] * x.size if units is None else units))
    rows = sparse.csr_array(sparse.vstack([programme.A, programme.G]))
    work = abs(rows) @ size + np.abs(np.concatenate([programme.b, programme.h]))
    load = float((np.abs(programme.q) * size).max(initial=0.0))
    held = np.arange(work.size) if held is None else np.asarray(held)
    basis = None
    if not unique and multipliers is not None:
        basis = _range(rows[held], size, work[held]) if held.size <= DENSE else None
        multipliers = None if basis is None else multipliers
    return KnownSolution(x, size, multipliers, work, load, held, basis)


def scales(programme, x: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Scales of the errors of unknowns (n,): the largest of the same unit, or the median of these without rows.

    The median, for what rows keep from next to no mass says nothing of the others. Units whose unknowns all rest, with and
    without rows, are compared with what has the energy ½ P_jj x_j² of the largest of all.
    """
    weight = programme.P.diagonal()
    free = np.abs(np.divide(programme.q, weight, out=np.zeros(x.size), where=weight > 0.0))
    found = np.empty(x.size)
    for unit in np.unique(units):
        mine = units == unit
        moved = free[mine & (free > 0.0)]
        found[mine] = max(np.abs(x[mine]).max(), float(np.median(moved)) if moved.size else 0.0)
    energy = (weight * found**2).max(initial=0.0)
    rest = np.divide(np.sqrt(energy), np.sqrt(weight), out=np.ones(x.size), where=weight > 0.0)
    for unit in np.unique(units):
        mine = units == unit
        if (found[mine] <= AT_REST * rest[mine]).all():
            found[mine] = rest[mine]
    return np.where(found > 0.0, found, 1.0)


def _range(rows, size: np.ndarray, work: np.ndarray) -> np.ndarray:
    """Orthonormal directions (h, r) of the range of rows, each divided by the size of its terms."""
    scaled = rows.toarray() * size / np.where(work > 0.0, work, 1.0)[:, None]
    U, s, _ = linalg.svd(scaled, full_matrices=False)
    return U[:, s > DEPENDENT * s.max(initial=0.0)]
