"""A traced function as machine code: numbers in, numbers out."""

import ctypes

import numpy as np

from gauss.tracing import machine
from gauss.tracing.emit import Writer
from gauss.tracing.function import Function, write

SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64)


class Kernel:
    """Compiled function of vectors.

    Parameters
    ----------
    function : Function
        What is computed.
    batch : bool
        Whether many states will be given at once: then SIMD code is made, too.

    Attributes
    ----------
    operations : dict
        Number of operations of each kind.
    """

    def __init__(self, function: Function, batch: bool = True):
        self.n_in, self.n_out = len(function.inputs), len(function.outputs)
        self.operations = function.operations()
        writer = Writer()
        writer.over_states(function, (machine.width(),) if batch else ())
        self.code = machine.load(str(writer.module))
        self._function = SIGNATURE(self.code.address("run"))

    def __call__(self, inputs) -> np.ndarray:
        """Outputs (n_out,) of inputs (n_in,), or (n_out, k) of k columns (n_in, k).

        Raises
        ------
        ValueError
            If the number of inputs is not that of the kernel.
        """
        given = np.ascontiguousarray(inputs, dtype=float)
        if given.ndim not in (1, 2) or given.shape[0] != self.n_in:
            raise ValueError(f"expected ({self.n_in},) or ({self.n_in}, k) inputs, got shape {given.shape}.")
        columns = given.shape[1] if given.ndim == 2 else 1
        result = np.empty((self.n_out, *given.shape[1:]))
        self._function(columns, given.ctypes.data, columns, result.ctypes.data, columns)
        return result


def trace(function, *sizes: int, batch: bool = True) -> Kernel:
    """Kernel of a Python function of vectors; see :func:`gauss.tracing.write`."""
    return Kernel(write(function, *sizes), batch)
