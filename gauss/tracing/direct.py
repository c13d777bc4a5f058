"""A traced function that Python calls with arrays, with no Python in between.

The function is a built-in of CPython (``METH_FASTCALL``) in machine code: it looks at its arguments itself, copies them to
where the code wants them, and calls it. Arguments that are not what it knows, contiguous arrays of doubles of the right
length, go to a Python function that converts them or says what is wrong. Where the memory of an array is not laid out as
expected, in another Python or another numpy, every call goes there.
"""

import ctypes
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.tracing import machine
from gauss.tracing.emit import POINTER, Writer
from gauss.tracing.lanes import DOUBLE, INTEGER

FASTCALL = 0x0080  # METH_FASTCALL of CPython
# Offsets [bytes] in an object, and in an array of numpy (PyArrayObject_fields); a probe confirms them.
TYPE, DATA, RANK, SHAPE, KIND, FLAGS = 8, 16, 24, 32, 56, 64
READABLE, WRITEABLE = 0x0001 | 0x0100, 0x0001 | 0x0100 | 0x0400  # contiguous, aligned; and writeable
ARRAY, DOUBLES, OTHERWISE, CALL, RETAIN = range(5)  # places in the table that the function carries with it
BYTE, WORD, BYTES = ir.IntType(8), ir.IntType(32), ir.IntType(8).as_pointer()


class _Definition(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("code", ctypes.c_void_p), ("flags", ctypes.c_int), ("doc", ctypes.c_char_p)]


class _Table(np.ndarray):
    """Addresses that the function needs; it also keeps alive what these belong to."""


@dataclass(frozen=True)
class Signature:
    """Arguments of a function.

    Parameters
    ----------
    sizes : tuple of int
        Lengths of the arrays that are given.
    result : int
        Length of the array that is written and returned, the last argument.
    constants : tuple of float
        Inputs of the traced function after those that are given.
    """

    sizes: tuple[int, ...]
    result: int
    constants: tuple[float, ...] = ()


def direct(function, signature: Signature, otherwise: Callable, name: str, doc: str) -> Callable:
    """Callable ``name(*arrays, out) → out``.

    Parameters
    ----------
    function : Function
        What is computed.
    signature : Signature
        What it is called with.
    otherwise : callable
        Called with the same arguments when they are not contiguous arrays of doubles of the right length.
    name, doc : str
        Name and docstring.
    """
    if not _is_laid_out_as_expected():
        return otherwise
    writer = Writer()
    _write(writer, function, signature)
    code = machine.load(str(writer.module))
    python = ctypes.pythonapi
    addresses = {
        ARRAY: id(np.ndarray),
        DOUBLES: id(np.dtype(float)),
        OTHERWISE: id(otherwise),
        CALL: ctypes.cast(python.PyObject_Vectorcall, ctypes.c_void_p).value,
        RETAIN: ctypes.cast(python.Py_IncRef, ctypes.c_void_p).value,
    }
    table = np.array([addresses[place] for place in range(len(addresses))], dtype=np.int64).view(_Table)
    definition = _Definition(name.encode(), code.address("call"), FASTCALL, doc.encode())
    table.kept = (definition, code, otherwise)
    make = python.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    return make(ctypes.addressof(definition), table, None)


def _is_laid_out_as_expected() -> bool:
    """Whether this is CPython with its lock, and an array has its parts where they are looked for."""
    if sys.implementation.name != "cpython" or not getattr(sys, "_is_gil_enabled", lambda: True)():
        return False
    for probe in (np.zeros(3), np.zeros((2, 5), dtype=np.int16)[:, ::2]):
        read = lambda offset, kind, probe=probe: kind.from_address(id(probe) + offset).value  # noqa: E731
        found = (
            read(TYPE, ctypes.c_void_p),
            read(DATA, ctypes.c_void_p),
            read(RANK, ctypes.c_int),
            ctypes.c_ssize_t.from_address(read(SHAPE, ctypes.c_void_p)).value,
            read(KIND, ctypes.c_void_p),
            read(FLAGS, ctypes.c_int) & 0x0501,
        )
        flags = probe.flags.num & 0x0501
        if found != (id(np.ndarray), probe.ctypes.data, probe.ndim, probe.shape[0], id(probe.dtype), flags):
            return False
    return True


