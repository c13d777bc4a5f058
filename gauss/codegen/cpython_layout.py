"""What machine code must know of CPython and numpy to take arrays from Python: where fields lie, what is at which address.

Layouts: CPython's object.h (a reference count and a type, 16 bytes, in builds with the global lock) and methodobject.h;
numpy's ndarraytypes.h (PyArrayObject_fields) and C-API table, which its ABI version guarantees. They are looked at once in
each process before they are relied upon.
"""

import ctypes
import struct
import sys
from functools import cache

import numpy as np

NAMES = (
    "ndarray",
    "double",
    "float",
    "none",
    "out",
    "plain",
    "otherwise",
    "vectorcall",
    "tuple_size",
    "tuple_item",
    "float_value",
    "incref",
    "new_array",
)  # of the table of addresses
TYPE = 8  # offset of the type of any object
ARRAY = {"data": 16, "nd": 24, "dimensions": 32, "descr": 56, "flags": 64}  # offsets of the fields of an array
CONTIGUOUS, ALIGNED, CAN_BE_WRITTEN, WARNS = 0x0001, 0x0100, 0x0400, 1 << 31  # flags of an array
READABLE = (CONTIGUOUS | ALIGNED,) * 2  # flags looked at, and those of them that must be set
WRITEABLE = (CONTIGUOUS | ALIGNED | CAN_BE_WRITTEN | WARNS, CONTIGUOUS | ALIGNED | CAN_BE_WRITTEN)
DOUBLE = 12  # numpy's number of the type
NEW_ARRAY = 93  # place of PyArray_New in numpy's table
NUMPY_ABI = (0x01000009, 0x02000000)  # of numpy 1 and 2
FASTCALL, KEYWORDS = 0x0080, 0x0002  # how a function takes its arguments
NEWEST = (3, 14)  # CPython whose headers were read


class Objects:
    """Objects whose addresses machine code holds, kept alive.

    Parameters
    ----------
    plain, otherwise : callable
        Called for what the machine code does not take, and for what it cannot answer.
    """

    def __init__(self, plain, otherwise):
        self.kept = {"ndarray": np.ndarray, "double": np.dtype(float), "float": float, "none": None}
        self.kept |= {"out": sys.intern("out"), "plain": plain, "otherwise": otherwise}

    def addresses(self) -> ctypes.Array:
        """Table in the order of ``NAMES``."""
        functions = {
            "vectorcall": "PyObject_Vectorcall",
            "tuple_size": "PyTuple_Size",
            "tuple_item": "PyTuple_GetItem",
            "float_value": "PyFloat_AsDouble",
            "incref": "Py_IncRef",
        }
        found = {name: id(kept) for name, kept in self.kept.items()}
        for name, function in functions.items():
            found[name] = ctypes.cast(getattr(ctypes.pythonapi, function), ctypes.c_void_p).value
        found["new_array"] = _numpy_table()[NEW_ARRAY]
        return (ctypes.c_int64 * len(NAMES))(*(found[name] for name in NAMES))


@cache
def is_known() -> bool:
    """Whether this interpreter and this numpy keep their objects as the machine code reads them."""
    if sys.implementation.name != "cpython" or sys.version_info[:2] > NEWEST or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    if object.__basicsize__ != 16:  # a build without the global lock, or one that traces references
        return False
    try:
        version = ctypes.PYFUNCTYPE(ctypes.c_uint)(_numpy_table()[0])()
    except AttributeError:
        return False
    return version in NUMPY_ABI and all(_is_as_expected(array) for array in _examples())


def define(name: str, address: int, doc: str) -> tuple[bytes, bytes, bytes]:
    """CPython's PyMethodDef of a function in machine code, called with METH_FASTCALL | METH_KEYWORDS, and its texts."""
    texts = name.encode(), doc.encode()
    return struct.pack("@PPiP", _place(texts[0]), address, FASTCALL | KEYWORDS, _place(texts[1])), *texts


def make(owner):
    """Function of Python by the definition of its owner, whom it keeps alive."""
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.argtypes, new.restype = [ctypes.c_void_p, ctypes.py_object, ctypes.py_object], ctypes.py_object
    return new(_place(owner.definition[0]), owner, __name__)


def _place(text: bytes) -> int:
    return ctypes.cast(ctypes.c_char_p(text), ctypes.c_void_p).value


def _numpy_table():
    """C functions of numpy, in their order."""
    core = sys.modules.get("numpy._core._multiarray_umath") or sys.modules["numpy.core._multiarray_umath"]
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.argtypes, pointer.restype = [ctypes.py_object, ctypes.c_char_p], ctypes.c_void_p
    return ctypes.cast(pointer(core._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p))


def _examples() -> list[np.ndarray]:
    frozen = np.arange(5.0)
    frozen.flags.writeable = False
    return [np.arange(3.0), np.arange(12).reshape(3, 4)[:, ::2], frozen, np.zeros((), dtype=complex)]


def _is_as_expected(array: np.ndarray) -> bool:
    """Whether the fields of an array are where they should be."""
    read = lambda field, kind: kind.from_address(id(array) + ARRAY[field]).value  # noqa: E731
    shape = (ctypes.c_int64 * array.ndim).from_address(read("dimensions", ctypes.c_void_p)) if array.ndim else ()
    return (
        ctypes.c_void_p.from_address(id(array) + TYPE).value == id(np.ndarray)
        and read("data", ctypes.c_void_p) == array.ctypes.data
        and read("nd", ctypes.c_int) == array.ndim
        and tuple(shape) == array.shape
        and read("descr", ctypes.c_void_p) == id(array.dtype)
        and read("flags", ctypes.c_int) == array.flags.num
    )
