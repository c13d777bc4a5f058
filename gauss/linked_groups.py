"""Groups of things that are linked: which of them belong together, by pairs of links (union–find)."""

from collections.abc import Iterable

import numpy as np


class LinkedGroups:
    """Groups of numbered things, each alone at first, which links join.

    Paths are halved as they are walked: Tarjan and van Leeuwen, J. ACM 31 (1984), 245–281.
    """

    def __init__(self, count: int):
        self._parent = list(range(count))

    def root(self, one: int) -> int:
        """Smallest number in the group of a thing."""
        parent = self._parent
        while parent[one] != one:
            parent[one] = one = parent[parent[one]]
        return one

    def join(self, one: int, other: int) -> bool:
        """Join the groups of two things; whether they were two."""
        one, other = self.root(one), self.root(other)
        if one < other:
            self._parent[other] = one
        else:
            self._parent[one] = other
        return one != other


def linked_groups(count: int, links: Iterable[tuple[int, int]]) -> np.ndarray:
    """Group (count,) of each thing, the smallest number in it, by pairs that belong together."""
    groups = LinkedGroups(count)
    for one, other in links:
        groups.join(one, other)
    return np.array([groups.root(one) for one in range(count)], dtype=np.int64)
