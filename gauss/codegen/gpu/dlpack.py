"""Arrays of doubles handed to other libraries without a copy, by the DLPack protocol (github.com/dmlc/dlpack, version 0)."""

import ctypes

CPU, CUDA = 1, 2  # kinds of memory
DOUBLE = (2, 64, 1)  # float, bits, lanes
NAME = b"dltensor"


class _Device(ctypes.Structure):
    _fields_ = (("kind", ctypes.c_int32), ("number", ctypes.c_int32))


class _DataType(ctypes.Structure):
    _fields_ = (("code", ctypes.c_uint8), ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16))


class _Tensor(ctypes.Structure):
    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device", _Device),
        ("ndim", ctypes.c_int32),
        ("dtype", _DataType),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    )


class _Managed(ctypes.Structure):
    pass


_DELETER = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Managed))
_Managed._fields_ = (("tensor", _Tensor), ("context", ctypes.c_void_p), ("deleter", _DELETER))
_lent: dict[int, tuple] = {}  # what consumers still use, by the address of the tensor


@_DELETER
def _delete(managed):
    """Called by the consumer when it needs the array no longer."""
    _lent.pop(ctypes.addressof(managed.contents), None)


def _python(name: str, *kinds):
    """Function of Python's C interface, with a prototype of its own."""
    return ctypes.PYFUNCTYPE(*kinds)((name, ctypes.pythonapi))


_DESTRUCTOR = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)  # of a capsule
_new = _python("PyCapsule_New", ctypes.py_object, ctypes.c_void_p, ctypes.c_char_p, _DESTRUCTOR)
_is_valid = _python("PyCapsule_IsValid", ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p)
_pointer = _python("PyCapsule_GetPointer", ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)


@_DESTRUCTOR
def _release(own):
    """Destructor of a capsule: one that no consumer took still has its name, and its array is released."""
    if _is_valid(own, NAME):
        _lent.pop(_pointer(own, NAME), None)


def capsule(owner, pointer: int, shape: tuple[int, ...], kind: int, number: int):
    """Capsule of a contiguous array of doubles at an address, in a kind of memory (CPU or CUDA) of a device with a number.

    The owner of its memory lives as long as the consumer needs it.
    """
    shape_ = (ctypes.c_int64 * max(len(shape), 1))(*shape)
    tensor = _Tensor(pointer, _Device(kind, number), len(shape), _DataType(*DOUBLE), shape_, None, 0)
    managed = _Managed(tensor, None, _delete)
    address = ctypes.addressof(managed)
    _lent[address] = owner, shape_, managed
    return _new(address, NAME, _release)
