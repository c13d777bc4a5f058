"""Object code, made here or read from disk, → machine code in memory.

Machine code calls routines of SciPy's LAPACK, and Python itself, by name. Their addresses are those of this process: they
are registered whenever object code that calls them is linked.
"""

import ctypes
import gc
import re
import sys
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, FileFinder
from importlib.util import module_from_spec
from itertools import count
from pathlib import Path
from threading import Lock
from types import ModuleType

import llvmlite.binding as llvm

from gauss.codegen.processor import prepare_llvm

LINKS_PER_COLLECTION = 32  # modules linked between two collections, which take 30 ms
PREFIX = "gauss_lapack_"
CALLBACK = b"gauss_python_callback"  # see :mod:`gauss.codegen.python_callback`
LAPACK = "scipy.linalg.cython_lapack"
SYMBOL = re.compile(rb"gauss_lapack_([a-z0-9]+)")

_links = count(1)
_loading = Lock()


def linked(objects: list[bytes]) -> llvm.ExecutionEngine:
    """Machine code in memory, owned by the engine."""
    prepare_llvm()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, codemodel="jitdefault"
    )
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    _register_symbols_of(objects)
    for content in objects:
        engine.add_object_file(llvm.ObjectFileRef.from_data(content))
    engine.finalize_object()
    _collect_engines_that_are_gone()
    return engine


def _collect_engines_that_are_gone():
    """Collect garbage from time to time: few Python objects hold much machine code, and the collector counts objects."""
    if next(_links) % LINKS_PER_COLLECTION == 0 and gc.isenabled():
        gc.collect()


def symbol(routine: str) -> str:
    """Name of a routine in LLVM IR."""
    return PREFIX + routine


def _register_symbols_of(objects: list[bytes]):
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
