"""Sparse matrices by columns, in the arrays of scipy.sparse but without importing it: that takes as long as all of gauss."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csc_array
else:
    csc_array = object

KEPT_PATTERNS = 64  # number of sparsity patterns of matrices that are kept


@dataclass(frozen=True)
class Columns:
    """A sparse matrix by columns.

    Parameters
    ----------
    data, indices : ndarray, shape (stored,)
        Entries and their rows, column after column.
    indptr : ndarray, shape (n + 1,)
        Where each column begins.
    shape : tuple of int
        Rows and columns.
    """

    data: np.ndarray
    indices: np.ndarray
    indptr: np.ndarray
    shape: tuple[int, int]

    @classmethod
    def diagonal(cls, entries: np.ndarray) -> "Columns":
        """Square matrix with these entries (n,) on its diagonal."""
        n = entries.size
        return cls(entries, np.arange(n, dtype=np.int32), np.arange(n + 1, dtype=np.int32), (n, n))

    def beside(self, other: "Columns") -> "Columns":
        """The matrix with the columns of another one after its own."""
        indptr = np.concatenate([self.indptr, self.data.size + other.indptr[1:]])
        data, indices = np.concatenate([self.data, other.data]), np.concatenate([self.indices, other.indices])
        return Columns(data, indices, indptr, (self.shape[0], self.shape[1] + other.shape[1]))

    def csc(self) -> csc_array:
        """The same as a csc_array, explicit zeros kept."""
        from scipy import sparse

        return sparse.csc_array((self.data, self.indices, self.indptr), shape=self.shape)

    def toarray(self) -> np.ndarray:
        """The same as a dense array."""
        dense = np.zeros(self.shape)
        dense[self.indices, np.repeat(np.arange(self.shape[1]), np.diff(self.indptr))] = self.data
        return dense


def from_blocks(entries, shape) -> Columns:
    """Matrix from (block, first row, first column) triples, explicit zeros kept; overlapping blocks are added.

    Blocks of one pattern share their index arrays, which are read-only.
    """
    if not entries:
        return Columns(np.zeros(0), np.zeros(0, np.int32), np.zeros(shape[1] + 1, np.int32), shape)
    place, indices, indptr = _pattern(tuple((block.shape, r, c) for block, r, c in entries), shape)
    data = np.bincount(place, np.concatenate([block.ravel() for block, _, _ in entries]), minlength=indices.size)
    return Columns(data, indices, indptr, shape)


@lru_cache(maxsize=KEPT_PATTERNS)
def _pattern(blocks, shape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index of every entry of the blocks among those stored, the row indices of these, and the column pointers."""
    rows = np.concatenate([np.repeat(np.arange(r, r + m), n) for (m, n), r, _ in blocks])
    columns = np.concatenate([np.tile(np.arange(c, c + n), m) for (m, n), _, c in blocks])
    stored, place = np.unique(columns * shape[0] + rows, return_inverse=True)
    begins = np.searchsorted(stored, np.arange(shape[1] + 1) * shape[0])
    found = place.ravel(), (stored % shape[0]).astype(np.int32), begins.astype(np.int32)
    for array in found:
        array.flags.writeable = False
    return found
