"""Long functions over blocks of states: each piece runs for all vectors of a block before the next one begins.

The code of a piece stays in the nearest cache of instructions, and the vectors of a block do not depend on each other, so
that operations of one fill the waiting times of another. Values that cross pieces stay in the nearest cache of data.
"""

from typing import NamedTuple, TypeGuard

from llvmlite import ir

from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import BODY, POINTER, Buffers, counted_loop
from gauss.codegen.lanes import DOUBLE, INTEGER
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.outlined_pieces import pieces_of
from gauss.codegen.schedule import Schedule

STATES = 16  # of a block: of those of a robot arm 150 values cross pieces, in 19 kB of a nearest cache of 32
PIECE_LENGTH = 150  # operations of a piece: those of two vectors wait for their operands together
SHORTEST = 200  # operations of a function that has blocks
SHORTEST_OF_ROWS = 2_000  # the same where rows are transposed: their buffers, too, are in the nearest cache of data


class StateBlocks(NamedTuple):
    """Code of a function for vectors of states side by side."""

    # ``void name(double* in, i64 in_stride, double* out, i64 out_stride, double* frame, i64 vectors)``: input j of state i
    # is ``in[j * in_stride + i]``; at most :data:`STATES` states
    code: ir.Function
    slots: int  # numbers of a state in its frame

    def frame(self, buffers: Buffers) -> ir.Value:
        """Frame of a block, in a function that calls it."""
        return buffers.b.bitcast(buffers.room(DOUBLE, self.slots * STATES, align=64), POINTER)


def has_blocks(function: Function | NativeFunction, shortest: int = SHORTEST) -> TypeGuard[Function]:
    """Whether a function is long, and has no functions within it."""
    if isinstance(function, NativeFunction):
        return False
    return len(function.nodes) >= shortest and all(node.op != "call" for node in function.nodes)


def vectors_of(b: ir.IRBuilder, states: ir.Value, width: int) -> ir.Value:
    """Vectors of the next block of so many states; the last one need not be full."""
    fewer = b.select(b.icmp_signed("<", states, INTEGER(STATES)), states, INTEGER(STATES))
    return b.sdiv(b.add(fewer, INTEGER(width - 1)), INTEGER(width))


def write_block(module: ir.Module, name: str, whole: Schedule, width: int) -> StateBlocks:
    """Code of a function for blocks of states, in vectors of a width.

    Parameters
    ----------
    width : int
        Number of states of a vector.
    """
    pieces = pieces_of(module, name, whole, {}, width, True, PIECE_LENGTH)
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
