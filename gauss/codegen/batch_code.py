"""A function over rows of arrays: states (n, …) in, results (n, …) out, a SIMD vector of states at a time.

Rows of any stride are transposed to structures of arrays in a buffer, the body runs once for as many states as the vector
register holds, or for a block of vectors, and its results are transposed back. The last vector repeats the last row, so no
scalar code is needed.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen import machine, processor
from gauss.codegen.emit import SHORTEST_OF_ROWS, STATES_PER_BLOCK, StateBlocks, Writer, has_blocks, vectors_of
from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import POINTER, Buffers, counted_loop
from gauss.codegen.ir_module import DOUBLE, INTEGER, LANE, joined_numbers, lane_indices
from gauss.codegen.lanes import kind
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.python_wrapper import Interface

SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p)


class BatchCode(NamedTuple):
    """Machine code of a function over rows."""

    code: machine.MachineCode

    def entry(self) -> "BatchEntry":
        """The function, to be called."""
        return BatchEntry(self.code)


class BatchEntry:
    """Function over rows of arrays."""

    def __init__(self, code: machine.MachineCode):
        self._run = code.entry("batch", SIGNATURE)

    def __call__(self, count: int, inputs, outputs):
        """Evaluate ``count`` rows.

        Parameters
        ----------
        count : int
            Number of rows.
        inputs : sequence of ndarray
            Vectors (count, k) of doubles with any strides, and numbers (count,).
        outputs : sequence of ndarray
            Results (count, k), entries of a row contiguous.
        """
        table = [x for given in inputs for x in (given.ctypes.data, *(stride // 8 for stride in given.strides))]
        table += [x for result in outputs for x in (result.ctypes.data, result.strides[0] // 8)]
        self._run.call(count, np.array(table, dtype=np.int64).ctypes.data)


def batch_code(function: Function | NativeFunction, interface: Interface) -> BatchCode:
    """Machine code over rows of a function as of :func:`gauss.codegen.entry_code`."""
    writer, width = Writer(), processor.width()
    try:
        called = writer.block(function, width) if has_blocks(function, SHORTEST_OF_ROWS) else writer.body(function, width)
    except TypeError:  # it holds a function for one state at a time
        writer, width = Writer(), 1
        called = writer.body(function, width)
    _BatchWriter(writer, called, width).write(interface.sizes, interface.result_sizes(len(function.outputs)))
    return BatchCode(machine.load(str(writer.module)))


class _BatchWriter:
    """Emitter of ``batch(i64 count, i64* table)``: the table holds address, row stride and entry stride of the arrays."""

    def __init__(self, writer: Writer, called: ir.Function | StateBlocks, width: int):
        self.width, self.called = width, called
        self.states = STATES_PER_BLOCK if isinstance(called, StateBlocks) else width  # side by side in a buffer
        self.function = ir.Function(writer.module, ir.FunctionType(ir.VoidType(), [INTEGER, INTEGER.as_pointer()]), "batch")
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.read = 0  # entries of the table that were read

    def write(self, sizes, result_sizes):
        """Write the function for the sizes of its vectors and of its results."""
        b, width, (count, _) = self.b, self.width, self.function.args
        sources = [self._entries(3) for _ in sizes] + [self._entries(2)]
        targets = [self._entries(2) for _ in result_sizes]
        buffers, called = Buffers(b), self.called
        given, found = (
            b.bitcast(buffers.room(DOUBLE, n * self.states, align=64), POINTER)
            for n in (sum(sizes) + 1, max(sum(result_sizes), 1))
        )
        frame = called.frame(buffers) if isinstance(called, StateBlocks) else None
        apart, last = INTEGER(self.states), b.sub(count, INTEGER(1))
        with counted_loop(b, INTEGER(0), count, self.states) as first:
            vectors = vectors_of(b, b.sub(count, first), width) if frame else INTEGER(1)
            with self._vectors(first, vectors, last) as (rows, lane):
                place = 0
                for (data, row, *entry), size in zip(sources, [*sizes, 1], strict=True):
                    stride, target = entry[0] if entry else INTEGER(0), b.gep(given, [lane])
                    self._gather(self._rows(data, row, rows), stride, size, target, place)
                    place += size
            if isinstance(called, StateBlocks):
                b.call(called.code, [given, apart, found, apart, frame, vectors])
            else:
                b.call(called, [given, apart, found, apart])
            with self._vectors(first, vectors, last) as (rows, lane):
                place = 0
                for (data, row), size in zip(targets, result_sizes, strict=True):
                    self._scatter(self._rows(data, row, rows), size, b.gep(found, [lane]), place)
                    place += size
        buffers.free()
        b.ret_void()

    @contextmanager
    def _vectors(self, first, vectors, last) -> Iterator[tuple[list, ir.Value]]:
        """Loop over vectors of states; the context is its body, and gives the rows of its lanes, and its first lane."""
        b, width = self.b, self.width
        with counted_loop(b, INTEGER(0), vectors) as k:
            lane = b.mul(k, INTEGER(width))
            steps = [b.add(b.add(first, lane), INTEGER(i)) for i in range(width)]
            yield [b.select(b.icmp_signed("<", step, last), step, last) for step in steps], lane

    def _entries(self, count: int) -> list:
        """Load the next entries of the table; the first is an address."""
        b, table = self.b, self.function.args[1]
        found = [b.load(b.gep(table, [INTEGER(self.read + k)])) for k in range(count)]
        self.read += count
        return [b.inttoptr(found[0], POINTER), *found[1:]]

    def _rows(self, data, stride, rows) -> list:
        return [self.b.gep(data, [self.b.mul(row, stride)]) for row in rows]

    def _gather(self, rows, stride, size: int, target, place: int):
        """Entries of the rows, to vectors of lanes: blocks of contiguous ones are transposed in registers."""
        b = self.b
        if self.width == 1 or size < self.width:
            self._gather_entries(rows, stride, size, target, place)
            return
        with b.if_else(b.icmp_signed("==", stride, INTEGER(1))) as (contiguous, strided):
            with contiguous:
                for k in self._blocks(size):
                    block = self._transposed([self._load(row, k) for row in rows])
                    for i, vector in enumerate(block):
                        self._store(vector, target, self._offset(b.add(k, INTEGER(i)), place))
            with strided:
                self._gather_entries(rows, stride, size, target, place)

    def _gather_entries(self, rows, stride, size: int, target, place: int):
        """Entries of the rows, one after the other, to vectors of lanes."""
        b = self.b
        with counted_loop(b, INTEGER(0), INTEGER(size)) as k:
            offset = b.mul(k, stride)
            values = [b.load(b.gep(row, [offset])) for row in rows]
            self._store(joined_numbers(b, values), target, self._offset(k, place))

    def _scatter(self, rows, size: int, source, place: int):
        """Vectors of lanes, to entries of the rows: blocks are transposed in registers."""
        b, width = self.b, self.width
        if 1 < width <= size:
            for k in self._blocks(size):
                block = [self._load(source, self._offset(b.add(k, INTEGER(i)), place)) for i in range(width)]
                for row, vector in zip(rows, self._transposed(block), strict=True):
                    self._store(vector, row, k)
            return
        with counted_loop(b, INTEGER(0), INTEGER(size)) as k:
            vector = self._load(source, self._offset(k, place))
            for lane, row in enumerate(rows):
                b.store(vector if width == 1 else b.extract_element(vector, LANE(lane)), b.gep(row, [k]))

    def _blocks(self, size: int) -> Iterator:
        """First entries of blocks that cover ``size`` entries, in a loop; the last block overlaps the one before."""
        width = self.width
        with counted_loop(self.b, INTEGER(0), INTEGER(size - size % width), width) as k:
            yield k
        if size % width:
            yield INTEGER(size - width)

    def _offset(self, k, place: int):
        """Place of the states of an entry in a buffer."""
        return self.b.mul(self.b.add(k, INTEGER(place)), INTEGER(self.states))

    def _transposed(self, block: list) -> list:
        """Transpose a square block: in step s entries whose places differ in bit s change sides."""
        width, step = self.width, 1
        while step < width:
            pairs, found = [i for i in range(width) if not i & step], list(block)
            low = [j if not j & step else width + j - step for j in range(width)]
            high = [j + step if not j & step else width + j for j in range(width)]
            for i in pairs:
                one, other = block[i], block[i + step]
                found[i], found[i + step] = (self.b.shuffle_vector(one, other, lane_indices(order)) for order in (low, high))
            block, step = found, 2 * step
        return block

    def _load(self, pointer, offset):
        place = self.b.gep(pointer, [offset])
        return self.b.load(self.b.bitcast(place, kind(self.width).as_pointer()), align=8)

    def _store(self, vector, pointer, offset):
        place = self.b.gep(pointer, [offset])
        self.b.store(vector, self.b.bitcast(place, kind(self.width).as_pointer()), align=8)
