"""Sparse LDLᵀ with symbolic analysis at trace time: order and fill are fixed, only structural nonzeros exist.

Right-looking elimination by least degree (Tinney and Walker 1967; George and Liu, Computer Solution of Large Sparse
Positive Definite Systems, 1981, ch. 5). No pivoting: for quasi-definite matrices, which factor in any order
(Vanderbei 1995).
"""

from heapq import heapify, heappop, heappush

import numpy as np

from gauss.codegen.expression import Expression, as_number


class LDLT:
    """Factorisation of a symmetric quasi-definite matrix of numbers or expressions.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        The matrix; its lower triangle is read.

    Attributes
    ----------
    order : list of int
        Rows in the order of their elimination.
    columns : dict
        Entries of L below the diagonal, {column: {row: entry}}.
    inverse_pivots : dict
        Entries of D⁻¹.

    Raises
    ------
    ZeroDivisionError
        If a pivot is a constant zero.
    """

    def __init__(self, A: np.ndarray):
        n = len(A)
        rest = {(i, j): A[i, j] for i in range(n) for j in range(i + 1) if as_number(A[i, j]) != 0}
        self.order = least_degree(n, rest)
        place = {row: k for k, row in enumerate(self.order)}
        rest = {_later(place, i, j): entry for (i, j), entry in rest.items()}
        self.columns: dict[int, dict] = {}
        self.inverse_pivots: dict = {}
        for j in self.order:
            self.columns[j], self.inverse_pivots[j] = _eliminate(rest, j, place)

    @property
    def entries(self) -> int:
        """Number of entries of L below the diagonal."""
        return sum(len(column) for column in self.columns.values())

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution x (n,) of A x = b."""
        return self.backward(self.forward(b))

    def forward(self, b: np.ndarray) -> np.ndarray:
        """L⁻¹ b (n,): bᵀ A⁻¹ b is the sum of its squares over the pivots."""
        x = list(b)
        for j in self.order:
            for i, entry in self.columns[j].items():
                x[i] = x[i] - entry * x[j]
        return np.array([*x, None], dtype=object)[:-1]

    def backward(self, b: np.ndarray) -> np.ndarray:
        """L⁻ᵀ D⁻¹ b (n,)."""
        x = list(b)
        for j in reversed(self.order):
            x[j] = x[j] * self.inverse_pivots[j]
            for i, entry in self.columns[j].items():
                x[j] = x[j] - entry * x[i]
        return np.array([*x, None], dtype=object)[:-1]


def _eliminate(rest: dict, j: int, place: dict[int, int]) -> tuple[dict, Expression | float]:
    """Column j of L and its inverse pivot; ``rest`` becomes the Schur complement."""
    if (j, j) not in rest:
        raise ZeroDivisionError(f"pivot {j} is a constant zero.")
    inverse = 1.0 / rest[j, j]
    below = {i: entry for (i, k), entry in rest.items() if k == j and i != j}
    column = {i: entry * inverse for i, entry in below.items()}
    for i in below:
        del rest[i, j]
    for i in column:
        for k in column:
            if place[k] <= place[i]:
                rest[i, k] = rest.get((i, k), 0.0) - column[i] * below[k]
    return column, inverse


def least_degree(n: int, pattern) -> list[int]:
    """Minimum-degree order of elimination.

    Ties are broken by the depth in the elimination tree, so that independent short chains can run in parallel.

    Parameters
    ----------
    n : int
        Number of rows.
    pattern : iterable of (int, int)
        Positions of the nonzero entries.
    """
    adjacent: dict[int, set[int]] = {i: set() for i in range(n)}
    for i, j in pattern:
        if i != j:
            adjacent[i].add(j)
            adjacent[j].add(i)
    order, depth = [], dict.fromkeys(range(n), 0)
    waiting = [(len(others), 0, i) for i, others in adjacent.items()]
    heapify(waiting)
    while waiting:
        ties, deep, row = heappop(waiting)
        if row not in adjacent or (ties, deep) != (len(adjacent[row]), depth[row]):
            continue  # outdated entry: the row is in the heap again with its new degree
        others = adjacent.pop(row)
        for i in others:
            depth[i] = max(depth[i], deep + 1)
            adjacent[i] |= others
            adjacent[i] -= {i, row}
            heappush(waiting, (len(adjacent[i]), depth[i], i))
        order.append(row)
    return order


def _later(place, i: int, j: int) -> tuple[int, int]:
    return (i, j) if place[i] >= place[j] else (j, i)
