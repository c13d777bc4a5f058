"""Calls of LAPACK from machine code; the library is the one of SciPy."""

from llvmlite import ir

from gauss.codegen import POINTER, external
from gauss.codegen.linking import symbol

WHOLE = ir.IntType(32).as_pointer()  # LAPACK takes all arguments by reference; its integers have 32 bits
LETTER = ir.IntType(8).as_pointer()
KINDS = {
    "dgeqp3": [WHOLE, WHOLE, POINTER, WHOLE, WHOLE, POINTER, POINTER, WHOLE, WHOLE],
    "dgelsy": [WHOLE, WHOLE, WHOLE, POINTER, WHOLE, POINTER, WHOLE, WHOLE, POINTER, WHOLE, POINTER, WHOLE, WHOLE],
    "dgetrf": [WHOLE, WHOLE, POINTER, WHOLE, WHOLE, WHOLE],
    "dgetrs": [LETTER, WHOLE, WHOLE, POINTER, WHOLE, WHOLE, POINTER, WHOLE, WHOLE],
}


def lapack_routine(module: ir.Module, name: str) -> ir.Function:
    """Declare a routine of SciPy's LAPACK in a module."""
    return external(module, symbol(name), ir.VoidType(), KINDS[name])