def _write(writer: Writer, function, signature: Signature):
    """Write ``call(self, args, count)``, as CPython calls a built-in."""
    body = writer.body(function, 1)
    kind = ir.FunctionType(BYTES, [BYTES, BYTES.as_pointer(), INTEGER])
    call = ir.Function(writer.module, kind, name="call")
    own, arguments, count = call.args
    b = ir.IRBuilder(call.append_basic_block("entry"))
    table = b.bitcast(_load(b, own, DATA, BYTES), INTEGER.as_pointer())
    entry = lambda place: b.load(b.gep(table, [INTEGER(place)]))  # noqa: E731
    declined = call.append_basic_block("declined")
    given = b.alloca(DOUBLE, len(function.inputs))
    found = b.alloca(DOUBLE, len(function.outputs))

    def require(condition):
        accepted = call.append_basic_block("accepted")
        b.cbranch(condition, accepted, declined)
        b.position_at_end(accepted)

    require(b.icmp_signed("==", count, INTEGER(len(signature.sizes) + 1)))
    sizes = [(size, READABLE) for size in signature.sizes] + [(signature.result, WRITEABLE)]
    arrays = [b.load(b.gep(arguments, [INTEGER(k)])) for k in range(len(sizes))]
    for array, (size, flags) in zip(arrays, sizes, strict=True):
        require(b.icmp_signed("==", _load(b, array, TYPE, INTEGER), entry(ARRAY)))
        is_vector = b.icmp_signed("==", _load(b, array, RANK, WORD), WORD(1))
        is_double = b.icmp_signed("==", _load(b, array, KIND, INTEGER), entry(DOUBLES))
        is_fit = b.icmp_signed("==", b.and_(_load(b, array, FLAGS, WORD), WORD(flags)), WORD(flags))
        require(b.and_(is_vector, b.and_(is_double, is_fit)))
        require(b.icmp_signed("==", b.load(_load(b, array, SHAPE, INTEGER.as_pointer())), INTEGER(size)))
    place = 0
    for array, size in zip(arrays, signature.sizes, strict=False):
        _copy(b, b.gep(given, [INTEGER(place)]), _load(b, array, DATA, POINTER), size)
        place += size
    for k, number in enumerate(signature.constants):
        b.store(ir.Constant(DOUBLE, float(number)), b.gep(given, [INTEGER(place + k)]))
    b.call(body, [given, INTEGER(1), found, INTEGER(1)])
    _copy(b, _load(b, arrays[-1], DATA, POINTER), found, signature.result)
    retain = b.inttoptr(entry(RETAIN), ir.FunctionType(ir.VoidType(), [BYTES]).as_pointer())
    b.call(retain, [arrays[-1]])
    b.ret(arrays[-1])
    b.position_at_end(declined)
    kind = ir.FunctionType(BYTES, [BYTES, BYTES.as_pointer(), INTEGER, BYTES])
    slowly = b.inttoptr(entry(CALL), kind.as_pointer())
    b.ret(b.call(slowly, [b.inttoptr(entry(OTHERWISE), BYTES), arguments, count, ir.Constant(BYTES, None)]))


def _load(b: ir.IRBuilder, pointer, offset: int, kind: ir.Type):
    return b.load(b.bitcast(b.gep(pointer, [INTEGER(offset)]), kind.as_pointer()))


def _copy(b: ir.IRBuilder, target, source, size: int):
    """Write a loop that copies numbers."""
    before = b.block
    head, inside, after = (b.function.append_basic_block(name) for name in ("head", "copy", "copied"))
    b.branch(head)
    b.position_at_end(head)
    k = b.phi(INTEGER)
    k.add_incoming(INTEGER(0), before)
    b.cbranch(b.icmp_signed("<", k, INTEGER(size)), inside, after)
    b.position_at_end(inside)
    b.store(b.load(b.gep(source, [k])), b.gep(target, [k]))
    k.add_incoming(b.add(k, INTEGER(1)), inside)
    b.branch(head)
    b.position_at_end(after)
