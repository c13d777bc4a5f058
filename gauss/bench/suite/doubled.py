"""Sparse matrices times vectors of twice the precision: every product and every sum has about 32 digits.

The entries of the matrix are exact binary numbers. Sums are made in pairs, all rows at once.
"""

import numpy as np
from scipy import sparse

from gauss.linkages.doubled import Doubled


def wide(x) -> Doubled:
    """Vector of doubles as a doubled one; a doubled one as it is."""
    return x if isinstance(x, Doubled) else Doubled(np.asarray(x, dtype=float), np.zeros(np.shape(x)))


def zeros(n: int) -> Doubled:
    """Doubled zeros."""
    return Doubled(np.zeros(n), np.zeros(n))


def taken(x: Doubled, where) -> Doubled:
    """Entries of a doubled vector."""
    return Doubled(x.hi[where], x.lo[where])


def joined(*parts: Doubled) -> Doubled:
    """Doubled vectors one after the other."""
    return Doubled(np.concatenate([part.hi for part in parts]), np.concatenate([part.lo for part in parts]))


def product(M, x: Doubled) -> Doubled:
    """M x of a sparse matrix of doubles."""
    M = sparse.csr_array(M)
    return sums(taken(x, M.indices) * M.data, np.diff(M.indptr))


def sums(terms: Doubled, counts: np.ndarray) -> Doubled:
    """Sums of consecutive groups of terms, ``counts`` terms each; 0 of none."""
    total, group = zeros(counts.size), np.repeat(np.arange(counts.size), counts)
    while counts.max(initial=0) > 1:
        place = np.arange(group.size) - (np.cumsum(counts) - counts)[group]
        first = np.flatnonzero(place % 2 == 0)
        paired = place[first] + 1 < counts[group[first]]
        second = np.where(paired, first + 1, first)
        terms = taken(terms, first) + taken(terms, second) * np.where(paired, 1.0, 0.0)
        group, counts = group[first], (counts + 1) // 2
    total.hi[group], total.lo[group] = terms.hi, terms.lo
    return total
