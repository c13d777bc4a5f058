"""A traced function as a built-in function of Python: its arguments are checked and read in machine code.

The machine code reads the fields of its array arguments (numpy's PyArrayObject_fields) and runs only if they are contiguous
vectors of doubles of the right length. Any other argument goes to :class:`PythonWrapper`, which converts it or raises; a
call whose results exceed their limits goes to another function with the same arguments. Where the memory layout of
CPython and numpy is unknown (:func:`gauss.codegen.cpython_layout.is_known`), :class:`PythonWrapper` serves every call.

The buffer protocol, which belongs to CPython's stable ABI, would read the same arguments without field offsets; it costs
0.115 µs more for three vectors and a result, a call of a double pendulum 0.185 µs instead of 0.07 µs.
"""

import ctypes
from collections.abc import Callable
from math import prod
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen import cpython_layout, machine
from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.lanes import DOUBLE, INTEGER
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.python_wrapper import Interface, PythonWrapper, Shape

FLAG, OBJECT = ir.IntType(32), ir.IntType(8).as_pointer()
CALL = ir.FunctionType(OBJECT, [OBJECT, OBJECT.as_pointer(), INTEGER, OBJECT])  # PyCFunctionFastWithKeywords


class _CtypesCall:
    """Machine code called through ctypes."""

    def __init__(self, code: machine.MachineCode, outputs: int):
        self.outputs, self.run = outputs, code.entry("single", ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p))

    def __call__(self, given: np.ndarray) -> np.ndarray:
        found = np.empty(self.outputs)
        self.run.call(given.ctypes.data, found.ctypes.data)
        return found


class _FastcallOwner(NamedTuple):
    """Owner of the objects that a built-in function refers to.

    It is a tuple: the garbage collector clears other objects in a cycle before it frees them, but the built-in function
    reads its definition last.
    """

    fallback: PythonWrapper  # its function holds the machine code
    definition: tuple[bytes, ...]
    entry: "_PythonEntry"

    def __reduce__(self):
        make, arguments = self.fallback.__reduce__()
        return _RemadeOwner, (make, arguments)


class _RemadeOwner:
    """Owner of a built-in function that was made again: pickle asks it for the function by its name."""

    def __init__(self, make: Callable, arguments: tuple):
        function = make(*arguments)
        setattr(self, function.__name__, function)


def made_from(function, make: Callable, *arguments):
    """The same compiled function, which pickle sends as what makes it: ``make(*arguments)`` in the other process."""
    wrapper = getattr(getattr(function, "__self__", None), "fallback", function)
    if isinstance(wrapper, PythonWrapper):
        wrapper.maker = make, arguments
    return function


class EntryCode(NamedTuple):
    """Machine code of a function and of its entry from Python.

    Attributes
    ----------
    code : MachineCode
        The code.
    outputs : int
        Number of results and limited quantities.
    """

    code: machine.MachineCode
    outputs: int


def entry_code(function: Function | NativeFunction, interface: Interface) -> EntryCode:
    """Machine code of a function for :func:`fastcall`.

    Parameters
    ----------
    function : Function or NativeFunction
        Its inputs are the vectors and the number, concatenated; its outputs are the results and the limited quantities.
    interface : Interface
        Arguments and limits.
    """
    writer = Writer()
    writer.export(function, "single")
    _EntryWriter(writer, function, interface).write()
    return EntryCode(machine.load(str(writer.module)), len(function.outputs))


def fastcall(
    entry: EntryCode,
    interface: Interface,
    over_limit: Callable,
    name: str,
    doc: str,
    batch: Callable[[], Callable] | None = None,
):
    """Built-in function ``name(*vectors, out=None, number=0.0)`` of compiled code.

    Parameters
    ----------
    entry : EntryCode
        Machine code.
    interface : Interface
        Arguments and limits.
    over_limit : callable
        Function of the same arguments, called where a limit is exceeded: its result or exception is the outcome.
    name, doc : str
        Name and docstring of the function.
    batch : callable, optional
        Maker of its code over rows of arrays, as of :class:`PythonWrapper`.

    Returns
    -------
    callable
        Returns ``out``, or new arrays. It raises :class:`gauss.errors.StateError` if an argument does not fit.
    """
    code, outputs = entry
    fallback = PythonWrapper(_CtypesCall(code, outputs), interface, outputs, over_limit, name, doc, batch)
    if not cpython_layout.is_known():
        return fallback
    called = _PythonEntry(cpython_layout.PinnedObjects(fallback, over_limit))
    address = called.filled(code.first_address)
    definition = cpython_layout.method_definition(name, address, f"{name}{interface.signature()}\n--\n\n{doc}")
    called.definition = definition[0]
    found = cpython_layout.new_builtin(_FastcallOwner(fallback, definition, called))
    code.add_user(called)
    return found


class _PythonEntry:
    """Function that Python calls: its address in a built-in function's definition, and the objects that it refers to."""

    def __init__(self, pinned: cpython_layout.PinnedObjects):
        self.pinned, self.definition = pinned, b""

    def filled(self, address_of: Callable[[str], int]) -> int:
        """Address of the function in machine code, whose table of addresses is filled."""
        ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_int64))(address_of("fill"))(self.pinned.addresses())
        return address_of("entry")

    def connect(self, engine):
        """Let Python call the function of other machine code from now on."""
        cpython_layout.redefine(self.definition, self.filled(engine.get_function_address))


