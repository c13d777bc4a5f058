"""Function bodies over structures of arrays, and loops, in LLVM IR."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache

import numpy as np
from llvmlite import ir

from gauss.codegen.ir_module import BYTES, DOUBLE, INTEGER, SingleDeviceModule, external
from gauss.codegen.lanes import Lanes
from gauss.codegen.recurrences import LINE
from gauss.codegen.single_lanes import SingleLanes
from gauss.codegen.text_builder import TextBuilder

POINTER = DOUBLE.as_pointer()
BODY = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
PAGE = 4096  # bytes
LARGEST_ON_STACK = 8192  # entries of a buffer; stacks of threads may be as small as 512 kB


def begin_function(module: ir.Module, name: str, width: int, kind: ir.FunctionType = BODY) -> tuple[ir.Function, Lanes]:
    """Begin a function of :data:`BODY`, of one block, for one vector width; its arrays do not overlap."""
    body = ir.Function(module, kind, name=name)
    body.linkage = "internal"
    for argument in body.args:
        if argument.type == POINTER:
            argument.add_attribute("noalias")
    b = TextBuilder(body.append_basic_block("entry"), is_only_block=True)
    if width > 1:
        _at_a_page(b)
    return body, SingleLanes(module, b) if isinstance(module, SingleDeviceModule) else Lanes(module, width, b)


def _at_a_page(b: ir.IRBuilder):
    """Align the stack frame of a function to a page.

    At other alignments its vectors are read and written up to a third slower.
    """
    room = b.alloca(ir.IntType(8))
    room.align = PAGE
    keep = ir.InlineAsm(ir.FunctionType(ir.VoidType(), [room.type]), "", "r", side_effect=True)  # against removal
    b.call(keep, [room])


class Buffers:
    """Buffers of a function: on its stack, large ones on the heap."""

    def __init__(self, b: ir.IRBuilder):
        self.b, self._on_heap = b, list[ir.Value]()

    def room(self, kind: ir.Type, size: int, align: int | None = None) -> ir.Value:
        """Buffer of ``size`` values of a kind, numbers or vectors, allocated in the entry block."""
        with self.b.goto_entry_block():
            if size > LARGEST_ON_STACK:
                return self._heap_room(kind, size)
            room = self.b.alloca(kind, max(size, 1))
        room.align = room.align if align is None else align
        return room

    def _heap_room(self, kind: ir.Type, size: int) -> ir.Value:
        b, module = self.b, self.b.function.module
        bytes_ = 8 * size * getattr(kind, "count", 1) + LINE
        raw = b.call(external(module, "malloc", BYTES, [INTEGER]), [INTEGER(bytes_)])
        self._on_heap.append(raw)
        first = b.and_(b.add(b.ptrtoint(raw, INTEGER), INTEGER(LINE - 1)), INTEGER(-LINE))
        return b.inttoptr(first, kind.as_pointer())

    def free(self):
        """Free those on the heap, at the end of the function."""
        for raw in self._on_heap:
            self.b.call(external(self.b.function.module, "free", ir.VoidType(), [BYTES]), [raw])


def constant_array(module: ir.Module, name: str, values: np.ndarray) -> ir.GlobalVariable:
    """Constant array of a module, of doubles or of integers; one for each name."""
    known = module.globals.get(name)
    if known is None:
        entry, number = (INTEGER, int) if values.dtype.kind == "i" else (DOUBLE, float)
        known = ir.GlobalVariable(module, ir.ArrayType(entry, len(values)), name)
        known.initializer = ir.Constant(known.value_type, [number(value) for value in values])
        known.global_constant, known.linkage = True, "internal"
    return known


def strides(body: ir.Function, width: int, strided: bool) -> tuple:
    """Input pointer, input stride, output pointer and output stride of a body; strides are those given, or the width."""
    source, in_stride, target, out_stride = body.args[:4]
    return (source, in_stride, target, out_stride) if strided else (source, INTEGER(width), target, INTEGER(width))


def input_reader(lanes: Lanes, source, stride):
    """Function of k that loads input k of a body."""
    return lambda k: lanes.load(source, _offset(lanes, stride, k))


def output_writer(lanes: Lanes, target, stride):
    """Function of k and a value that stores output k of a body."""
    return lambda k, value: lanes.store(value, target, _offset(lanes, stride, k))


_integer = lru_cache(maxsize=4096)(INTEGER)  # constants, made once


def _offset(lanes: Lanes, stride, k: int):
    return _integer(stride.constant * k) if isinstance(stride, ir.Constant) else lanes.b.mul(stride, _integer(k))


def strip_mined_loop(b: ir.IRBuilder, start, count, width: int, body):
    """Write ``for (i = start; i + width <= count; i += width) body(i)``; return the final i."""
    before = b.block
    head, inside, after = (b.function.append_basic_block(f"{name}_{width}") for name in ("head", "inside", "after"))
    b.branch(head)
    b.position_at_end(head)
    i = b.phi(INTEGER)
    i.add_incoming(start, before)
    step = ir.Constant(INTEGER, width)
    b.cbranch(b.icmp_signed("<=", b.add(i, step), count), inside, after)
    b.position_at_end(inside)
    body(i)
    i.add_incoming(b.add(i, step), b.block)
    b.branch(head)
    b.position_at_end(after)
    return i


@contextmanager
def counted_loop(b: ir.IRBuilder, first, end, step: int = 1) -> Iterator[ir.Value]:
    """Write ``for (k = first; k < end; k += step)``; the context is its body, and gives k."""
    before = b.block
    head, inside, after = (b.function.append_basic_block(name) for name in ("head", "inside", "after"))
    b.branch(head)
    b.position_at_end(head)
    k = b.phi(INTEGER)
    k.add_incoming(first, before)
    b.cbranch(b.icmp_signed("<", k, end), inside, after)
    b.position_at_end(inside)
    yield k
    k.add_incoming(b.add(k, INTEGER(step)), b.block)
    b.branch(head)
    b.position_at_end(after)


@contextmanager
def endless_loop(b: ir.IRBuilder) -> Iterator[Callable[[ir.Value], None]]:
    """Write a loop; the context is its body, and gives a function that leaves it where a condition holds."""
    head, after = (b.function.append_basic_block(name) for name in ("loop", "after"))
    b.branch(head)
    b.position_at_end(head)

    def leave_if(condition: ir.Value):
        on = b.function.append_basic_block("on")
        b.cbranch(condition, after, on)
        b.position_at_end(on)

    yield leave_if
    b.branch(head)
    b.position_at_end(after)
