"""Functions → LLVM IR: one pass emits scalar code or SIMD code over several states.

A function becomes, for each vector width, ``void name(double* in, i64 in_stride, double* out, i64 out_stride)`` over
structures of arrays; it calls other functions with its own width. A long function is outlined into pieces
(:mod:`gauss.codegen.outlined_pieces`), so that the time to compile it is proportional to its length.

Of many states, a long function runs over blocks: each piece for all vectors of a block before the next one begins. The code
of a piece stays in the nearest cache of instructions, and the vectors of a block do not depend on each other, so that
operations of one fill the waiting times of another. Values that cross pieces stay in the nearest cache of data.
"""

from typing import NamedTuple, TypeGuard

from llvmlite import ir

from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import (
    BODY,
    POINTER,
    Buffers,
    begin_function,
    counted_loop,
    input_reader,
    output_writer,
    strides,
    strip_mined_loop,
)
from gauss.codegen.ir_module import DOUBLE, INTEGER
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.outlined_pieces import lengths, pieces_of, write_pieces
from gauss.codegen.schedule import Schedule, part, schedule
from gauss.codegen.straight_line import calling, result_rooms, straight_line
from gauss.codegen.terminal_line import function_written

STATES_PER_BLOCK = 16  # of a block: of those of a robot arm 150 values cross pieces, in 19 kB of a nearest cache of 32
BLOCK_PIECE_LENGTH = 150  # operations of a piece: those of two vectors wait for their operands together
SHORTEST_IN_BLOCKS = 200  # operations of a function that has blocks
SHORTEST_OF_ROWS = 2_000  # the same where rows are transposed: their buffers, too, are in the nearest cache of data
MOST_OPERATIONS = 6  # for each input: so few are made twice


class StateBlocks(NamedTuple):
    """Code of a function for vectors of states side by side."""

    # ``void name(double* in, i64 in_stride, double* out, i64 out_stride, double* frame, i64 vectors)``: input j of state i
    # is ``in[j * in_stride + i]``; at most :data:`STATES_PER_BLOCK` states
    code: ir.Function
    slots: int  # numbers of a state in its frame

    def frame(self, buffers: Buffers) -> ir.Value:
        """Frame of a block, in a function that calls it."""
        return buffers.b.bitcast(buffers.room(DOUBLE, self.slots * STATES_PER_BLOCK, align=64), POINTER)


def has_blocks(function: Function | NativeFunction, shortest: int = SHORTEST_IN_BLOCKS) -> TypeGuard[Function]:
    """Whether a function is long, and has no functions within it."""
    if isinstance(function, NativeFunction):
        return False
    return len(function.nodes) >= shortest and all(node.op != "call" for node in function.nodes)


def vectors_of(b: ir.IRBuilder, states: ir.Value, width: int) -> ir.Value:
    """Vectors of the next block of so many states; the last one need not be full."""
    fewer = b.select(b.icmp_signed("<", states, INTEGER(STATES_PER_BLOCK)), states, INTEGER(STATES_PER_BLOCK))
    return b.sdiv(b.add(fewer, INTEGER(width - 1)), INTEGER(width))


def write_block(module: ir.Module, name: str, whole: Schedule, width: int) -> StateBlocks:
    """Code of a function for blocks of states, in vectors of so many states."""
    pieces = pieces_of(module, name, whole, {}, width, True, BLOCK_PIECE_LENGTH)
    code = ir.Function(module, ir.FunctionType(ir.VoidType(), [*BODY.args, POINTER, INTEGER]), name)
    code.linkage = "internal"
    source, in_stride, target, out_stride, frame, vectors = code.args
    slots, b = INTEGER(pieces.slots), ir.IRBuilder(code.append_basic_block("entry"))
    for piece in pieces.codes:
        with counted_loop(b, INTEGER(0), vectors) as k:
            first = b.mul(k, INTEGER(width))
            given, found, values = b.gep(source, [first]), b.gep(target, [first]), b.gep(frame, [b.mul(first, slots)])
            b.call(piece, [given, in_stride, found, out_stride, values])
    b.ret_void()
    return StateBlocks(code, pieces.slots)


