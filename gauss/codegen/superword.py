"""Superword-level parallelism: equal operations of a function are packed into the lanes of a vector register.

Larsen and Amarasinghe, PLDI 2000. Here whole connected components are packed, where a function has isomorphic ones. The legs
of a parallel robot meet at its platform, so that they are no such parts: of these chains, operations are packed from the
inputs on; the operands of a pack are packs, operations that all chains share, or constants.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence

from gauss.codegen.expression import Expression
from gauss.codegen.graph import COMMUTATIVE
from gauss.codegen.schedule import FUSED, Schedule
from gauss.linked_groups import linked_groups

UNPACKABLE = frozenset({"call", "item", "row", "entry"})  # operations that differ by more than their operands
IsomorphicPart = list[Expression]  # operations of a connected component in order, its inputs included
Pack = tuple[Expression, ...]  # one operation, or one input, of each chain
LEAVES = frozenset({"constant", "symbol"})
CONSTANT, PACKED, SHARED = range(3)  # kinds of operands of a pack


def superword_groups(scheduled: Schedule, at_most: int) -> list[list[IsomorphicPart]]:
    """Groups of two to ``at_most`` isomorphic parts: equal node by node, except for constants."""
    groups: dict[tuple, list[IsomorphicPart]] = {}
    parts = list(_independent_parts(scheduled.nodes))
    lengths = Counter(map(len, parts))
    for part in parts:  # the key takes time, and most functions are one part
        if lengths[len(part)] > 1 and all(node.op not in UNPACKABLE for node in part):
            groups.setdefault(_shape(part), []).append(part)
    found = [group[k : k + at_most] for group in groups.values() for k in range(0, len(group), at_most)]
    return [group for group in found if len(group) > 1]


def _independent_parts(nodes) -> Iterator[IsomorphicPart]:
    """Connected components of the graph without constants."""
    varying = [node for node in nodes if not node.is_constant]
    places = {node.index: place for place, node in enumerate(varying)}
    links = ((place, places[x.index]) for place, node in enumerate(varying) for x in node.operands if not x.is_constant)
    parts: dict[int, IsomorphicPart] = {}
    for node, group in zip(varying, linked_groups(len(varying), links).tolist(), strict=True):
        parts.setdefault(group, []).append(node)
    yield from parts.values()


def _shape(part: IsomorphicPart) -> tuple:
    """Key of a part: the operation and operand positions of each node; parts of equal key differ in constants only."""
    places = {node.index: place for place, node in enumerate(part)}
    return tuple((node.op, *_operands(places, ordered_operands(node))) for node in part)


def _operands(places: dict[int, int], operands: list[Expression]) -> Iterator[int]:
    """Position of each operand; for a constant −1 − k, k being the first operand that is the same constant."""
    indices = [x.index for x in operands]
    return (places.get(index, -1 - indices.index(index)) for index in indices)


def ordered_operands(node: Expression, key: Callable = lambda x: not x.is_constant) -> list[Expression]:
    """Operands of a node, where the operation commutes by a key: constants first."""
    swapped = len(node.operands) if node.op in COMMUTATIVE else 2 if node.op in FUSED else 0
    return [*sorted(node.operands[:swapped], key=key), *node.operands[swapped:]]


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
        self.operands[node.index] = tuple(ordered_operands(node, self._kind))
        return (node.op, *map(self._kind, self.operands[node.index]))

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
