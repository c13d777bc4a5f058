"""Function of one state with the operations of its equal chains in the lanes of vector registers.

Inputs of the chains are gathered. What chains pass on to a common link is extracted lane by lane, and added in the order of
the schedule: each operation is that of code without packs, rounded alike.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from llvmlite import ir

from gauss.codegen import processor
from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import PAGE, POINTER, begin_function, counted_loop, input_reader, output_writer
from gauss.codegen.ir_module import DOUBLE, INTEGER, LANE
from gauss.codegen.lanes import Lanes, kind
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.packed_schedule import PackedSchedule, frame_places, runs, vector_length
from gauss.codegen.schedule import schedule
from gauss.codegen.superword import Pack, Packs

if TYPE_CHECKING:
    from gauss.codegen.emit import Writer

PIECE_LENGTH = 400  # units; half of gauss.codegen.outlined_pieces, for vectors fill more of the frame
PIECE = ir.FunctionType(ir.VoidType(), [POINTER, POINTER, POINTER])  # inputs, outputs, frame


class PackedFunction(NativeFunction):
    """A function whose equal chains are computed together.

    Parameters
    ----------
    seeds : sequence of sequences of tuple of int
        Places of equal inputs, one of each chain, by the kind of the chains.
    numbers : dict
        Values of its last inputs, by their places: they are constants of the code.
    """

    def __init__(self, function: Function, seeds: Sequence[Sequence[tuple[int, ...]]], numbers: dict[int, float]):
        self.name, self.function, self.numbers = function.name, function, numbers
        scheduled = schedule(function)
        self.operation_count = sum(node.op not in ("constant", "symbol") for node in scheduled.nodes)
        self.packed = PackedSchedule(scheduled, Packs(scheduled, seeds), numbers)
        self.width = max(vector_length(of_kind[0]) for of_kind in seeds)

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return len(self.function.inputs) - len(self.numbers), len(self.function.outputs)

    @cached_property
    def saving(self) -> float:
        """Share of the instructions that the packs save, about."""
        return 1.0 - self.packed.cost(processor.width()) / self.operation_count

    def operations(self) -> dict[str, int]:
        """Number of operations of each kind, those on constants included."""
        return self.function.operations()

    def write(self, writer: "Writer", width: int) -> ir.Function:
        """Emit the code for one state; see :meth:`NativeFunction.write`."""
        body = self.begin_scalar(writer.module, width)
        pieces = runs(self.packed, PIECE_LENGTH)
        places, size = frame_places(self.packed, pieces, self.width)
        b = ir.IRBuilder(body.append_basic_block("entry"))
        frame = b.alloca(kind(self.width), max(size // self.width, 1))
        frame.align = PAGE
        with _side_by_side(b, self.arity) as (source, target):
            for k, piece in enumerate(pieces):
                code, lanes = begin_function(writer.module, f"{body.name}_{k}", 1, PIECE)
                code.attributes.add("noinline")
                _PackedPieceWriter(self, places, lanes).write(piece, is_last=k == len(pieces) - 1)
                b.call(code, [source, target, b.bitcast(frame, POINTER)])
        b.ret_void()
        return body


@contextmanager
def _side_by_side(b: ir.IRBuilder, arity: tuple[int, int]) -> Iterator[tuple[ir.Value, ir.Value]]:
    """Inputs and outputs of a function, one after the other; they are copied if they are apart."""
    source, in_stride, target, out_stride = b.function.args
    rooms = [b.alloca(DOUBLE, size) for size in arity]
    apart = b.or_(*(b.icmp_signed("!=", stride, INTEGER(1)) for stride in (in_stride, out_stride)))
    with b.if_then(apart, likely=False), counted_loop(b, INTEGER(0), INTEGER(arity[0])) as k:
        b.store(b.load(b.gep(source, [b.mul(k, in_stride)])), b.gep(rooms[0], [k]))
    yield b.select(apart, rooms[0], source), b.select(apart, rooms[1], target)
    with b.if_then(apart, likely=False), counted_loop(b, INTEGER(0), INTEGER(arity[1])) as k:
        b.store(b.load(b.gep(rooms[1], [k])), b.gep(target, [b.mul(k, out_stride)]))


@dataclass(frozen=True)
class _Operand:
    """Operand of a pack by its position: members may have the same constant at several positions."""

    index: int


class _PackedPieceWriter:
    """Emitter of a piece."""

    def __init__(self, function: PackedFunction, places: dict[int, int], lanes: Lanes):
        self.packed, self.places, self.b = function.packed, places, lanes.b
        self.single, widths = lanes, {vector_length(unit) for unit in function.packed.units}
        self.together = {width: lanes if width == 1 else Lanes(lanes.module, width, lanes.b) for width in widths}
        source, target, self.frame = lanes.b.function.args
        self.read, self.store = input_reader(lanes, source, INTEGER(1)), output_writer(lanes, target, INTEGER(1))
        self.values: dict[int, ir.Value] = {}  # of nodes
        self.packs: dict[int, ir.Value] = {}  # by the first member
        self.shared: dict[tuple[int, int], ir.Value] = {}  # broadcast, of nodes by the length of the vector
        self.outputs: dict[int, list[int]] = defaultdict(list)
        for k, x in enumerate(self.packed.whole.outputs):
            self.outputs[x.index if isinstance(x, Expression) else -1].append(k)

    def write(self, piece: range, is_last: bool):
        """Emit the units of a piece; the last one stores the outputs that are no results of units."""
        units = [self.packed.units[k] for k in piece]
        turns = [unit[0].operands[0] for unit in units if len(unit) == 1 and unit[0].op in ("sin", "cos")]
        self.single.sincos_together({angle: self.value(angle) for angle in turns if angle.op == "symbol"})
        for k, unit in zip(piece, units, strict=True):
            self._emit(unit)
            self._keep(k, unit)
        if is_last:
            self._keep_rest()
        self.b.ret_void()

    def _emit(self, unit: Pack):
        node = unit[0]
        if len(unit) == 1:
            found = self.single.operation(node, {x.index: self.value(x) for x in node.operands})
            self.values[node.index] = self.single.number(found)
            return
        columns = list(zip(*(self.packed.packs.operands[member.index] for member in unit), strict=True))
        turns = node.op in ("sin", "cos")  # whose code is found by the index of the angle
        operands = [_Operand(column[0].index if turns else k) for k, column in enumerate(columns)]
        values = {x.index: self.vector(column) for x, column in zip(operands, columns, strict=True)}
        whole, lanes = Expression(node.graph, node.op, tuple(operands), node.value, node.index), self._lanes(unit)
        self.packs[node.index] = lanes.number(lanes.operation(whole, values))

    def _keep(self, k: int, unit: Pack):
        """Store a unit in the frame, and outputs."""
        if k in self.places:
            value = (self.packs if len(unit) > 1 else self.values)[unit[0].index]
            self._lanes(unit).store(value, self.frame, INTEGER(self.places[k]))
        for node in unit:
            for place in self.outputs.get(node.index, ()):
                self.store(place, self.value(node))

    def _keep_rest(self):
        """Store outputs that are inputs or constants."""
        for k, x in enumerate(self.packed.whole.outputs):
            if not isinstance(x, Expression):
                self.store(k, self.single.constant(float(x)))
            elif x.index not in self.packed.unit_of:
                self.store(k, self.value(x))

    def value(self, node: Expression):
        """Value of an operation, an input or a constant."""
        if node.index not in self.values:
            self.values[node.index] = self._found(node)
        return self.values[node.index]

    def _found(self, node: Expression):
        if node.index in self.packed.constants:
            return self.single.constant(self.packed.constants[node.index])
        if node.index in self.packed.inputs:
            return self.read(self.packed.inputs[node.index])
        unit, lane = self.packed.unit_of[node.index], self.packed.packs.place.get(node.index, (0, 0))[1]
        first = self.packed.units[unit][0].index
        if first in self.packs:
            return self.b.extract_element(self.packs[first], LANE(lane))
        return self.single.load(self.frame, INTEGER(self.places[unit] + lane))

    def _lanes(self, unit: Pack) -> Lanes:
        """Emitter of a unit."""
        return self.together[vector_length(unit)]

    def vector(self, members: tuple[Expression, ...]):
        """Values of operands, one of each chain."""
        first, lanes = members[0], self._lanes(members)
        if first.index in self.packed.constants:
            return lanes.constants([self.packed.constants[x.index] for x in members])
        if first.index not in self.packed.packs.place:
            key = first.index, lanes.width
            if key not in self.shared:
                self.shared[key] = lanes.broadcast(self.value(first))
            return self.shared[key]
        if first.index not in self.packs:
            self.packs[first.index] = self._gathered(members)
        return self.packs[first.index]

    def _gathered(self, members: tuple[Expression, ...]):
        """Inputs of the chains, or a pack of another piece."""
        if members[0].index in self.packed.inputs:
            return self.single.joined([self.value(x) for x in members])
        return self._lanes(members).load(self.frame, INTEGER(self.places[self.packed.unit_of[members[0].index]]))
