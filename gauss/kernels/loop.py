"""A compiled loop as Python calls it."""

import ctypes

import numpy as np

from gauss.kernels.control import Control
from gauss.tracing import Writer, machine

POINTERS = ("control", "point", "confirmed", "grid", "out")


class Loop:
    """Compiled loop of the arrays ``POINTERS`` and a budget of steps.

    Parameters
    ----------
    writer : Writer
        Module that holds it.
    name : str
        Its name there.
    """

    def __init__(self, writer: Writer, name: str):
        self.code = machine.load(str(writer.module))
        pointer = np.ctypeslib.ndpointer(float, flags=("C_CONTIGUOUS", "WRITEABLE"))
        self._function = ctypes.CFUNCTYPE(None, *[pointer] * len(POINTERS), ctypes.c_int64)(self.code.address(name))

    def __call__(self, control: Control, point, confirmed, grid, out, budget: int):
        """Run to the end, or until the budget is used up; ``control`` and all arrays but ``grid`` are changed."""
        packed = control.pack()
        self._function(packed, point, confirmed, grid, out, budget)
        control.update(packed)
