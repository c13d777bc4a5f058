"""Parts of a function that share nothing and compute alike, as the legs of a robot on a stand: each goes in a lane."""

from collections.abc import Iterator

from gauss.codegen.expression import COMMUTATIVE, Expression
from gauss.codegen.multiply_add import FUSED
from gauss.codegen.schedule import Schedule

Subsystem = list[Expression]  # operations of a part in order, its inputs among them


def alike(scheduled: Schedule, at_most: int) -> list[list[Subsystem]]:
    """Groups of two to ``at_most`` parts that differ in their constants only, node by node."""
    groups: dict[tuple, list[Subsystem]] = {}
    for part in _apart(scheduled.nodes):
        if all(node.op not in ("call", "item") for node in part):
            groups.setdefault(_form(part), []).append(part)
    found = [parts[k : k + at_most] for parts in groups.values() for k in range(0, len(parts), at_most)]
    return [parts for parts in found if len(parts) > 1]


def _apart(nodes) -> Iterator[Subsystem]:
    """Operations that are connected with each other, constants apart."""
    stands_for: dict[int, int] = {}

    def find(index: int) -> int:
        while stands_for[index] != index:
            stands_for[index] = index = stands_for[stands_for[index]]
        return index

    varying = [node for node in nodes if not node.is_constant]
    for node in varying:
        stands_for[node.index] = node.index
        for operand in node.operands:
            if not operand.is_constant:
                stands_for[find(operand.index)] = find(node.index)
    parts: dict[int, Subsystem] = {}
    for node in varying:
        parts.setdefault(find(node.index), []).append(node)
    yield from parts.values()


def _form(part: Subsystem) -> tuple:
    """What each operation of a part does to which other ones; equal forms differ in constants only."""
    places = {node.index: place for place, node in enumerate(part)}
    return tuple((node.op, *_operands(places, ordered(node))) for node in part)


def _operands(places: dict[int, int], operands: list[Expression]) -> Iterator[int]:
    """Place of each operand; of a constant, which has none, −1 or less by the first operand that is the same constant."""
    indices = [x.index for x in operands]
    return (places.get(index, -1 - indices.index(index)) for index in indices)


def ordered(node: Expression) -> list[Expression]:
    """Operands of a node, a constant first where the order does not matter: of factors and of terms."""
    swapped = len(node.operands) if node.op in COMMUTATIVE else 2 if node.op in FUSED else 0
    return sorted(node.operands[:swapped], key=lambda x: not x.is_constant) + list(node.operands[swapped:])
