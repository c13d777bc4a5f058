"""Index maps from the entries of a programme to the arrays of a solver: found once for a sparsity pattern.

Stacking and cutting sparse matrices takes longer than solving them; copying their entries does not. The pattern of a form is
that of its blocks, and most entries of a block are zero in every state: solvers get those only that were once nonzero.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse

from gauss.backends.programme import Programme


class SparsityLayout:
    """Index maps of a programme to the upper triangle of H and the stacked rows [C; K].

    Parameters
    ----------
    programme : Programme
        Any with the pattern in question.
    before : SparsityLayout, optional
        One that no longer fits: its entries are taken over if the pattern is the same.

    Attributes
    ----------
    upper : csc_matrix, shape (n, n)
        Upper triangle of H.
    rows : csc_matrix, shape (m + s, n)
        C above K, without entries that are zero.
    """

    def __init__(self, programme: Programme, before: "SparsityLayout | None" = None):
        self._pattern = _pattern(programme)
        self.upper, self._upper_order = _upper(programme.H)
        self._used = _entries(programme) != 0
        if before is not None and before._has_pattern_of(programme):
            self._used |= before._used
        used_C, used_K = np.split(self._used, [programme.C.nnz])
        self._C, self._K = _Thinned.of(programme.C, used_C), _Thinned.of(programme.K, used_K)
        self.rows, self._rows_order = _stacked(self._C, self._K, programme)

    def hessian(self, programme: Programme) -> np.ndarray:
        """Entries of the upper triangle of H."""
        return programme.H.data[self._upper_order]

    def row_entries(self, programme: Programme) -> np.ndarray | None:
        """Entries of the stacked rows; None if the pattern differs, or an entry is missing."""
        if not self._has_pattern_of(programme):
            return None
        entries = _entries(programme)
        found = entries[self._rows_order]
        return found if np.count_nonzero(found) == np.count_nonzero(entries) else None

    @property
    def own_matrices(self) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
        """C and K of the programme that this layout was made of, without entries that are zero."""
        return self._C.matrix, self._K.matrix

    def matrices(self, programme: Programme) -> tuple[sparse.csc_matrix, sparse.csc_matrix] | None:
        """C and K without entries that are zero, the same objects in every call; None as for :meth:`row_entries`."""
        if not self._has_pattern_of(programme):
            return None
        pairs = (self._C, programme.C), (self._K, programme.K)
        fit = [mine.fill(theirs) for mine, theirs in pairs]
        return self.own_matrices if all(fit) else None

    def _has_pattern_of(self, programme: Programme) -> bool:
        return all(map(_alike, self._pattern, _pattern(programme)))


class _Thinned(NamedTuple):
    """Matrix of some of the entries of another, and their indices among those."""

    matrix: sparse.csc_matrix
    order: np.ndarray

    @classmethod
    def of(cls, matrix: sparse.csc_matrix, used: np.ndarray) -> "_Thinned":
        """Thinned matrix of the entries that are used."""
        starts = np.concatenate([[0], np.cumsum(used)])[matrix.indptr].astype(matrix.indptr.dtype)
        order = np.flatnonzero(used)
        return cls(sparse.csc_matrix((matrix.data[order], matrix.indices[order], starts), matrix.shape), order)

    def fill(self, whole: sparse.csc_matrix) -> bool:
        """Take the entries of another matrix of the same pattern; false if it has more of them."""
        self.matrix.data = whole.data[self.order]
        return bool(np.count_nonzero(self.matrix.data) == np.count_nonzero(whole.data))


def _entries(programme: Programme) -> np.ndarray:
    """Entries of C, then of K."""
    return np.concatenate([programme.C.data, programme.K.data]) if programme.k.size else programme.C.data


def _pattern(programme: Programme) -> list[np.ndarray]:
    """Index arrays of all entries."""
    matrices = (programme.H, programme.C, programme.K) if programme.k.size else (programme.H, programme.C)
    return [part for matrix in matrices for part in (matrix.indptr, matrix.indices)]


def _alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether index arrays are equal; those of one memory are not compared."""
    whole = one.base
    if whole is not None and whole is other.base and one.size == other.size == whole.size:
        return True
    return one is other or np.array_equal(one, other)


def _upper(H):
    """Upper triangle, and the indices of its entries among those of H."""
    if H.nnz == H.shape[0] and np.array_equal(H.indices, np.arange(H.shape[0])):
        return H, slice(None)  # it is diagonal
    found = sparse.triu(_numbered(H, 1), format="csc")
    order = found.data - 1
    return sparse.csc_matrix((H.data[order], found.indices, found.indptr), found.shape), order


def _stacked(C: _Thinned, K: _Thinned, programme: Programme):
    """C above K, and the indices of its entries among those of the whole C, then K."""
    if not K.matrix.shape[0]:
        return C.matrix.copy(), C.order
    numbers = np.concatenate([C.order, programme.C.nnz + K.order])
    found = sparse.vstack([_numbered(C.matrix, 1), _numbered(K.matrix, 1 + C.matrix.nnz)], format="csc")
    order = numbers[found.data - 1]
    return sparse.csc_matrix((_entries(programme)[order], found.indices, found.indptr), found.shape), order


def _numbered(matrix, first: int) -> sparse.csc_matrix:
    """Matrix whose entries count from a number above 0, so that none is taken for a zero."""
    return sparse.csc_matrix((np.arange(first, first + matrix.nnz), matrix.indices, matrix.indptr), matrix.shape)
