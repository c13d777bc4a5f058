"""How the entries of a programme lie in the arrays that a solver holds: found once, as long as the pattern stays.

Stacking and cutting sparse matrices takes longer than solving them; moving their entries does not.
"""

import numpy as np
from scipy import sparse

from gauss.backends.programme import Programme


class Layout:
    """Places of the entries of a programme in the upper triangle of H and in the stacked rows [C; K].

    Parameters
    ----------
    programme : Programme
        Any with the pattern in question.

    Attributes
    ----------
    upper : csc_matrix, shape (n, n)
        Upper triangle of H.
    rows : csc_matrix, shape (m + s, n)
        C above K.
    """

    def __init__(self, programme: Programme):
        self.pattern = _pattern(programme)
        self.upper, self._upper_order = _upper(programme.H)
        self.rows, self._rows_order = _stacked(programme.C, programme.K)

    def fits(self, programme: Programme) -> bool:
        """Whether a programme has the same pattern."""
        return _pattern(programme) == self.pattern

    def hessian(self, programme: Programme) -> np.ndarray:
        """Entries of the upper triangle of H."""
        return programme.H.data[self._upper_order]

    def row_entries(self, programme: Programme) -> np.ndarray:
        """Entries of the stacked rows."""
        if not programme.k.size:
            return programme.C.data
        return np.concatenate([programme.C.data, programme.K.data])[self._rows_order]


def _pattern(programme: Programme) -> list[bytes]:
    """Places of all entries, in a form that is compared fast."""
    matrices = programme.H, programme.C, programme.K
    return [part.tobytes() for matrix in matrices for part in (matrix.indptr, matrix.indices)]


def _upper(H):
    """Upper triangle, and where its entries are among those of H."""
    if H.nnz == H.shape[0] and np.array_equal(H.indices, np.arange(H.shape[0])):
        return H, slice(None)  # it is diagonal
    found = sparse.triu(_numbered(H, 1), format="csc")
    order = found.data - 1
    return sparse.csc_matrix((H.data[order], found.indices, found.indptr), found.shape), order


def _stacked(C, K):
    """C above K, and where its entries are among those of C and then K."""
    if not K.shape[0]:
        return C, slice(None)
    found = sparse.vstack([_numbered(C, 1), _numbered(K, 1 + C.nnz)], format="csc")
    order = found.data - 1
    entries = np.concatenate([C.data, K.data])[order]
    return sparse.csc_matrix((entries, found.indices, found.indptr), found.shape), order


def _numbered(matrix, first: int) -> sparse.csc_matrix:
    """Matrix whose entries count from a number above 0, so that none is taken for a zero."""
    return sparse.csc_matrix((np.arange(first, first + matrix.nnz), matrix.indices, matrix.indptr), matrix.shape)
