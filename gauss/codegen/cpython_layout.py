"""Binary layout of CPython's and numpy's objects: field offsets and addresses from which machine code reads arrays.

Layouts: CPython's object.h (a reference count and a type, 16 bytes, in builds with the global lock) and methodobject.h;
numpy's ndarraytypes.h (PyArrayObject_fields) and C-API table, which its ABI version guarantees. :func:`is_known` checks
them on example arrays once in each process, before any code relies on them.
"""

import ctypes
import pickle
import struct
import sys
from functools import cache

import numpy as np

PINNED = "ndarray", "float", "none", "out", "fallback", "over_limit"  # objects in the address table
FUNCTIONS = {
    "vectorcall": "PyObject_Vectorcall",
    "tuple_size": "PyTuple_Size",
    "tuple_item": "PyTuple_GetItem",
    "float_value": "PyFloat_AsDouble",
    "incref": "Py_IncRef",
    "new_float": "PyFloat_FromDouble",
    "new_tuple": "PyTuple_New",
    "set_item": "PyTuple_SetItem",
}  # functions of Python there
TABLE_ENTRIES = (*PINNED, *FUNCTIONS, "new_array")  # names of the entries of the address table
TYPE_OFFSET = 8  # offset of ob_type in PyObject
ARRAY_OFFSETS = {"data": 16, "nd": 24, "dimensions": 32, "descr": 56, "flags": 64}  # offsets of the fields of PyArrayObject
CONTIGUOUS, ALIGNED, CAN_BE_WRITTEN, WARNS = 0x0001, 0x0100, 0x0400, 1 << 31  # numpy's flags of an array
READABLE_FLAGS = (CONTIGUOUS | ALIGNED,) * 2  # mask, and value required under it
WRITEABLE_FLAGS = (CONTIGUOUS | ALIGNED | CAN_BE_WRITTEN | WARNS, CONTIGUOUS | ALIGNED | CAN_BE_WRITTEN)
NPY_DOUBLE = 12  # numpy's type number of double
TYPE_WORD_OFFSET = 24  # offset, in PyArray_Descr, of 8 bytes: kind, character, byte order, a flag of numpy 1, type number
PYARRAY_NEW = 93  # index of PyArray_New in numpy's C-API table
NUMPY_ABI = (0x01000009, 0x02000000)  # of numpy 1 and 2
FASTCALL, KEYWORDS = 0x0080, 0x0002  # calling convention: METH_FASTCALL, METH_KEYWORDS
NEWEST_CPYTHON = (3, 14)  # newest CPython whose headers agree with these offsets


class PinnedObjects:
    """Objects whose addresses machine code holds; this reference keeps them alive.

    Parameters
    ----------
    fallback, over_limit : callable
        Called for arguments that the machine code does not accept, and for results above their limits.
    """

    def __init__(self, fallback, over_limit):
        self.pinned = np.ndarray, float, None, sys.intern("out"), fallback, over_limit

    def addresses(self) -> ctypes.Array:
        """Address table, in the order of ``TABLE_ENTRIES``."""
        functions = (_address_of(getattr(ctypes.pythonapi, name)) for name in FUNCTIONS.values())
        found = *map(id, self.pinned), *functions, _numpy_table()[PYARRAY_NEW]
        return (ctypes.c_int64 * len(TABLE_ENTRIES))(*found)


@cache
def is_known() -> bool:
    """Whether objects of this interpreter and this numpy have the layout that the machine code reads."""
    if sys.implementation.name != "cpython" or sys.version_info[:2] > NEWEST_CPYTHON or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    if object.__basicsize__ != 16:  # free-threaded build, or one with Py_TRACE_REFS
        return False
    try:
        version = ctypes.PYFUNCTYPE(ctypes.c_uint)(_numpy_table()[0])()
    except AttributeError:
        return False
    return (
        version in NUMPY_ABI
        and all(_is_as_expected(array) for array in _examples())
        and all(_has_type_word(dtype) for dtype in _example_types())
    )


def type_word(dtype: np.dtype) -> int:
    """Word at ``TYPE_WORD_OFFSET`` that tells a scalar type: equal for equal types, as their addresses are not.

    A type that was read from a pickle is another object than ``numpy.dtype(float)``.
    """
    fields = dtype.kind.encode(), dtype.char.encode(), dtype.byteorder.encode(), b"\0", dtype.num
    return struct.unpack("@q", struct.pack("@cccci", *fields))[0]


def method_definition(name: str, address: int, doc: str) -> tuple[bytes, bytes, bytes]:
    """CPython's PyMethodDef of a function in machine code (METH_FASTCALL | METH_KEYWORDS), and the strings it refers to."""
    texts = name.encode(), doc.encode()
    return struct.pack("@PPiP", _address(texts[0]), address, FASTCALL | KEYWORDS, _address(texts[1])), *texts


def redefine(definition: bytes, address: int):
    """Let a definition name another function: CPython reads its address at each call."""
    ctypes.c_void_p.from_address(_address(definition) + struct.calcsize("@P")).value = address


def new_builtin(owner):
    """Built-in function by the definition of its owner, to which it holds a reference."""
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.argtypes, new.restype = [ctypes.c_void_p, ctypes.py_object, ctypes.py_object], ctypes.py_object
    return new(_address(owner.definition[0]), owner, __name__)


def _address(text: bytes) -> int:
    return _address_of(ctypes.c_char_p(text))


def _address_of(pointer) -> int:
    """Address in a pointer of ctypes that is not null."""
    return ctypes.cast(pointer, ctypes.c_void_p).value or 0


def _numpy_table():
    """C-API table of numpy."""
    core = sys.modules.get("numpy._core._multiarray_umath") or sys.modules["numpy.core._multiarray_umath"]
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.argtypes, pointer.restype = [ctypes.py_object, ctypes.c_char_p], ctypes.c_void_p
    return ctypes.cast(pointer(core._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p))


def _examples() -> list[np.ndarray]:
    frozen = np.arange(5.0)
    frozen.flags.writeable = False
    return [np.arange(3.0), np.arange(12).reshape(3, 4)[:, ::2], frozen, np.zeros((), dtype=complex)]


def _example_types() -> list[np.dtype]:
    copied = pickle.loads(pickle.dumps(np.dtype(float)))
    return [np.dtype(float), copied, np.dtype(np.float32), np.dtype(float).newbyteorder(), np.dtype(complex), np.dtype(int)]


def _has_type_word(dtype: np.dtype) -> bool:
    """Whether a scalar type has its :func:`type_word` at ``TYPE_WORD_OFFSET``."""
    return ctypes.c_int64.from_address(id(dtype) + TYPE_WORD_OFFSET).value == type_word(dtype)


def _is_as_expected(array: np.ndarray) -> bool:
    """Whether the fields of an array lie at ``ARRAY_OFFSETS``."""
    read = lambda field, kind: kind.from_address(id(array) + ARRAY_OFFSETS[field]).value  # noqa: E731
    shape = (ctypes.c_int64 * array.ndim).from_address(read("dimensions", ctypes.c_void_p)) if array.ndim else ()
    return (
        ctypes.c_void_p.from_address(id(array) + TYPE_OFFSET).value == id(np.ndarray)
        and read("data", ctypes.c_void_p) == array.ctypes.data
        and read("nd", ctypes.c_int) == array.ndim
        and tuple(shape) == array.shape
        and read("descr", ctypes.c_void_p) == id(array.dtype)
        and read("flags", ctypes.c_int) == array.flags.num
    )
