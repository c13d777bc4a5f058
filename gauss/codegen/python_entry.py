"""Machine code that Python calls: it reads arrays, runs a function on their numbers, and returns arrays of its results."""

from collections.abc import Callable
from itertools import accumulate
from math import prod

import numpy as np
from llvmlite import ir

from gauss.codegen import cpython_layout
from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.ir_module import DOUBLE, INTEGER
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.python_wrapper import Interface, Shape

FLAG, OBJECT = ir.IntType(32), ir.IntType(8).as_pointer()
CALL = ir.FunctionType(OBJECT, [OBJECT, OBJECT.as_pointer(), INTEGER, OBJECT])  # PyCFunctionFastWithKeywords


class EntryWriter:
    """Emitter of the function that Python calls.

    Addresses of Python's objects and functions lie in a table that each process fills.
    """

    def __init__(self, writer: Writer, function: Function | NativeFunction, interface: Interface):
        self.interface, self.sizes, module = interface, interface.sizes, writer.module
        self.shapes = interface.result_shapes(len(function.outputs))
        self.n_out = len(function.outputs) - len(interface.limits)
        self.results, self.limited = self._divided(writer, function)
        self.table = ir.GlobalVariable(module, ir.ArrayType(INTEGER, len(cpython_layout.TABLE_ENTRIES)), "table")
        self.table.linkage, self.table.initializer = "internal", ir.Constant(self.table.value_type, None)
        self._write_fill(module)
        self.entry = ir.Function(module, CALL, "entry")
        self.b = ir.IRBuilder(self.entry.append_basic_block("entry"))
        self.fallback, self.over_limit = (self.entry.append_basic_block(name) for name in ("fallback", "over_limit"))

    def _divided(self, writer: Writer, function: Function | NativeFunction) -> tuple[ir.Function, ir.Function | None]:
        """Code of the results, and of the limited quantities where a single array of results is written in its place.

        For this, results may not be written before the limits are known to hold. Writes ``single(double* in, double* out)``.
        """
        is_array = len(self.shapes) == 1 and bool(self.shapes[0])
        parts: tuple[Function | NativeFunction, ...] = (function,)
        if self.interface.limits and is_array and isinstance(function, Function):
            parts = writer.divided(function, self.n_out) or parts
        writer.export(parts[0], "single", *parts[1:])
        return writer.body(parts[0]), writer.body(parts[1]) if len(parts) > 1 else None

    def _write_fill(self, module: ir.Module):
        fill = ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGER.as_pointer()]), "fill")
        b = ir.IRBuilder(fill.append_basic_block("entry"))
        for k in range(len(cpython_layout.TABLE_ENTRIES)):
            b.store(b.load(b.gep(fill.args[0], [INTEGER(k)])), b.gep(self.table, [INTEGER(0), INTEGER(k)]))
        b.ret_void()

    def write(self):
        """Write ``entry(self, arguments, count, names)``, to be called by Python."""
        b, sizes = self.b, self.sizes
        _, given, count, names = self.entry.args
        numbers, last = b.alloca(DOUBLE, sum(sizes) + 1), len(sizes)
        total = self._total(count, names)
        self._require(b.icmp_signed(">=", total, INTEGER(last)))
        self._require(b.icmp_signed("<=", total, INTEGER(last + 2)))
        place = 0
        for k, size in enumerate(sizes):
            data = self._data(b.load(b.gep(given, [INTEGER(k)])), (size,), cpython_layout.READABLE_FLAGS)
            self._copy(b.gep(numbers, [INTEGER(place)]), data, size)
            place += size
        self._number(given, total, b.gep(numbers, [INTEGER(place)]))
        b.ret(self._given_or_new(given, total, self._within_limits(numbers)))
        for name, block in (("fallback", self.fallback), ("over_limit", self.over_limit)):
            b.position_at_end(block)
            b.ret(b.call(self._pinned("vectorcall", CALL.as_pointer()), [self._pinned(name, OBJECT), given, count, names]))

    def _within_limits(self, numbers) -> Callable[[int, ir.Value], None]:
        """Require that limits hold; the function writes a result to the place of its numbers."""
        b, limits, stride = self.b, self.interface.limits, INTEGER(1)
        whole = self.limited is None
        found = b.alloca(DOUBLE, len(limits) + (self.n_out if whole else 0))
        b.call(self.limited or self.results, [numbers, stride, found, stride])
        for k, limit in enumerate(limits, start=self.n_out if whole else 0):
            within = b.fcmp_ordered("<=", b.load(b.gep(found, [INTEGER(k)])), ir.Constant(DOUBLE, limit))
            self._require(within, self.over_limit)
        starts = [0, *accumulate(map(prod, self.shapes))]

        def put(k: int, target):
            if whole:
                self._copy(target, b.gep(found, [INTEGER(starts[k])]), prod(self.shapes[k]))
            else:
                b.call(self.results, [numbers, stride, target, stride])

        return put

    def _pinned(self, name: str, kind: ir.Type):
        """Load an address from the table."""
        entry = self.b.gep(self.table, [INTEGER(0), INTEGER(cpython_layout.TABLE_ENTRIES.index(name))])
        return self.b.inttoptr(self.b.load(entry), kind)

    def _copy(self, target, source, size: int):
        pointers = [self.b.bitcast(pointer, OBJECT) for pointer in (target, source)]
        copy = self.b.module.declare_intrinsic("llvm.memcpy", [OBJECT, OBJECT, INTEGER])
        self.b.call(copy, [*pointers, INTEGER(8 * size), ir.IntType(1)(0)])

    def _require(self, condition, if_not=None):
        """Continue if a condition holds; else branch to a block, that of the fallback by default."""
        on = self.entry.append_basic_block("on")
        self.b.cbranch(condition, on, if_not or self.fallback)
        self.b.position_at_end(on)

    def _either(self, condition, one, other):
        """Value of one of two branches, joined by a phi."""
        values = []
        with self.b.if_else(condition) as branches:
            for branch, make in zip(branches, (one, other), strict=True):
                with branch:
                    values.append((make(), self.b.block))
        merged = self.b.phi(values[0][0].type)
        for value in values:
            merged.add_incoming(*value)
        return merged

    def _total(self, count, names):
        """Number of arguments; only ``out``, right after the vectors, may be given by name."""
        b = self.b

        def named():
            size = self._pinned("tuple_size", ir.FunctionType(INTEGER, [OBJECT]).as_pointer())
            item = self._pinned("tuple_item", ir.FunctionType(OBJECT, [OBJECT, INTEGER]).as_pointer())
            self._require(b.icmp_signed("==", b.call(size, [names]), INTEGER(1)))
            self._require(b.icmp_unsigned("==", b.call(item, [names, INTEGER(0)]), self._pinned("out", OBJECT)))
            self._require(b.icmp_signed("==", count, INTEGER(len(self.sizes))))
            return b.add(count, INTEGER(1))

        return self._either(b.icmp_unsigned("!=", names, ir.Constant(OBJECT, None)), named, lambda: count)

    def _field(self, thing, offset: int, kind: ir.Type):
        place = self.b.gep(thing, [INTEGER(offset)])
        return self.b.load(self.b.bitcast(place, kind.as_pointer()))

    def _is(self, thing, kind: str):
        """Whether an object is of exactly this type."""
        return self.b.icmp_unsigned("==", self._field(thing, cpython_layout.TYPE_OFFSET, OBJECT), self._pinned(kind, OBJECT))

    def _data(self, thing, shape: Shape, flags: tuple[int, int]):
        """Data of an argument, required to be an array of doubles; flags: mask, and value required under it."""
        b, at = self.b, cpython_layout.ARRAY_OFFSETS
        self._require(self._is(thing, "ndarray"))
        word = self._field(self._field(thing, at["descr"], OBJECT), cpython_layout.TYPE_WORD_OFFSET, INTEGER)
        self._require(b.icmp_signed("==", word, INTEGER(cpython_layout.type_word(np.dtype(float)))))
        self._require(b.icmp_signed("==", self._field(thing, at["nd"], FLAG), FLAG(len(shape))))
        for k, size in enumerate(shape):
            length = b.load(b.gep(self._field(thing, at["dimensions"], INTEGER.as_pointer()), [INTEGER(k)]))
            self._require(b.icmp_signed("==", length, INTEGER(size)))
        looked_at, needed = flags
        found = b.and_(self._field(thing, at["flags"], FLAG), FLAG(looked_at))
        self._require(b.icmp_unsigned("==", found, FLAG(needed)))
        return self._field(thing, at["data"], DOUBLE.as_pointer())

    def _number(self, given, total, target):
        """Store the optional number, the argument after ``out``."""
        b, place = self.b, len(self.sizes) + 1

        def value():
            number = b.load(b.gep(given, [INTEGER(place)]))
            self._require(self._is(number, "float"))
            return b.call(self._pinned("float_value", ir.FunctionType(DOUBLE, [OBJECT]).as_pointer()), [number])

        has_number = b.icmp_signed(">", total, INTEGER(place))
        b.store(self._either(has_number, value, lambda: ir.Constant(DOUBLE, 0.0)), target)

    def _given_or_new(self, given, total, put):
        """Results with a reference for the caller: in the array that is given, or in new ones."""
        b, none, place = self.b, self._pinned("none", OBJECT), len(self.sizes)
        asked = b.icmp_signed(">", total, INTEGER(place))
        out = self._either(asked, lambda: b.load(b.gep(given, [INTEGER(place)])), lambda: none)
        is_given = b.icmp_unsigned("!=", out, none)
        if len(self.shapes) > 1:
            self._require(b.not_(is_given))
            return self._new_tuple(put)

        def taken():
            put(0, self._data(out, self.shapes[0], cpython_layout.WRITEABLE_FLAGS))
            self._incref(out)
            return out

        return self._either(is_given, taken, lambda: self._new(0, put))

    def _new_tuple(self, put):
        """New tuple of new results."""
        b = self.b
        parts = [self._new(k, put) for k in range(len(self.shapes))]
        made = b.call(self._pinned("new_tuple", ir.FunctionType(OBJECT, [INTEGER]).as_pointer()), [INTEGER(len(parts))])
        self._end_if_null(made)
        keep = self._pinned("set_item", ir.FunctionType(FLAG, [OBJECT, INTEGER, OBJECT]).as_pointer())
        for k, part in enumerate(parts):
            b.call(keep, [made, INTEGER(k), part])  # which takes the reference
        return made

    def _new(self, k: int, put):
        """Array with result k, or a new number; if there is no memory, the call ends with the error of its maker."""
        b = self.b
        if not self.shapes[k]:
            with b.goto_entry_block():
                number = b.alloca(DOUBLE)
            put(k, number)
            made = b.call(self._pinned("new_float", ir.FunctionType(OBJECT, [DOUBLE]).as_pointer()), [b.load(number)])
            self._end_if_null(made)
            return made
        array = self._made(self.shapes[k])
        put(k, self._field(array, cpython_layout.ARRAY_OFFSETS["data"], DOUBLE.as_pointer()))
        return array

    def _made(self, shape: Shape):
        """New array."""
        b, nothing, zero = self.b, ir.Constant(OBJECT, None), FLAG(0)
        with b.goto_entry_block():
            lengths = b.alloca(INTEGER, len(shape))
        for k, size in enumerate(shape):
            b.store(INTEGER(size), b.gep(lengths, [INTEGER(k)]))
        signature = [OBJECT, FLAG, INTEGER.as_pointer(), FLAG, OBJECT, OBJECT, FLAG, FLAG, OBJECT]
        make = self._pinned("new_array", ir.FunctionType(OBJECT, signature).as_pointer())
        kind, number = self._pinned("ndarray", OBJECT), FLAG(cpython_layout.NPY_DOUBLE)
        array = b.call(make, [kind, FLAG(len(shape)), lengths, number, nothing, nothing, zero, zero, nothing])
        self._end_if_null(array)
        return array

    def _incref(self, thing):
        self.b.call(self._pinned("incref", ir.FunctionType(ir.VoidType(), [OBJECT]).as_pointer()), [thing])

    def _end_if_null(self, made):
        """Return null to Python where an object could not be made."""
        nothing = ir.Constant(OBJECT, None)
        with self.b.if_then(self.b.icmp_unsigned("==", made, nothing), likely=False):
            self.b.ret(nothing)
