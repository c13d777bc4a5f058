"""Python interface of a compiled loop."""

import ctypes
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from gauss.codegen import Function, NativeFunction, Writer, machine
from gauss.codegen.kernels.loop_control import Control, Numbers
from gauss.codegen.python_callback import HOLDING
from gauss.codegen.tiers import EntryPoint

FLOAT = np.dtype(float)
BYTE = ctypes.c_char
POINTERS = ("control", "point", "confirmed", "grid", "out")


class Loop:
    """Compiled loop, called with the arrays ``POINTERS`` and a budget of steps.

    Parameters
    ----------
    writer : Writer
        Writer of its module.
    name : str
        Its name there.
    functions : sequence of Function
        Functions of the loop that can also be called by name, see :meth:`evaluate`.
    """

    prototype: Callable = staticmethod(ctypes.CFUNCTYPE)

    def __init__(self, writer: Writer, name: str, functions: Sequence[Function | NativeFunction]):
        for function in functions:
            writer.export(function, function.name)
        self.__setstate__((machine.load(str(writer.module)), name, {f.name: f.arity for f in functions}))

    def __getstate__(self) -> tuple:
        return self.code, self.name, self.arities

    def __setstate__(self, state: tuple):
        self.code, self.name, self.arities = state
        single = self.prototype(None, ctypes.c_void_p, ctypes.c_void_p)
        self._single = {name: (self.code.entry(name, single), *arity) for name, arity in self.arities.items()}
        pointers = [ctypes.c_void_p] * len(POINTERS)
        self._run = self.code.entry(self.name, self.prototype(None, *pointers, ctypes.c_int64))

    def __call__(self, control: Control, point, confirmed, grid, out, budget: int):
        """Run to the end, or until the budget is used up; it changes ``control`` and all arrays except ``grid``.

        ValueError if an array is not a contiguous one of doubles.
        """
        self._run.call(ctypes.byref(control), *_addresses((point, confirmed, grid, out)), budget)

    @cached_property
    def calling(self) -> "CallingLoop":
        """The same loop, whose functions may call Python."""
        return CallingLoop(self)

    @property
    def entry(self) -> EntryPoint:
        """Machine code of the loop: (control, point, confirmed, grid, out, budget), all but the last by address."""
        return self._run

    def function(self, name: str) -> EntryPoint:
        """Machine code of one of the functions: (inputs, outputs), by address."""
        return self._single[name][0]

    def evaluate(self, name: str, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n_out,) of one of the functions for inputs (n_in,).

        Raises
        ------
        ValueError
            If the number of inputs is wrong.
        """
        function, n_in, n_out = self._single[name]
        given, found = np.ascontiguousarray(inputs, dtype=float), np.empty(n_out)
        if given.shape != (n_in,):
            raise ValueError(f"{name}: expected ({n_in},) inputs, got shape {given.shape}.")
        function.call(address(given), address(found))
        return found


class CallingLoop(Loop):
    """Compiled loop whose functions call Python, see :mod:`gauss.codegen.python_callback`.

    Parameters
    ----------
    loop : Loop
        Machine code of the loop.
    """

    prototype = staticmethod(HOLDING)

    def __init__(self, loop: Loop):
        self.__setstate__(loop.__getstate__())


class BatchLoop(machine.CodeCaller):
    """Base of compiled loops over a batch of motions, one per SIMD lane.

    Parameters
    ----------
    writer : Writer
        Writer of the module.
    name : str
        Name of the loop.
    control : type
        Record type of its first argument.
    arrays : int
        Number of further arguments.
    width : int
        Number of lanes.
    """

    def __init__(self, writer: Writer, name: str, control: type[Numbers], arrays: int, width: int):
        self.width, self.code = width, machine.load(str(writer.module), optimise=2)  # runs for long
        self.name, self.control, self.arrays = name, control, arrays
        self._bind()

    def _bind(self):
        signature = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * (1 + self.arrays), ctypes.c_int64)
        self._run = self.code.entry(self.name, signature)

    def _call(self, control: Numbers, arrays: Sequence[np.ndarray], last: int):
        """Call the loop; arrays go by address: Ctrl-C while ctypes converts them would be another error.

        ValueError if an array is not a contiguous one of doubles.
        """
        self._run.call(ctypes.byref(control), *_addresses(arrays), last)


def _addresses(arrays: Sequence[np.ndarray]) -> list[int]:
    """Addresses of contiguous arrays of doubles."""
    for array in arrays:
        if (array.dtype is not FLOAT and array.dtype != FLOAT) or not array.flags.c_contiguous:
            raise ValueError(f"expected contiguous arrays of floats, got {array!r:.80}.")
    return list(map(address, arrays))


def address(array: np.ndarray) -> int:
    """Address of a contiguous array; through its buffer, a tenth of the time of ``array.ctypes``."""
    try:
        return ctypes.addressof(BYTE.from_buffer(array))  # type: ignore[arg-type]  # buffers have no type before Python 3.12
    except (TypeError, ValueError):
        if array.size and array.flags.writeable:  # it is not contiguous
            raise
        return array.ctypes.data
