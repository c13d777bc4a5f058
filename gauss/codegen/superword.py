"""Superword-level parallelism: independent isomorphic parts of a function are packed into the lanes of a vector register.

The legs of a parallel robot are such parts (Larsen and Amarasinghe, PLDI 2000; here whole connected components are packed).
"""

from collections import Counter
from collections.abc import Iterator

from gauss.codegen.expression import Expression
from gauss.codegen.graph import COMMUTATIVE
from gauss.codegen.multiply_add import FUSED
from gauss.codegen.schedule import Schedule
from gauss.linked_groups import linked_groups

UNPACKABLE = frozenset({"call", "item", "row", "entry"})  # operations that differ by more than their operands
IsomorphicPart = list[Expression]  # operations of a connected component in order, its inputs included


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


def ordered_operands(node: Expression) -> list[Expression]:
    """Operands of a node, constants first where the operation commutes."""
    swapped = len(node.operands) if node.op in COMMUTATIVE else 2 if node.op in FUSED else 0
    return sorted(node.operands[:swapped], key=lambda x: not x.is_constant) + list(node.operands[swapped:])
