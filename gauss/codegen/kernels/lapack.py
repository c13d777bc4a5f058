"""Calls of LAPACK from machine code; the library is the one of SciPy."""

import ctypes
from functools import cache

import llvmlite.binding as llvm
from llvmlite import ir

from gauss.codegen import POINTER

WHOLE = ir.IntType(32).as_pointer()  # LAPACK takes all arguments by reference; its integers have 32 bits
LETTER = ir.IntType(8).as_pointer()
KINDS = {
    "dgeqp3": [WHOLE, WHOLE, POINTER, WHOLE, WHOLE, POINTER, POINTER, WHOLE, WHOLE],
    "dgelsy": [WHOLE, WHOLE, WHOLE, POINTER, WHOLE, POINTER, WHOLE, WHOLE, POINTER, WHOLE, POINTER, WHOLE, WHOLE],
    "dgetrf": [WHOLE, WHOLE, POINTER, WHOLE, WHOLE, WHOLE],
    "dgetrs": [LETTER, WHOLE, WHOLE, POINTER, WHOLE, WHOLE, POINTER, WHOLE, WHOLE],
}


def routine(module: ir.Module, name: str) -> ir.Function:
    """Declare a routine of SciPy's LAPACK in a module."""
    known = _registered(name)
    return module.globals.get(known) or ir.Function(module, ir.FunctionType(ir.VoidType(), KINDS[name]), known)


@cache
def _registered(name: str) -> str:
    """Register the address of a routine with LLVM; returns its symbol."""
    from scipy.linalg import cython_lapack  # imported on demand: most motions need no LAPACK

    capsule = cython_lapack.__pyx_capi__[name]
    name_of, pointer_of = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    llvm.add_symbol(f"gauss_{name}", pointer_of(capsule, name_of(capsule)))
    return f"gauss_{name}"
