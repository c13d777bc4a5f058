"""The sparsity pattern of a compulsion: which rows act on which bodies and joint rates, and the spanning tree of its joints.

It is found once a scene. Rows of joints in the tree determine every body from its inner neighbour; the other rows are loop
constraints, couplings and relations.
"""

from dataclasses import dataclass
from functools import cached_property

GROUND = -1  # index of the world where a body index is expected


@dataclass(frozen=True)
class ConstraintRows:
    """Rows that belong together: those of one joint or one relation.

    Parameters
    ----------
    name : str
        Name of the joint or relation.
    rows : slice
        Its rows among all r.
    bodies : tuple of int
        Bodies with a block in A.
    columns : tuple of slice
        Joint coordinates with a block in B, among all p.
    """

    name: str
    rows: slice
    bodies: tuple[int, ...]
    columns: tuple[slice, ...]


@dataclass(frozen=True)
class Edge:
    """Constraint through which the tree reaches a body.

    Parameters
    ----------
    constraint : int
        Index of the constraint; it has six rows.
    outer, inner : int
        Body that is reached, and the body (or GROUND) from which.
    """

    constraint: int
    outer: int
    inner: int


@dataclass(frozen=True)
class Structure:
    """Pattern of a compulsion, found once per scene.

    Parameters
    ----------
    bodies : tuple of str
        Names of the n bodies.
    coordinates : tuple of str
        Names of the p rates.
    constraints : tuple of ConstraintRows
        All rows, in order.
    tree : tuple of Edge
        Spanning tree that reaches every body, inner bodies first.
    """

    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    constraints: tuple[ConstraintRows, ...]
    tree: tuple[Edge, ...]

    @property
    def n_bodies(self) -> int:
        """Number of bodies, n."""
        return len(self.bodies)

    @property
    def n_columns(self) -> int:
        """Number of joint rates, p."""
        return len(self.coordinates)

    @cached_property
    def n_rows(self) -> int:
        """Number of rows, r."""
        return max((c.rows.stop for c in self.constraints), default=0)

    @cached_property
    def closures(self) -> tuple[int, ...]:
        """Constraints outside the spanning tree: loop closures, couplings and relations."""
        in_tree = {edge.constraint for edge in self.tree}
        return tuple(i for i in range(len(self.constraints)) if i not in in_tree)

    @cached_property
    def clusters(self) -> tuple[tuple[tuple[int, ...], tuple[slice, ...]], ...]:
        """Constraints that share columns of B, with these columns: they are eliminated together."""
        owner: dict[int, set[int]] = {}
        clusters: list[set[int]] = []
        for i, constraint in enumerate(self.constraints):
            keys = [c.start for c in constraint.columns if c.stop > c.start]
            merged = {i}.union(*(owner[key] for key in keys if key in owner))
            clusters = [c for c in clusters if c.isdisjoint(merged)] + [merged]
            for j in merged:
                for c in self.constraints[j].columns:
                    owner[c.start] = merged
        return tuple((tuple(sorted(c)), self._columns(c)) for c in sorted(clusters, key=min))

    def _columns(self, cluster) -> tuple[slice, ...]:
        columns = {(c.start, c.stop) for i in cluster for c in self.constraints[i].columns if c.stop > c.start}
        return tuple(slice(*pair) for pair in sorted(columns))
