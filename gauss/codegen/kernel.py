"""A traced function as machine code: arrays of doubles in, arrays of doubles out."""

import ctypes

import numpy as np

from gauss.codegen import machine, processor
from gauss.codegen.emit import Writer
from gauss.codegen.function import Function, write
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.python_callback import HOLDING

ARGUMENTS = ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64
SIGNATURE, HOLDING_SIGNATURE = ctypes.CFUNCTYPE(None, *ARGUMENTS), HOLDING(None, *ARGUMENTS)


class Kernel(machine.CodeCaller):
    """Compiled function of vectors.

    Parameters
    ----------
    function : Function or NativeFunction
        Traced function, or one that emits its own code.
    batch : bool
        Whether many states will be given at once: SIMD code is then compiled as well.

    Attributes
    ----------
    operations : dict
        Number of operations of each kind.
    """

    signature = SIGNATURE

    def __init__(self, function: Function | NativeFunction, batch: bool = True):
        self.n_in, self.n_out = len(function.inputs), len(function.outputs)
        self.operations = function.operations()
        writer = Writer()
        writer.over_states(function, (processor.width(),) if batch else ())
        self.code = machine.load(str(writer.module))
        self._bind()

    def _bind(self):
        self._run = self.code.entry("run", self.signature)

    def address(self) -> int:
        """Address of ``run(i64 count, double* in, i64 in_stride, double* out, i64 out_stride)``, in the present tier."""
        return self._run.address()

    def at(self, given: int, found: int):
        """Evaluate one state: inputs and outputs are contiguous doubles at these addresses, and do not overlap."""
        self._run.call(1, given, 1, found, 1)

    def __call__(self, inputs, out=None) -> np.ndarray:
        """Outputs (n_out,) of inputs (n_in,), or (n_out, k) of k columns (n_in, k).

        Parameters
        ----------
        inputs : array_like
            Inputs. Rows that are contiguous are used where they are.
        out : ndarray, optional
            Destination: doubles of the shape of the outputs, contiguous rows, no overlap with the inputs. A new array
            when not given.

        Raises
        ------
        ValueError
            If the number of inputs is not that of the kernel, or ``out`` does not fit or shares memory with the inputs.
        """
        given = np.asarray(inputs, dtype=float)
        if given.ndim not in (1, 2) or given.shape[0] != self.n_in:
            raise ValueError(f"expected ({self.n_in},) or ({self.n_in}, k) inputs, got shape {given.shape}.")
        given = given if _has_rows(given) else np.ascontiguousarray(given)
        result = np.empty((self.n_out, *given.shape[1:])) if out is None else out
        if out is not None:
            _check_target(out, (self.n_out, *given.shape[1:]), given)
        columns = given.shape[1] if given.ndim == 2 else 1
        self._run.call(columns, given.ctypes.data, given.strides[0] // 8, result.ctypes.data, result.strides[0] // 8)
        return result


class CallingKernel(Kernel):
    """Compiled function that calls Python, within a :class:`gauss.codegen.Receiver`."""

    signature = HOLDING_SIGNATURE


def _has_rows(array: np.ndarray) -> bool:
    """Whether the rows of an array are contiguous, and a whole number of entries apart."""
    return array.strides[-1] == array.itemsize and array.strides[0] % array.itemsize == 0 if array.ndim == 2 else True


def _check_target(out, shape: tuple, given: np.ndarray):
    fits = isinstance(out, np.ndarray) and out.dtype == float and out.shape == shape and _has_rows(out)
    if not fits or not out.flags.writeable:
        raise ValueError(
            f"out: expected a writeable array of floats of shape {shape} with contiguous rows, got {out!r:.80}."
        )
    if np.may_share_memory(out, given):
        raise ValueError("out: shares memory with the inputs, which are still read while outputs are written.")


def trace(function, *sizes: int, batch: bool = True) -> Kernel:
    """Kernel of a Python function of vectors; see :func:`gauss.codegen.write`."""
    return Kernel(write(function, *sizes), batch)
