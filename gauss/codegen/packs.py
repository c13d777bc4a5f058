"""Packs of equal operations of several chains of one function, found from their inputs on.

The legs of a parallel robot meet at its platform, so that they are no independent parts (:mod:`gauss.codegen.superword`).
A pack holds one operation of each chain; its operands are packs, operations that all chains share, or constants (Larsen
and Amarasinghe, PLDI 2000).
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence

from gauss.codegen.expression import Expression
from gauss.codegen.graph import COMMUTATIVE
from gauss.codegen.multiply_add import FUSED
from gauss.codegen.schedule import Schedule
from gauss.codegen.superword import UNPACKABLE

Pack = tuple[Expression, ...]  # one operation, or one input, of each chain
LEAVES = frozenset({"constant", "symbol"})
CONSTANT, PACKED, SHARED = range(3)  # kinds of operands


class Packs:
    """Packs of a schedule.

    Parameters
    ----------
    scheduled : Schedule
        The operations of a function.
    seeds : sequence of sequences of tuple of int
        Places of equal inputs, one of each chain, by the kind of the chains.

    Attributes
    ----------
    place : dict
        Pack and lane of a member, by its index.
    operands : dict
        Operands of a member, in an order that is the same in its pack, by its index.
    """

    def __init__(self, scheduled: Schedule, seeds: Sequence[Sequence[tuple[int, ...]]]):
        self.packs: list[Pack] = []
        self.place: dict[int, tuple[int, int]] = {}
        self.operands: dict[int, tuple[Expression, ...]] = {}
        self._chain: dict[int, tuple[int, int]] = {}  # kind of chains and lane of each member
        for kind, of_kind in enumerate(seeds):
            for seed in of_kind:
                self._add(tuple(scheduled.inputs[k] for k in seed), kind)
        for level in _levels(scheduled.nodes):
            self._pack(level, [len(of_kind[0]) for of_kind in seeds])

    def _add(self, members: Pack, kind: int):
        for lane, member in enumerate(members):
            self.place[member.index], self._chain[member.index] = (len(self.packs), lane), (kind, lane)
        self.packs.append(members)

    def _pack(self, level: list[Expression], chains: list[int]):
        """Pack the operations of a level that are equal in all chains of a kind."""
        alike: dict[tuple, dict[int, Pack]] = defaultdict(dict)
        for node in level:
            of_chains = {self._chain[x.index] for x in node.operands if x.index in self._chain}
            if len(of_chains) == 1 and node.op not in UNPACKABLE:
                ((kind, lane),) = of_chains
                own = alike[kind, self._key(node)]
                own[lane] = (*own.get(lane, ()), node)
        for (kind, _), own in alike.items():
            if len(own) == chains[kind] and len({len(nodes) for nodes in own.values()}) == 1:
                for members in zip(*(own[lane] for lane in range(chains[kind])), strict=True):
                    self._add(members, kind)

    def _key(self, node: Expression) -> tuple:
        """The operation and its operands; their order is recorded."""
        swapped = len(node.operands) if node.op in COMMUTATIVE else 2 if node.op in FUSED else 0
        ordered = (*sorted(node.operands[:swapped], key=self._kind), *node.operands[swapped:])
        self.operands[node.index] = ordered
        return (node.op, *map(self._kind, ordered))

    def _kind(self, operand: Expression) -> tuple[int, int]:
        if operand.is_constant:
            return CONSTANT, 0
        return (PACKED, self.place[operand.index][0]) if operand.index in self.place else (SHARED, operand.index)


def _levels(nodes) -> Iterator[list[Expression]]:
    """Operations by the length of their longest path from the inputs, the same in a pack; the shortest first."""
    depth: dict[int, int] = {}
    levels: dict[int, list[Expression]] = defaultdict(list)
    for node in nodes:
        depth[node.index] = 0 if node.op in LEAVES else 1 + max((depth.get(x.index, 0) for x in node.operands), default=0)
        if node.op not in LEAVES:
            levels[depth[node.index]].append(node)
    return (levels[k] for k in sorted(levels))
