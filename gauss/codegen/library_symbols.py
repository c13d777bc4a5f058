"""Routines of SciPy's LAPACK, and Python itself, that machine code calls by name.

Their addresses are those of this process: they are registered whenever object code that calls them is linked, made here or
read from the disk.
"""

import ctypes
import re
import sys
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, FileFinder
from importlib.util import module_from_spec
from pathlib import Path
from threading import Lock
from types import ModuleType

import llvmlite.binding as llvm

PREFIX = "gauss_lapack_"
CALLBACK = b"gauss_python_callback"  # see :mod:`gauss.codegen.python_callback`
LAPACK = "scipy.linalg.cython_lapack"
SYMBOL = re.compile(rb"gauss_lapack_([a-z0-9]+)")

_loading = Lock()


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
    capsule = _lapack().__pyx_capi__[routine]
    name_of, pointer_of = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    llvm.add_symbol(symbol(routine), pointer_of(capsule, name_of(capsule)))


def _lapack() -> ModuleType:
    """SciPy's table of LAPACK routines, loaded without scipy.linalg, whose import takes a sixth of a second."""
    with _loading:
        if LAPACK in sys.modules or "scipy.linalg" in sys.modules:
            return import_module(LAPACK)
        import scipy

        folder = Path(scipy.__file__).parent / "linalg"
        spec = FileFinder(str(folder), (ExtensionFileLoader, EXTENSION_SUFFIXES)).find_spec(LAPACK)
        if spec is None or spec.loader is None:
            return import_module(LAPACK)
        sys.modules[LAPACK] = found = module_from_spec(spec)
        try:
            spec.loader.exec_module(found)
        except BaseException:
            del sys.modules[LAPACK]
            raise
        return found
