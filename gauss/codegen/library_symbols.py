"""Routines of SciPy's LAPACK, and Python itself, that machine code calls by name.

Their addresses are those of this process: they are registered whenever object code that calls them is linked, made here or
read from the disk.
"""

import ctypes
import re
from functools import cache

import llvmlite.binding as llvm

PREFIX = "gauss_lapack_"
CALLBACK = b"gauss_python_callback"  # see :mod:`gauss.codegen.python_callback`
SYMBOL = re.compile(rb"gauss_lapack_([a-z0-9]+)")


def symbol(routine: str) -> str:
    """Name of a routine in LLVM IR."""
    return PREFIX + routine


def register_symbols_of(objects: list[bytes]):
    """Register the addresses of the routines that object code calls with LLVM."""
    for content in objects:
        if CALLBACK in content:
            from gauss.codegen.python_callback import register_callback  # few modules need it

            register_callback()
        for routine in set(SYMBOL.findall(content)):
            _register(routine.decode())


@cache
def _register(routine: str):
    from scipy.linalg import cython_lapack  # imported on demand: most motions need no LAPACK

    capsule = cython_lapack.__pyx_capi__[routine]
    name_of, pointer_of = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    llvm.add_symbol(symbol(routine), pointer_of(capsule, name_of(capsule)))
