"""A traced function as machine code: numbers in, numbers out."""

import numpy as np

from gauss.tracing import machine
from gauss.tracing.emit import Writer
from gauss.tracing.expression import Graph, count


class Kernel:
    """Compiled function of vectors.

    Parameters
    ----------
    inputs : sequence of Expression
        Symbols.
    outputs : sequence of Expression or float
        What is computed.
    batch : bool
        Whether many states will be given at once: then SIMD code is made, too.

    Attributes
    ----------
    operations : dict
        Number of operations of each kind.
    """

    def __init__(self, inputs, outputs, batch: bool = True):
        outputs = list(np.ravel(np.asarray(outputs, dtype=object)))
        self.n_in, self.n_out = len(inputs), len(outputs)
        self.operations = count(outputs)
        text = Writer(inputs, outputs).write((machine.width(),) if batch else ())
        self.address, self._engine = machine.load(text)
        self._function = machine.SIGNATURE(self.address)

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
    """Kernel of a Python function of vectors, by calling it once with symbols.

    Parameters
    ----------
    function : callable
        Takes one object array for each size, returns an array or a sequence of arrays.
    *sizes : int
        Length of each argument.
    batch : bool
        Whether SIMD code is wanted.
    """
    graph = Graph()
    arguments = [graph.symbols(f"x{k}", size) for k, size in enumerate(sizes)]
    outputs = function(*arguments)
    if isinstance(outputs, tuple):
        outputs = np.concatenate([np.ravel(part) for part in outputs])
    return Kernel([symbol for argument in arguments for symbol in argument], outputs, batch)
