"""Python function of batches of vectors on a device."""

from collections.abc import Callable

import numpy as np

from gauss.codegen.gpu.rows import UNMARKED, RowsOnDevice
from gauss.codegen.python_wrapper import Interface
from gauss.errors import GaussError, StateError


class DeviceFunction:
    """Function ``f(*vectors, t=0.0)`` of batches (n, k).

    Arrays of this process are copied to the device, and so are the results back. Where one of the arguments is an array of
    another library on the device, results are arrays on the device, too: torch and CuPy read them by
    ``__cuda_array_interface__``, JAX by DLPack, and ``numpy()`` copies them.

    Parameters
    ----------
    rows : RowsOnDevice
        The function.
    interface : Interface
        Arguments, results and limits.
    own : callable
        The same function on this CPU, which says why it refuses a row.
    name : str
        Its name.
    """

    def __init__(self, rows: RowsOnDevice, interface: Interface, own: Callable, name: str):
        self.rows, self.interface, self.own, self.__name__ = rows, interface, own, name

    def __call__(self, *vectors, t=0.0):
        """Results (n, …) of all rows.

        Raises
        ------
        StateError
            If an argument does not fit, or a row is refused: it says which, and why.
        DeviceError
            If the device has not enough memory.
        """
        names, device = list(self.interface.vectors), self.rows.device
        if len(vectors) != len(names):
            raise StateError(f"{self.__name__}: expected {', '.join(names)}, got {len(vectors)} arguments.")
        views = [device.view(given) for given in vectors]
        arrays = [view or _rows(name, given, size) for (name, size), given, view in self._arguments(vectors, views)]
        counts = {array.shape[0] for array in arrays}
        if len(counts) != 1:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(names, arrays, strict=True))
            raise StateError(f"{self.__name__}: batches of different lengths: {shapes}.")
        (count,) = counts
        held = [array if view else device.put(array) for array, view in zip(arrays, views, strict=True)]
        strides = [array.strides for array in arrays]
        numbers = np.array(np.broadcast_to(np.asarray(t, dtype=float), count))
        table = [(array, *(step // 8 for step in apart)) for array, apart in zip(held, strides, strict=True)]
        found, marked = self.rows(count, table, device.put(numbers))
        if marked != UNMARKED:
            self._refuse(marked, arrays, views, numbers)
        shapes = [(count, *shape) for shape in self.interface.shapes]
        if any(views):
            for array, shape in zip(found, shapes, strict=True):
                array.shape = shape
            return found[0] if len(found) == 1 else tuple(found)
        results = [array.numpy().reshape(shape) for array, shape in zip(found, shapes, strict=True)]
        return results[0] if len(results) == 1 else tuple(results)

    def _arguments(self, vectors, views):
        for (name, size), given, view in zip(self.interface.vectors.items(), vectors, views, strict=True):
            if view is not None:
                fits = view.dtype == "<f8" and len(view.shape) == 2 and view.shape[1] == size
                if not fits or any(step % 8 for step in view.strides):
                    raise StateError(
                        f"{name}: expected doubles (n, {size}) on the device, got {view.dtype} of shape {view.shape}."
                    )
            yield (name, size), given, view

    def _refuse(self, row: int, arrays, views, numbers: np.ndarray):
        """Raise the reason why a row is refused."""
        if not any(views):
            try:
                self.own(*(array[row] for array in arrays), t=float(numbers[row]))
            except GaussError as error:
                error.add_note(f"in row {row} of the batch")
                raise
        raise StateError(
            f"{self.__name__}: row {row} of the batch is refused: it is not finite, or a quaternion is not of unit length."
        )


def _rows(name: str, given, size: int) -> np.ndarray:
    """Contiguous rows of doubles."""
    try:
        array = np.ascontiguousarray(given, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1] != size:
        raise StateError(f"{name}: expected rows of {size} numbers (n, {size}), got {np.shape(given)}.")
    return array