class _EntryWriter:
    """Emitter of the function that Python calls.

    Addresses of Python's objects and functions lie in a table that each process fills.
    """

    def __init__(self, writer: Writer, function: Function | NativeFunction, interface: Interface):
        self.interface, self.sizes, module = interface, interface.sizes, writer.module
        self.shapes = interface.result_shapes(len(function.outputs))
        self.n_out = len(function.outputs) - len(interface.limits)
        self.body = writer.body(function)
        self.table = ir.GlobalVariable(module, ir.ArrayType(INTEGER, len(cpython_layout.TABLE_ENTRIES)), "table")
        self.table.linkage, self.table.initializer = "internal", ir.Constant(self.table.value_type, None)
        self._write_fill(module)
        self.entry = ir.Function(module, CALL, "entry")
        self.b = ir.IRBuilder(self.entry.append_basic_block("entry"))
        self.fallback, self.over_limit = (self.entry.append_basic_block(name) for name in ("fallback", "over_limit"))

    def _write_fill(self, module: ir.Module):
        fill = ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGER.as_pointer()]), "fill")
        b = ir.IRBuilder(fill.append_basic_block("entry"))
        for k in range(len(cpython_layout.TABLE_ENTRIES)):
            b.store(b.load(b.gep(fill.args[0], [INTEGER(k)])), b.gep(self.table, [INTEGER(0), INTEGER(k)]))
        b.ret_void()

    def write(self):
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
        found = b.alloca(DOUBLE, self.n_out + len(self.interface.limits))
        b.call(self.body, [numbers, INTEGER(1), found, INTEGER(1)])
        for k, limit in enumerate(self.interface.limits, start=self.n_out):
            within = b.fcmp_ordered("<=", b.load(b.gep(found, [INTEGER(k)])), ir.Constant(DOUBLE, limit))
            self._require(within, self.over_limit)
        b.ret(self._given_or_new(given, total, found))
        for name, block in (("fallback", self.fallback), ("over_limit", self.over_limit)):
            b.position_at_end(block)
            b.ret(b.call(self._pinned("vectorcall", CALL.as_pointer()), [self._pinned(name, OBJECT), given, count, names]))

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

    def _given_or_new(self, given, total, found):
        """Results with a reference for the caller: in the array that is given, or in new ones."""
        b, none, place = self.b, self._pinned("none", OBJECT), len(self.sizes)
        asked = b.icmp_signed(">", total, INTEGER(place))
        out = self._either(asked, lambda: b.load(b.gep(given, [INTEGER(place)])), lambda: none)
        is_given = b.icmp_unsigned("!=", out, none)
        if len(self.shapes) > 1:
            self._require(b.not_(is_given))
            return self._new_tuple(found)

        def taken():
            self._copy(self._data(out, self.shapes[0], cpython_layout.WRITEABLE_FLAGS), found, self.n_out)
            b.call(self._pinned("incref", ir.FunctionType(ir.VoidType(), [OBJECT]).as_pointer()), [out])
            return out

        return self._either(is_given, taken, lambda: self._new(self.shapes[0], found))

    def _new_tuple(self, found):
        """New tuple of new results."""
        b, place = self.b, 0
        parts = []
        for shape in self.shapes:
            parts.append(self._new(shape, b.gep(found, [INTEGER(place)])))
            place += prod(shape)
        made = b.call(self._pinned("new_tuple", ir.FunctionType(OBJECT, [INTEGER]).as_pointer()), [INTEGER(len(parts))])
        self._end_if_null(made)
        keep = self._pinned("set_item", ir.FunctionType(FLAG, [OBJECT, INTEGER, OBJECT]).as_pointer())
        for k, part in enumerate(parts):
            b.call(keep, [made, INTEGER(k), part])  # which takes the reference
        return made

    def _new(self, shape: Shape, found):
        """New array with the results, or a new number; if there is no memory, the call ends with the error of its maker."""
        b, nothing, zero = self.b, ir.Constant(OBJECT, None), FLAG(0)
        if not shape:
            made = b.call(self._pinned("new_float", ir.FunctionType(OBJECT, [DOUBLE]).as_pointer()), [b.load(found)])
            self._end_if_null(made)
            return made
        with b.goto_entry_block():
            lengths = b.alloca(INTEGER, len(shape))
        for k, size in enumerate(shape):
            b.store(INTEGER(size), b.gep(lengths, [INTEGER(k)]))
        signature = [OBJECT, FLAG, INTEGER.as_pointer(), FLAG, OBJECT, OBJECT, FLAG, FLAG, OBJECT]
        make = self._pinned("new_array", ir.FunctionType(OBJECT, signature).as_pointer())
        kind, number = self._pinned("ndarray", OBJECT), FLAG(cpython_layout.NPY_DOUBLE)
        array = b.call(make, [kind, FLAG(len(shape)), lengths, number, nothing, nothing, zero, zero, nothing])
        self._end_if_null(array)
        self._copy(self._field(array, cpython_layout.ARRAY_OFFSETS["data"], DOUBLE.as_pointer()), found, prod(shape))
        return array

    def _end_if_null(self, made):
        """Return null to Python where an object could not be made."""
        nothing = ir.Constant(OBJECT, None)
        with self.b.if_then(self.b.icmp_unsigned("==", made, nothing), likely=False):
            self.b.ret(nothing)
