"""Emission of functions on arrays of numbers, for one motion or for one per SIMD lane: loops over entries, calls, sums.

A loop over the entries is as long for a hundred coordinates as for one. What it does with an entry is a traced function of
one coordinate, inlined.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np
from llvmlite import ir

from gauss.codegen import (
    INTEGER,
    LINE,
    POINTER,
    Buffers,
    Function,
    Lanes,
    NativeFunction,
    Writer,
    constant_array,
    copy,
    counted_loop,
    schedule,
    straight_line,
    vector_width,
)
from gauss.codegen.text_builder import TextBuilder


class RowCode:
    """Emitter of a function (in, in_stride, out, out_stride) whose arrays are contiguous, for so many motions at a time."""

    def __init__(self, writer: Writer, function: ir.Function, width: int):
        self.writer, self.function, self.width = writer, function, width
        # a loop over a batch: one motion per SIMD lane, or in a thread of a GPU
        self.is_batch = width == vector_width(writer.module)
        self.given, _, self.found, _ = self.function.args
        self.b = TextBuilder(self.function.append_basic_block("entry"))
        self.motions, self.buffers = Lanes(writer.module, width, self.b), Buffers(self.b)

    def room(self, size: int):
        """Buffer of ``size`` numbers."""
        return self.b.bitcast(self.buffers.room(self.motions.kind, size, LINE), POINTER)

    def at(self, pointer, offset):
        """Pointer to an entry."""
        return self.b.gep(pointer, [self._place(offset)])

    def number(self, pointer, offset):
        """Read a number."""
        return self.motions.load(pointer, self._place(offset))

    def put(self, pointer, offset, value):
        """Write a number."""
        self.motions.store(value, pointer, self._place(offset))

    def _place(self, offset):
        """Distance of an entry, an integer or a value, from the start of its array."""
        if isinstance(offset, int):
            return INTEGER(offset * self.width)
        return offset if self.width == 1 else self.b.mul(offset, INTEGER(self.width))

    def copy(self, target, source, size: int):
        """Copy numbers; the two do not overlap."""
        copy(self.b, target, source, size * self.width)

    def constant(self, name: str, values: np.ndarray, k):
        """Entry of a constant array: an integer, or a double."""
        return self.b.load(self.b.gep(constant_array(self.writer.module, name, values), [INTEGER(0), k]))

    def call(self, function: Function | NativeFunction, given, found):
        """Call a function."""
        apart = INTEGER(self.width)
        self.b.call(self.writer.body(function, self.width), [given, apart, found, apart])

    def inline(self, function: Function, *given) -> list:
        """Outputs of a traced function of numbers, inlined here."""
        lanes = Lanes(self.writer.module, self.width, self.b)  # its table of sines belongs to one function
        found: dict[int, ir.Value] = {}
        straight_line(lanes, schedule(function), given.__getitem__, found.__setitem__, vectorise=False)
        return [lanes.number(found[k]) for k in range(len(function.outputs))]

    def each(self, count: int) -> Iterator:
        """Write ``for`` a loop over the whole numbers below a count; unrolled for a batch, which runs for long."""
        if self.is_batch:
            yield from map(INTEGER, range(count))
            return
        with counted_loop(self.b, INTEGER(0), INTEGER(count)) as k:
            yield k

    def shifted(self, k, by: int):
        """Index k + ``by``."""
        return INTEGER(k.constant + by) if isinstance(k, ir.Constant) else self.b.add(k, INTEGER(by))

    def reduced(self, count: int, start: ir.Value, following: Callable) -> ir.Value:
        """Value after ``value = following(k, value)`` for the whole numbers k below a count."""
        if self.is_batch:
            return reduce(lambda total, k: following(INTEGER(k), total), range(count), start)
        return reduced(self.b, INTEGER(0), INTEGER(count), start, following)

    def sum_of_squares(self, count: int, numerators, denominators) -> ir.Value:
        """Sum of the squares of quotients of entries of two arrays."""

        def following(k, total):
            quotient = self.b.fdiv(self.number(numerators, k), self.number(denominators, k))
            return self.motions.fused("fma", quotient, quotient, total)

        return self.reduced(count, self.motions.constant(0.0), following)

    def done(self) -> ir.Function:
        """End the function."""
        self.buffers.free()
        self.b.ret_void()
        return self.function


@dataclass(frozen=True, eq=False)
class RowFunction(NativeFunction):
    """Function whose code is loops over arrays.

    Parameters
    ----------
    name : str
        Name in the code.
    n_in, n_out : int
        Numbers of inputs and of outputs.
    emit : callable
        RowCode → None: emits its body.
    """

    name: str
    n_in: int
    n_out: int
    emit: Callable[[RowCode], None]

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return self.n_in, self.n_out

    def operations(self) -> dict[str, int]:
        """None are counted: loops over entries are little beside the functions that they call."""
        return {}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code for one motion, or for one per SIMD lane."""
        code = RowCode(writer, self.begin(writer.module), width)
        self.emit(code)
        return code.done()


class SingleRowFunction(RowFunction):
    """The same where loops end by the numbers of one motion: it has no code for several at a time."""

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code for one motion."""
        code = RowCode(writer, self.begin_scalar(writer.module, width), width)
        self.emit(code)
        return code.done()


def reduced(b: ir.IRBuilder, first, end, start: ir.Value, following: Callable) -> ir.Value:
    """Value after ``value = following(k, value)`` for the whole numbers k from ``first`` to ``end − 1``."""
    before, (head, inside, after) = b.block, (b.function.append_basic_block(name) for name in ("sum", "term", "summed"))
    b.branch(head)
    b.position_at_end(head)
    k, total = b.phi(INTEGER), b.phi(start.type)
    k.add_incoming(first, before)
    total.add_incoming(start, before)
    b.cbranch(b.icmp_signed("<", k, end), inside, after)
    b.position_at_end(inside)
    total.add_incoming(following(k, total), b.block)
    k.add_incoming(b.add(k, INTEGER(1)), b.block)
    b.branch(head)
    b.position_at_end(after)
    return total
