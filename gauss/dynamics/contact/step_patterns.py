"""Which terms of the step of a mechanism are structurally zero: they are left out by the machine code of the step.

    C Cᵀ = Nᵀ M N,   Z = N C⁻ᵀ

C has the envelope of Nᵀ M N (George and Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981); rows of Z
end with the last coordinate that theirs are connected to.
"""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.mechanism_kernels import MechanismTerms, SparseArrays
from gauss.linked_groups import linked_groups


class StepPatterns(NamedTuple):
    """Places of what may differ from zero."""

    gathered: np.ndarray  # (l, 2) terms of Nᵀ M N on and below its diagonal: place in C, place in M
    weight: np.ndarray  # (l,) products of both entries of N
    first: np.ndarray  # (r,) first entry of each row of C
    lowest: np.ndarray  # (r,) least coordinate that each one is connected to
    z_begin: np.ndarray  # z_begin, z_end (n_v,): bounds of the rows of Z
    z_end: np.ndarray
    body_begin: np.ndarray  # body_begin, body_end (k + 1,): bounds of the Jacobians of bodies
    body_end: np.ndarray
    row_begin: np.ndarray  # row_begin, row_end (g + s,): bounds of the rows of stops, ropes and set-valued elements
    row_end: np.ndarray


def step_patterns(layout: SparseArrays, N: np.ndarray) -> StepPatterns:
    """Patterns of a system.

    Parameters
    ----------
    layout : SparseArrays
        Its terms.
    N : ndarray, shape (n_v, r)
        Rates of its independent coordinates.
    """
    differs = layout.flat != 0.0
    differs[layout.entries] = True
    parts = dict(zip(MechanismTerms._fields, layout.parts, strict=True))
    M, J, K = (differs[parts[name][0]].reshape(parts[name][1]) for name in ("M", "J", "K"))
    M = M | np.eye(len(M), dtype=bool)  # implicit damping is added there
    row, column = np.nonzero(N)
    r = N.shape[1]
    i, j = np.nonzero(M[np.ix_(row, row)] & (column[:, None] >= column))
    gathered = np.column_stack([column[i] * r + column[j], row[i] * len(M) + row[j]])
    C = np.eye(r, dtype=bool)
    C[column[i], column[j]] = True
    least = linked_groups(r, zip(*np.nonzero(C), strict=True))
    members = [np.flatnonzero(least == one) for one in least]
    z_begin, z_end = np.zeros((2, len(M)), dtype=np.int64)
    for one in np.unique(row):
        linked = column[row == one]
        z_begin[one], z_end[one] = linked.min(), 1 + max(members[k].max() for k in linked)
    bodies, others = _bounds(J.any(axis=1)), _bounds(K)
    values = N[row, column]
    return StepPatterns(gathered, values[i] * values[j], _bounds(C)[0], least, z_begin, z_end, *bodies, *others)


def _bounds(differs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First place and end of what differs from zero in each row; an empty row ends before it begins."""
    last = np.ones((len(differs), 1), dtype=bool)  # as if something followed
    begin, behind = (np.column_stack([part, last]).argmax(axis=1) for part in (differs, differs[:, ::-1]))
    return begin.astype(np.int64), (differs.shape[1] - behind).astype(np.int64)
