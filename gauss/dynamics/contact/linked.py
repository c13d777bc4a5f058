"""Groups of things that are linked: which of them belong together, by pairs of links (union–find)."""

from collections.abc import Iterable

import numpy as np


def linked(count: int, links: Iterable[tuple[int, int]]) -> np.ndarray:
    """Group (count,) of each thing: the smallest number in it.

    Parameters
    ----------
    count : int
        Number of things.
    links : iterable of (int, int)
        Pairs that belong together.
    """
    parent = list(range(count))

    def root(one: int) -> int:
        while parent[one] != one:
            parent[one] = parent[parent[one]]
            one = parent[one]
        return one

    for one, other in links:
        low, high = sorted((root(one), root(other)))
        parent[high] = low
    return np.array([root(one) for one in range(count)], dtype=np.int64)
