"""A traced function as a built-in function of Python: its arguments are checked and read in machine code.

The machine code reads the fields of its array arguments (numpy's PyArrayObject_fields) and runs only if they are contiguous
vectors of doubles of the right length. Any other argument goes to :class:`PythonWrapper`, which converts it or raises; a
call whose results exceed their limits goes to another function with the same arguments. Where the memory layout of
CPython and numpy is unknown (:func:`gauss.codegen.cpython_layout.is_known`), :class:`PythonWrapper` serves every call.

The buffer protocol, which belongs to CPython's stable ABI, would read the same arguments without field offsets; it costs
0.115 µs more for three vectors and a result, a call of a double pendulum 0.185 µs instead of 0.07 µs.
"""

import ctypes
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss.codegen import cpython_layout, machine
from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.python_entry import EntryWriter
from gauss.codegen.python_wrapper import Interface, PythonWrapper


class _CtypesCall:
    """Machine code called through ctypes."""

    def __init__(self, code: machine.MachineCode, outputs: int):
        self.outputs, self.run = outputs, code.entry("single", ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p))

    def __call__(self, given: np.ndarray) -> np.ndarray:
        found = np.empty(self.outputs)
        self.run.call(given.ctypes.data, found.ctypes.data)
        return found


class _FastcallOwner(NamedTuple):
    """Owner of the objects that a built-in function refers to.

    It is a tuple: the garbage collector clears other objects in a cycle before it frees them, but the built-in function
    reads its definition last.
    """

    fallback: PythonWrapper  # its function holds the machine code
    definition: tuple[bytes, ...]
    entry: "_PythonEntry"

    def __reduce__(self):
        make, arguments = self.fallback.__reduce__()
        return _RemadeOwner, (make, arguments)


class _RemadeOwner:
    """Owner of a built-in function that was made again: pickle asks it for the function by its name."""

    def __init__(self, make: Callable, arguments: tuple):
        function = make(*arguments)
        setattr(self, function.__name__, function)


def made_from(function, make: Callable, *arguments):
    """The same compiled function, which pickle sends as what makes it: ``make(*arguments)`` in the other process."""
    wrapper = getattr(getattr(function, "__self__", None), "fallback", function)
    if isinstance(wrapper, PythonWrapper):
        wrapper.maker = make, arguments
    return function


class EntryCode(NamedTuple):
    """Machine code of a function and of its entry from Python."""

    code: machine.MachineCode
    outputs: int  # number of results and limited quantities


def entry_code(function: Function | NativeFunction, interface: Interface) -> EntryCode:
    """Machine code of a function for :func:`fastcall`.

    Parameters
    ----------
    function : Function or NativeFunction
        Its inputs are the vectors and the number, concatenated; its outputs are the results and the limited quantities.
    interface : Interface
        Arguments and limits.
    """
    writer = Writer()
    EntryWriter(writer, function, interface).write()
    return EntryCode(machine.load(str(writer.module)), len(function.outputs))


def fastcall(
    entry: EntryCode,
    interface: Interface,
    over_limit: Callable,
    name: str,
    doc: str,
    batch: Callable[[], Callable] | None = None,
):
    """Built-in function ``name(*vectors, out=None, number=0.0)`` of compiled code.

    Parameters
    ----------
    entry : EntryCode
        Machine code.
    interface : Interface
        Arguments and limits.
    over_limit : callable
        Function of the same arguments, called where a limit is exceeded: its result or exception is the outcome.
    name, doc : str
        Name and docstring of the function.
    batch : callable, optional
        Maker of its code over rows of arrays, as of :class:`PythonWrapper`.

    Returns
    -------
    callable
        Returns ``out``, or new arrays. It raises :class:`gauss.errors.StateError` if an argument does not fit.
    """
    code, outputs = entry
    fallback = PythonWrapper(_CtypesCall(code, outputs), interface, outputs, over_limit, name, doc, batch)
    if not cpython_layout.is_known():
        return fallback
    called = _PythonEntry(cpython_layout.PinnedObjects(fallback, over_limit))
    address = called.filled(code.first_address)
    definition = cpython_layout.method_definition(name, address, f"{name}{interface.signature()}\n--\n\n{doc}")
    called.definition = definition[0]
    found = cpython_layout.new_builtin(_FastcallOwner(fallback, definition, called))
    code.add_user(called)
    return found


class _PythonEntry:
    """Function that Python calls: its address in a built-in function's definition, and the objects that it refers to."""

    def __init__(self, pinned: cpython_layout.PinnedObjects):
        self.pinned, self.definition = pinned, b""

    def filled(self, address_of: Callable[[str], int]) -> int:
        """Address of the function in machine code, whose table of addresses is filled."""
        ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_int64))(address_of("fill"))(self.pinned.addresses())
        return address_of("entry")

    def connect(self, engine):
        """Let Python call the function of other machine code from now on."""
        cpython_layout.redefine(self.definition, self.filled(engine.get_function_address))
