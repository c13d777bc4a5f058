"""Python function of batches of vectors on a device."""

from collections.abc import Callable

import numpy as np

from gauss.codegen.gpu.device import DeviceView
from gauss.codegen.gpu.rows import RowsOnDevice
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
        The same function on this CPU, for rows that exceed the limits; it says why it refuses one.
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
        device = self.rows.device
        views = [device.view(given) for given in vectors]
        arrays = self._arrays(vectors, views)
        count = arrays[0].shape[0]
        held = [array if view else device.put(array) for array, view in zip(arrays, views, strict=True)]
        strides = [array.strides for array in arrays]
        table = [(array, *(step // 8 for step in apart)) for array, apart in zip(held, strides, strict=True)]
        numbers = np.array(np.broadcast_to(np.asarray(t, dtype=float), count))
        found, marked = self.rows(count, table, device.put(numbers))
        if marked:
            self._repair(arrays, numbers, found)
        found = found[: len(self.interface.shapes)]
        for array, shape in zip(found, self.interface.shapes, strict=True):
            array.shape = (count, *shape)
        results = found if any(views) else [array.numpy() for array in found]
        return results[0] if len(results) == 1 else tuple(results)

    def _arrays(self, vectors, views) -> list:
        """Arguments as arrays of doubles (n, k), those of the device as they are."""
        names = list(self.interface.vectors)
        if len(vectors) != len(names):
            raise StateError(f"{self.__name__}: expected {', '.join(names)}, got {len(vectors)} arguments.")
        given = zip(self.interface.vectors.items(), vectors, views, strict=True)
        arrays = [_rows(name, x, size) if view is None else _fitting(name, view, size) for (name, size), x, view in given]
        if len({array.shape[0] for array in arrays}) > 1:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(names, arrays, strict=True))
            raise StateError(f"{self.__name__}: batches of different lengths: {shapes}.")
        return arrays

    def _repair(self, arrays, numbers: np.ndarray, found):
        """Replace the results of rows that exceed a limit by those of the function on this CPU."""
        *results, errors = (array.numpy() for array in found)
        given = [array if isinstance(array, np.ndarray) else array.numpy() for array in arrays]
        for row in np.flatnonzero(~(errors <= self.interface.limits).all(axis=1)).tolist():
            try:
                own = self.own(*(array[row] for array in given), t=float(numbers[row]))
            except GaussError as error:
                error.add_note(f"in row {row} of the batch")
                raise
            for result, replaced in zip(results, own if len(results) > 1 else (own,), strict=True):
                result[row] = np.ravel(replaced)
        for array, result in zip(found, results, strict=False):
            array.put(result)


def _rows(name: str, given, size: int) -> np.ndarray:
    """Contiguous rows of doubles."""
    try:
        array = np.ascontiguousarray(given, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1] != size:
        raise StateError(f"{name}: expected rows of {size} numbers (n, {size}), got {np.shape(given)}.")
    return array


def _fitting(name: str, view: DeviceView, size: int) -> DeviceView:
    """Array of another library, if it can be read where it is."""
    fits = view.dtype == "<f8" and len(view.shape) == 2 and view.shape[1] == size
    if not fits or any(step % 8 or step < 0 for step in view.strides):
        raise StateError(f"{name}: expected doubles (n, {size}) on the device, got {view.dtype} of shape {view.shape}.")
    return view
