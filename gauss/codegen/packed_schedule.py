"""Schedule of a function with packs: units, each one operation or one pack, depth first by latency, and their pieces."""

from collections import defaultdict
from collections.abc import Sequence
from fractions import Fraction
from heapq import heappop, heappush

from gauss.codegen.expression import Expression
from gauss.codegen.graph import BINARY, TURNS, UNARY
from gauss.codegen.schedule import FUSED, LATENCY, Schedule
from gauss.codegen.superword import LEAVES, Pack, Packs

EXACT = frozenset({"neg", "sqrt", "add", "sub", "mul", "div", "min", "max", "less", "less_equal"})  # as machine code rounds


class PackedSchedule:
    """Units of a function in order, operands first.

    Parameters
    ----------
    numbers : dict
        Values of the inputs that are constants, by their places.

    Attributes
    ----------
    units : list of Pack
        Operations, one or one of each chain.
    constants : dict
        Values of constant operations and inputs, by their index.
    """

    def __init__(self, whole: Schedule, packs: Packs, numbers: dict[int, float]):
        self.whole, self.packs = whole, packs
        self.inputs = {x.index: k for k, x in enumerate(whole.inputs)}
        self.constants = {whole.inputs[k].index: value for k, value in numbers.items()}
        self.constants |= {node.index: float(node.value) for node in whole.nodes if node.is_constant}
        ordered = self._depth_first()
        self.units = [unit for unit in ordered if not self._folded(unit)]
        self.unit_of = {node.index: k for k, unit in enumerate(self.units) for node in unit}

    def cost(self, width: int) -> int:
        """Instructions of all units in registers of so many numbers; a member of a pack that is used alone costs one."""
        extracted = {x.index for unit in self.units if len(unit) == 1 for x in unit[0].operands} & self.packs.place.keys()
        return sum(-(-vector_length(unit) // width) for unit in self.units) + len(extracted)

    def used(self, unit: Pack) -> list[int]:
        """Units that compute operands of a unit."""
        operands = (x.index for node in unit for x in node.operands)
        return list(dict.fromkeys(self.unit_of[index] for index in operands if index in self.unit_of))

    def _depth_first(self) -> list[Pack]:
        """All units, each after its operands, that of the longest latency last; sines and cosines of inputs first."""
        unit_of = self._units()
        units = {unit[0].index: unit for unit in unit_of.values()}
        operands = {first: _operands(unit, unit_of) for first, unit in units.items()}
        turns = [first for first, unit in units.items() if unit[0].op in TURNS and not operands[first]]
        turns.sort(key=lambda first: units[first][0].operands[0].index)
        ends = [unit_of[x.index][0].index for x in self.whole.outputs if isinstance(x, Expression) and x.index in unit_of]
        when = _latencies(units, operands)
        return [units[first] for first in _after_operands([*turns, *ends], operands, when)]

    def _units(self) -> dict[int, Pack]:
        """Unit of each operation, by its index."""
        place, packs = self.packs.place, self.packs.packs
        nodes = (node for node in self.whole.nodes if node.op not in LEAVES)
        return {node.index: packs[place[node.index][0]] if node.index in place else (node,) for node in nodes}

    def _folded(self, unit: Pack) -> bool:
        """Whether a unit is constant; its values are recorded."""
        try:
            found = {node.index: self._value(node) for node in unit}
        except (KeyError, ValueError, OverflowError):  # an operand is no constant, or the result no number
            return False
        self.constants |= found
        return True

    def _value(self, node: Expression) -> float:
        x = [self.constants[operand.index] for operand in node.operands]
        if node.op in FUSED:
            product, total = FUSED[node.op]
            return float(product * Fraction(x[0]) * Fraction(x[1]) + total * Fraction(x[2]))  # rounded once
        if node.op == "select":
            return x[1] if x[0] else x[2]
        if node.op not in EXACT:
            raise ValueError(f"{node.op} is rounded by machine code")
        return (BINARY if len(x) > 1 else UNARY)[node.op](*x)


def vector_length(unit: Sequence) -> int:
    """Numbers in the vector of a pack, a power of two."""
    return 1 << (len(unit) - 1).bit_length()


def _operands(unit: Pack, unit_of: dict[int, Pack]) -> list[int]:
    """Units that compute operands of a unit, by their first operations."""
    return list(dict.fromkeys(unit_of[x.index][0].index for node in unit for x in node.operands if x.index in unit_of))


def _latencies(units: dict[int, Pack], operands: dict[int, list[int]]) -> dict[int, int]:
    """When the value of each unit is there, in additions."""
    when: dict[int, int] = {}
    for first in _after_operands(list(units), operands, dict.fromkeys(units, 0)):
        begun = max((when[x] for x in operands[first]), default=0)
        when[first] = begun + LATENCY.get(units[first][0].op, 1)
    return when


def _after_operands(ends: list[int], operands: dict[int, list[int]], when: dict[int, int]) -> list[int]:
    """Units on which the ends depend, each after its operands."""
    found: list[int] = []
    is_open, is_done, waiting = set[int](), set[int](), ends[::-1]
    while waiting:
        unit = waiting.pop()
        if unit in is_done:
            continue
        if unit in is_open or not operands[unit]:
            is_done.add(unit)
            found.append(unit)
            continue
        is_open.add(unit)
        waiting += (unit, *sorted(operands[unit], key=when.__getitem__))
    return found


def runs(schedule: PackedSchedule, length: int) -> list[range]:
    """Pieces of about ``length`` units, cut where the fewest numbers are live."""
    total, last = len(schedule.units), last_uses(schedule)
    live, crossing = 0, []
    ends: dict[int, int] = defaultdict(int)
    for k, unit in enumerate(schedule.units):
        live -= ends.pop(k, 0)
        crossing.append(live)
        live += len(unit)
        ends[last.get(k, k) + 1] += len(unit)
    found, start = [], 0
    while total - start > 3 * length // 2:
        first = start + (length + 1) // 2
        end = min(range(first, min(first + length, total)), key=crossing.__getitem__)
        found.append(range(start, end))
        start = end
    return [*found, range(start, total)]


def last_uses(schedule: PackedSchedule) -> dict[int, int]:
    """Last unit that uses each unit."""
    return {x: k for k, unit in enumerate(schedule.units) for x in schedule.used(unit)}


def frame_places(schedule: PackedSchedule, pieces: list[range], width: int) -> tuple[dict[int, int], int]:
    """Place in the frame of every unit that another piece uses, and the numbers in the frame; packs take a vector each."""
    last, found, size = last_uses(schedule), dict[int, int](), 0
    free: dict[bool, list[int]] = {True: [], False: []}  # of packs, and of numbers
    for piece in pieces:
        ends = [unit for unit in found if piece.start <= last[unit] < piece.stop]
        for unit in piece:
            if last.get(unit, unit) < piece.stop:
                continue
            is_pack = len(schedule.units[unit]) > 1
            if not free[is_pack]:
                free[is_pack] = [size] if is_pack else list(range(size, size + width))
                size += width
            found[unit] = heappop(free[is_pack])
        for unit in ends:
            heappush(free[len(schedule.units[unit]) > 1], found[unit])
    return found, size
