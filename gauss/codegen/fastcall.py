"""A traced function that Python calls with arrays as cheaply as a function of its own: checked and run in machine code.

The machine code reads the fields of the arrays that it is given (numpy's PyArrayObject_fields); it runs only if all of them
are just what it takes. Whatever else it is given goes to :class:`PythonWrapper`, which converts it or says what is wrong.
A call
whose results are off their limits is passed on to another function as it is. Where interpreter and numpy are not known to
keep their objects in this form, there is only :class:`PythonWrapper`.
"""

import ctypes
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from llvmlite import ir

from gauss.codegen import cpython_layout as interpreter
from gauss.codegen import machine
from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.kernel import SIGNATURE
from gauss.codegen.lanes import DOUBLE, INTEGER
from gauss.codegen.python_wrapper import Interface, PythonWrapper

FLAG, OBJECT = ir.IntType(32), ir.IntType(8).as_pointer()
CALL = ir.FunctionType(OBJECT, [OBJECT, OBJECT.as_pointer(), INTEGER, OBJECT])  # of METH_FASTCALL | METH_KEYWORDS


class _Run:
    """Machine code called through ctypes."""

    def __init__(self, code: machine.Code, outputs: int):
        self.code, self.outputs, self._run = code, outputs, SIGNATURE(code.address("run"))

    def __call__(self, given: np.ndarray) -> np.ndarray:
        found = np.empty(self.outputs)
        self._run(1, given.ctypes.data, 1, found.ctypes.data, 1)
        return found


class Compiled(NamedTuple):
    """What the machine code of one function needs; the function keeps it alive.

    A tuple, for the collector of cycles empties other objects before they go, but the function looks at its definition last.
    """

    plain: PythonWrapper  # whose function holds the machine code
    definition: tuple[bytes, ...]
    known: interpreter.Objects

    def __reduce__(self):
        return self.plain.__reduce__()


def fastcall(function: Function, interface: Interface, otherwise: Callable, name: str, doc: str):
    """Function of Python ``name(*vectors, out=None, number=0.0)``, compiled.

    Parameters
    ----------
    function : Function
        Its inputs are the vectors and the number, one after the other; its outputs are the results and what is limited.
    interface : Interface
        What the function of Python takes, and what limits there are.
    otherwise : callable
        A function that is called like this one, and called where a limit is exceeded: what it returns or raises is the
        outcome.
    name, doc : str
        What the function is called, and its documentation.

    Returns
    -------
    callable
        Returns ``out``, or a new array (n_out,). It raises :class:`gauss.errors.StateError` if an argument does not fit.
    """
    writer = Writer()
    writer.over_states(function, ())
    _Entry(writer, function, interface).write()
    code = machine.load(str(writer.module))
    plain = PythonWrapper(_Run(code, len(function.outputs)), interface, len(function.outputs), otherwise, name, doc)
    if not interpreter.is_known():
        return plain
    known = interpreter.Objects(plain, otherwise)
    fill = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_int64))(code.address("fill"))
    fill(known.addresses())
    definition = interpreter.define(name, code.address("entry"), f"{name}{interface.signature()}\n--\n\n{doc}")
    return interpreter.make(Compiled(plain, definition, known))