class Writer:
    """Writer of one module, for this CPU by default: of functions, and of the loops that call them."""

    def __init__(self, module: ir.Module | None = None):
        self.module = ir.Module(name="gauss") if module is None else module
        self._bodies: dict[tuple, ir.Function] = {}
        self._schedules: dict[Function, Schedule] = {}
        self._blocks: dict[tuple, StateBlocks] = {}

    def body(self, function: Function | NativeFunction, width: int = 1, strided: bool = False) -> ir.Function:
        """Code of a function for one vector width, emitted at the first request.

        A :class:`gauss.codegen.NativeFunction` emits its own. Other code takes its inputs and outputs one after the other,
        whatever stride it is given, unless it is ``strided``.

        Raises
        ------
        TypeError
            If an output depends on a symbol that is no input.
        """
        key = (function, width, strided)
        if key not in self._bodies:
            if isinstance(function, NativeFunction):
                self._bodies[key] = function.write(self, width)
            else:
                self._bodies[key] = self._write(function, width, strided)
            function_written()
        return self._bodies[key]

    def over_states(self, function: Function | NativeFunction, widths):
        """Write ``run(i64 count, double* in, i64 in_stride, double* out, i64 out_stride)``, input j of state i being
        ``in[j * in_stride + i]``: vectors of the widest width as long as they fit, then single states.
        """  # noqa: D205
        run = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [INTEGER, *BODY.args]), name="run")
        count, source, in_stride, target, out_stride = run.args
        b = ir.IRBuilder(run.append_basic_block("entry"))
        start = ir.Constant(INTEGER, 0)
        for width in sorted({1, *widths}, reverse=True):
            if width > 1 and has_blocks(function):
                start = self._in_blocks(b, function, width, run.args)
                continue
            body = self.body(function, width, strided=True)
            call = lambda i, body=body: b.call(body, [b.gep(source, [i]), in_stride, b.gep(target, [i]), out_stride])  # noqa: E731
            start = strip_mined_loop(b, start, count, width, call)
        b.ret_void()

    def _in_blocks(self, b: ir.IRBuilder, function: Function, width: int, arguments) -> ir.Value:
        """Write the calls for as many states as fill whole vectors; their number."""
        count, source, in_stride, target, out_stride = arguments
        buffers, block = Buffers(b), self.block(function, width)
        frame, end = block.frame(buffers), b.sub(count, b.srem(count, INTEGER(width)))
        with counted_loop(b, INTEGER(0), end, STATES_PER_BLOCK) as first:
            vectors = vectors_of(b, b.sub(end, first), width)
            given, found = b.gep(source, [first]), b.gep(target, [first])
            b.call(block.code, [given, in_stride, found, out_stride, frame, vectors])
        buffers.free()
        return end

    def block(self, function: Function, width: int) -> StateBlocks:
        """Code of a function for blocks of states, emitted at the first request; it must have blocks."""
        key = function, width
        if key not in self._blocks:
            name = f"{function.name}_block_{len(self._blocks)}_{width}"
            self._blocks[key] = write_block(self.module, name, self._scheduled(function), width)
        return self._blocks[key]

    def export(self, function: Function | NativeFunction, name: str, *others: Function | NativeFunction):
        """Write ``name(double* in, double* out)``, one state; outputs of other functions of the same inputs follow."""
        entry = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [POINTER, POINTER]), name=name)
        b, stride, place = ir.IRBuilder(entry.append_basic_block("entry")), INTEGER(1), 0
        for one in (function, *others):
            b.call(self.body(one), [entry.args[0], stride, b.gep(entry.args[1], [INTEGER(place)]), stride])
            place += len(one.outputs)
        b.ret_void()

    def divided(self, function: Function, count: int) -> tuple[Function, Function] | None:
        """The first outputs and the others as functions of their own, each rounded as in the whole.

        None where the others take so many operations that some are worth sharing.
        """
        whole = self._scheduled(function)
        beside = part(whole, whole.outputs[count:])
        if len(beside.nodes) > MOST_OPERATIONS * len(whole.inputs):
            return None
        parts = part(whole, whole.outputs[:count]), beside
        first, others = (Function(function.name, whole.inputs, one.outputs, function.parameters) for one in parts)
        self._schedules |= {first: parts[0], others: parts[1]}
        return first, others

    def _scheduled(self, function: Function) -> Schedule:
        """Schedule of the operations, the same for all widths."""
        if function not in self._schedules:
            inputs = set(function.inputs)
            foreign = [n.value for n in function.nodes if n.op == "symbol" and n not in inputs]
            if foreign:
                raise TypeError(
                    f"the outputs of {function.name!r} depend on {', '.join(foreign[:5])}, which is none of its inputs."
                )
            self._schedules[function] = schedule(function)
        return self._schedules[function]

    def _write(self, function: Function, width: int, strided: bool) -> ir.Function:
        nodes = function.nodes
        callees = {node.value: self.body(node.value, width) for node in nodes if node.op == "call"}
        name = f"{function.name}_{len(self._bodies)}_{width}"
        scheduled = self._scheduled(function)
        if len(nodes) > lengths(self.module)[0]:
            return write_pieces(self.module, name, scheduled, callees, width, strided)
        body, lanes = begin_function(self.module, name, width)
        source, in_stride, target, out_stride = strides(body, width, strided)
        fetch, keep = input_reader(lanes, source, in_stride), output_writer(lanes, target, out_stride)
        rooms = result_rooms(lanes, scheduled.nodes)
        straight_line(lanes, scheduled, fetch, keep, calling(lanes, callees), results=rooms)
        lanes.b.ret_void()
        return body