class _Entry:
    """The function that Python calls, while it is written.

    Addresses of Python's objects and functions are kept in a table that is filled in each process.
    """

    def __init__(self, writer: Writer, function: Function, interface: Interface):
        self.interface, self.sizes, module = interface, interface.sizes, writer.module
        self.n_out = len(function.outputs) - len(interface.limits)
        self.body = writer.body(function)
        self.table = ir.GlobalVariable(module, ir.ArrayType(INTEGER, len(interpreter.NAMES)), "table")
        self.table.linkage, self.table.initializer = "internal", ir.Constant(self.table.value_type, None)
        self._write_fill(module)
        self.entry = ir.Function(module, CALL, "entry")
        self.b = ir.IRBuilder(self.entry.append_basic_block("entry"))
        self.plain, self.otherwise = (self.entry.append_basic_block(name) for name in ("plain", "otherwise"))

    def _write_fill(self, module: ir.Module):
        fill = ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGER.as_pointer()]), "fill")
        b = ir.IRBuilder(fill.append_basic_block("entry"))
        for k in range(len(interpreter.NAMES)):
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
            data = self._data(b.load(b.gep(given, [INTEGER(k)])), size, interpreter.READABLE)
            self._copy(b.gep(numbers, [INTEGER(place)]), data, size)
            place += size
        self._number(given, total, b.gep(numbers, [INTEGER(place)]))
        found = b.alloca(DOUBLE, self.n_out + len(self.interface.limits))
        b.call(self.body, [numbers, INTEGER(1), found, INTEGER(1)])
        for k, limit in enumerate(self.interface.limits, start=self.n_out):
            within = b.fcmp_ordered("<=", b.load(b.gep(found, [INTEGER(k)])), ir.Constant(DOUBLE, limit))
            self._require(within, self.otherwise)
        out, data = self._given_or_new(given, total)
        self._copy(data, found, self.n_out)
        b.ret(out)
        for name, block in (("plain", self.plain), ("otherwise", self.otherwise)):
            b.position_at_end(block)
            b.ret(b.call(self._known("vectorcall", CALL.as_pointer()), [self._known(name, OBJECT), given, count, names]))

    def _known(self, name: str, kind: ir.Type):
        """Address from the table."""
        entry = self.b.gep(self.table, [INTEGER(0), INTEGER(interpreter.NAMES.index(name))])
        return self.b.inttoptr(self.b.load(entry), kind)

    def _copy(self, target, source, size: int):
        pointers = [self.b.bitcast(pointer, OBJECT) for pointer in (target, source)]
        copy = self.b.module.declare_intrinsic("llvm.memcpy", [OBJECT, OBJECT, INTEGER])
        self.b.call(copy, [*pointers, INTEGER(8 * size), ir.IntType(1)(0)])

    def _require(self, condition, if_not=None):
        """Go on if a condition holds; leave the call to another function if not, the plain one unless another is named."""
        on = self.entry.append_basic_block("on")
        self.b.cbranch(condition, on, if_not or self.plain)
        self.b.position_at_end(on)

    def _either(self, condition, one, other):
        """Value of one of two branches."""
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
        """Number of arguments, of which one may be given by name: ``out``, right after the vectors."""
        b = self.b

        def named():
            size = self._known("tuple_size", ir.FunctionType(INTEGER, [OBJECT]).as_pointer())
            item = self._known("tuple_item", ir.FunctionType(OBJECT, [OBJECT, INTEGER]).as_pointer())
            self._require(b.icmp_signed("==", b.call(size, [names]), INTEGER(1)))
            self._require(b.icmp_unsigned("==", b.call(item, [names, INTEGER(0)]), self._known("out", OBJECT)))
            self._require(b.icmp_signed("==", count, INTEGER(len(self.sizes))))
            return b.add(count, INTEGER(1))

        return self._either(b.icmp_unsigned("!=", names, ir.Constant(OBJECT, None)), named, lambda: count)

    def _field(self, thing, offset: int, kind: ir.Type):
        place = self.b.gep(thing, [INTEGER(offset)])
        return self.b.load(self.b.bitcast(place, kind.as_pointer()))

    def _is(self, thing, kind: str):
        """Whether an object is of just this type."""
        return self.b.icmp_unsigned("==", self._field(thing, interpreter.TYPE, OBJECT), self._known(kind, OBJECT))

    def _data(self, thing, size: int, flags: tuple[int, int]):
        """Numbers of what is required to be an array of so many doubles; flags: those looked at, those that must be set."""
        b, at = self.b, interpreter.ARRAY
        self._require(self._is(thing, "ndarray"))
        self._require(b.icmp_unsigned("==", self._field(thing, at["descr"], OBJECT), self._known("double", OBJECT)))
        self._require(b.icmp_signed("==", self._field(thing, at["nd"], FLAG), FLAG(1)))
        length = b.load(self._field(thing, at["dimensions"], INTEGER.as_pointer()))
        self._require(b.icmp_signed("==", length, INTEGER(size)))
        looked_at, needed = flags
        found = b.and_(self._field(thing, at["flags"], FLAG), FLAG(looked_at))
        self._require(b.icmp_unsigned("==", found, FLAG(needed)))
        return self._field(thing, at["data"], DOUBLE.as_pointer())

    def _number(self, given, total, target):
        """Store the number that may come after ``out``."""
        b, place = self.b, len(self.sizes) + 1

        def value():
            number = b.load(b.gep(given, [INTEGER(place)]))
            self._require(self._is(number, "float"))
            return b.call(self._known("float_value", ir.FunctionType(DOUBLE, [OBJECT]).as_pointer()), [number])

        has_number = b.icmp_signed(">", total, INTEGER(place))
        b.store(self._either(has_number, value, lambda: ir.Constant(DOUBLE, 0.0)), target)

    def _given_or_new(self, given, total):
        """Array for the results, with a reference for the caller, and its numbers."""
        b, none, place = self.b, self._known("none", OBJECT), len(self.sizes)
        asked = b.icmp_signed(">", total, INTEGER(place))
        out = self._either(asked, lambda: b.load(b.gep(given, [INTEGER(place)])), lambda: none)

        def taken():
            self._data(out, self.n_out, interpreter.WRITEABLE)
            b.call(self._known("incref", ir.FunctionType(ir.VoidType(), [OBJECT]).as_pointer()), [out])
            return out

        array = self._either(b.icmp_unsigned("!=", out, none), taken, self._new)
        return array, self._field(array, interpreter.ARRAY["data"], DOUBLE.as_pointer())

    def _new(self):
        """Array from numpy; without memory for it the call ends with numpy's error."""
        b, nothing, zero = self.b, ir.Constant(OBJECT, None), FLAG(0)
        with b.goto_entry_block():
            length = b.alloca(INTEGER)
        b.store(INTEGER(self.n_out), length)
        signature = [OBJECT, FLAG, INTEGER.as_pointer(), FLAG, OBJECT, OBJECT, FLAG, FLAG, OBJECT]
        make = self._known("new_array", ir.FunctionType(OBJECT, signature).as_pointer())
        kind, number = self._known("ndarray", OBJECT), FLAG(interpreter.DOUBLE)
        array = b.call(make, [kind, FLAG(1), length, number, nothing, nothing, zero, zero, nothing])
        with b.if_then(b.icmp_unsigned("==", array, nothing), likely=False):
            b.ret(nothing)
        return array
