"""Function over rows of arrays on a device, as a Python function: states (n, …) in, results (n, …) out, a row in a thread.

A thread copies its row to memory of its own, evaluates the function, and compares the limited quantities with their limits;
where one is exceeded, it sets a mark, and only then the limited quantities travel back.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from llvmlite import ir

from gauss.codegen.function import Function
from gauss.codegen.gpu.devices import Device, DeviceArray, DeviceView, device, is_single
from gauss.codegen.gpu.on_device import OnDevice
from gauss.codegen.gpu.thread_code import ThreadCode
from gauss.codegen.ir_blocks import POINTER, counted_loop
from gauss.codegen.ir_module import DOUBLE, INTEGER
from gauss.codegen.python_wrapper import Interface, as_doubles, described
from gauss.errors import DeviceError, GaussError, StateError

SINGLE_LIMIT = 1e-2  # relative error of accelerations, and residual, above which single precision is not enough
MEASURED_ROWS = 64  # of which the error of single precision is measured
SMALLEST_SIZE = 1e-300  # of a result, against a division by zero


def _rows_code(function: Function, interface: Interface, single: bool) -> ThreadCode:
    """``rows(count, (vector, row stride, entry stride)…, numbers, results…, mark)`` of a function of vectors and a number.

    The strides are whole numbers of doubles; results and numbers are contiguous. Single precision is for computing alone.
    """
    sizes, results = interface.sizes, interface.result_sizes(len(function.outputs))
    kinds = [INTEGER, *[POINTER, INTEGER, INTEGER] * len(sizes), POINTER, *[POINTER] * len(results), POINTER]
    code = ThreadCode("rows", kinds, single)
    b, (count, *given), row = code.b, code.arguments, code.thread
    source, found = (b.alloca(DOUBLE, max(n, 1)) for n in (sum(sizes) + 1, len(function.outputs)))
    with b.if_then(b.icmp_signed("<", row, count)):
        place = 0
        for k, size in enumerate(sizes):
            data, apart, entry = given[3 * k : 3 * k + 3]
            first = b.gep(data, [b.mul(row, apart)])
            with counted_loop(b, INTEGER(0), INTEGER(size)) as i:
                b.store(b.load(b.gep(first, [b.mul(i, entry)])), b.gep(source, [b.add(i, INTEGER(place))]))
            place += size
        numbers, *targets, mark = given[3 * len(sizes) :]
        b.store(b.load(b.gep(numbers, [row])), b.gep(source, [INTEGER(place)]))
        b.call(code.writer.body(function, 1), [source, INTEGER(1), found, INTEGER(1)])
        place = 0
        for target, size in zip(targets, results, strict=True):
            first = b.gep(target, [b.mul(row, INTEGER(size))])
            with counted_loop(b, INTEGER(0), INTEGER(size)) as i:
                b.store(b.load(b.gep(found, [b.add(i, INTEGER(place))])), b.gep(first, [i]))
            place += size
        for k, limit in enumerate(interface.limits):
            value = b.load(b.gep(found, [INTEGER(sum(results) - len(interface.limits) + k)]))
            with b.if_then(b.fcmp_unordered(">", value, ir.Constant(DOUBLE, limit))):
                b.store(DOUBLE(1.0), mark)
    b.ret_void()
    return code


class RowsOnDevice(OnDevice):
    """Function over rows on a device.

    Parameters
    ----------
    function : Function
        Its inputs are the vectors and the number, concatenated; its outputs the results and the limited quantities.
    interface : Interface
        Arguments, results and limits.

    Attributes
    ----------
    interface : Interface
        Arguments, results and limits; in single precision limits are no smaller than 1 %.
    is_single : bool
        Whether it computes in single precision.
    operations : dict of str to int
        Operations of one evaluation by kind.
    bytes : int
        Bytes that a thread reads and writes.
    """

    def __init__(self, name: str, function: Function, interface: Interface):
        self.is_single = is_single(name)
        if self.is_single:
            interface = replace(interface, limits=tuple(max(limit, SINGLE_LIMIT) for limit in interface.limits))
        super().__init__(name, device(name).lowered(_rows_code(function, interface, self.is_single)))
        self.interface = interface
        self.sizes, self.operations = interface.result_sizes(len(function.outputs)), function.operations()
        self.bytes = 8 * (sum(interface.sizes) + 1 + sum(self.sizes))

    def __call__(self, on: Device, count: int, vectors: Sequence, numbers: DeviceArray) -> tuple[list[DeviceArray], bool]:
        """Results (count, size) of all rows, the limited quantities last, and whether a row exceeds a limit.

        Parameters
        ----------
        on : Device
            The device.
        count : int
            Number of rows.
        vectors : sequence of (DeviceArray, int, int)
            Each vector (count, k), with the strides of rows and entries in doubles.
        numbers : DeviceArray, shape (count,)
            The number of each row.
        """
        found, mark = [on.empty((count, size)) for size in self.sizes], on.put(np.zeros(1))
        self.run(on, count, [count, *(part for vector in vectors for part in vector), numbers, *found, mark])
        return found, bool(mark.numpy()[0])


class DeviceFunction:
    """Function ``f(*vectors, t=0.0, stream=None)`` of batches (n, k).

    Arrays of this process are copied to the devices in parts that fit into their memory, and so are the results back. Where
    one of the arguments is an array of another library on the device, results are arrays on the device, too: torch and CuPy
    read them by ``__cuda_array_interface__``, JAX by DLPack, and ``numpy()`` copies them.

    Parameters
    ----------
    own : callable
        The same function on this CPU, for rows that exceed the limits; it says why it refuses one.

    Attributes
    ----------
    error : float
        In single precision, the largest difference of the last results from double precision, relative to the largest of
        them, over rows spread over the batch; NaN before the first call, and 0 in double precision.
    """

    def __init__(self, rows: RowsOnDevice, own: Callable, name: str):
        self.rows, self.interface, self.own, self.__name__ = rows, rows.interface, own, name
        self.error = np.nan if rows.is_single else 0.0

    def __call__(self, *vectors, t=0.0, stream=None):
        """Results (n, …) of all rows.

        Parameters
        ----------
        *vectors : array_like, shape (n, k)
            Arrays of this process or of another library on the device.
        t : float or array_like, shape (n,)
            Time [s].
        stream : int or object, optional
            Stream of the device (its handle, or a stream of cuda.core, torch or CuPy): the function comes after what is in
            it, and waits for it alone. By default it waits for what writes to the arguments, and runs in the default stream.

        Raises
        ------
        StateError
            If an argument does not fit, or a row is refused: it says which, and why.
        DeviceError
            If the device has not enough memory, or an array lies on another one.
        """
        if stream is not None and len(self.rows.devices) > 1:
            raise DeviceError("stream: a stream is of one device, and several share this function.")
        devices = [device.on(stream) for device in self.rows.devices]
        views = [devices[0].view(given) for given in vectors]
        arrays = self._arrays(vectors, views)
        count = arrays[0].shape[0]
        numbers = self._numbers(t, count)
        if any(views):
            if len(devices) > 1:
                raise DeviceError("device: several devices share arrays of this process; arrays on a device are on one.")
            found = self._evaluated(devices[0], arrays, numbers)[: len(self.interface.shapes)]
            for array, shape in zip(found, self.interface.shapes, strict=True):
                array.shape, array.device = (count, *shape), self.rows.devices[0]  # the array may outlive the stream
            results: list = found
        else:
            results = [np.empty((count, *shape)) for shape in self.interface.shapes]

            def part(device: Device, some: slice):
                found = self._evaluated(device.on(stream), [array[some] for array in arrays], numbers[some], some.start)
                for result, array in zip(results, found, strict=False):
                    result[some] = array.numpy().reshape(result[some].shape)

            self.rows.in_parts(count, self.rows.bytes, part, "one row does not fit into its memory")
        if self.rows.is_single and count:
            self._measure(arrays, numbers, results)
        return results[0] if len(results) == 1 else tuple(results)

    def _evaluated(self, device: Device, arrays, numbers: np.ndarray, first: int = 0) -> list:
        """Results on a device, the limited quantities last; rows that exceed a limit are repaired."""
        held = [device.put(array) if isinstance(array, np.ndarray) else array for array in arrays]
        table = [(one, *(step // 8 for step in array.strides)) for one, array in zip(held, arrays, strict=True)]
        found, marked = self.rows(device, len(numbers), table, device.put(numbers))
        if marked:
            self._repair(arrays, numbers, found, first)
        return found

    def _measure(self, arrays, numbers: np.ndarray, results):
        """Measure the error of single precision on some rows."""
        chosen = np.unique(np.linspace(0, len(numbers) - 1, MEASURED_ROWS).astype(int))
        given = [(array if isinstance(array, np.ndarray) else array.numpy())[chosen] for array in arrays]
        right = self.own(*given, None, numbers[chosen])
        pairs = zip(results, right if len(results) > 1 else (right,), strict=True)
        found = [((one if isinstance(one, np.ndarray) else one.numpy())[chosen], other) for one, other in pairs]
        errors = [np.abs(one - other).max() / max(np.abs(other).max(), SMALLEST_SIZE) for one, other in found if other.size]
        self.error = float(max(errors, default=0.0))

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

    def _numbers(self, t, count: int) -> np.ndarray:
        """Time of each row."""
        numbers = as_doubles(t)
        if numbers is None or numbers.shape not in ((), (1,), (count,)):
            raise StateError(f"{self.__name__}: t: expected a number, or {count} of them, got {described(t)}.")
        return np.array(np.broadcast_to(numbers, count))

    def _repair(self, arrays, numbers: np.ndarray, found, first: int):
        """Replace the results of rows that exceed a limit by those of the function on this CPU."""
        *results, errors = (array.numpy() for array in found)
        given = [array if isinstance(array, np.ndarray) else array.numpy() for array in arrays]
        for row in np.flatnonzero(~(errors <= self.interface.limits).all(axis=1)).tolist():
            try:
                own = self.own(*(array[row] for array in given), t=float(numbers[row]))
            except GaussError as error:
                error.add_note(f"in row {first + row} of the batch")
                raise
            for result, replaced in zip(results, own if len(results) > 1 else (own,), strict=True):
                result[row] = np.ravel(replaced)
        for array, result in zip(found, results, strict=False):
            array.put(result)


def _rows(name: str, given, size: int) -> np.ndarray:
    """Contiguous rows of doubles."""
    array = as_doubles(given)
    if array is None or array.ndim != 2 or array.shape[1] != size:
        raise StateError(f"{name}: expected rows of {size} numbers (n, {size}), got {described(given)}.")
    return np.ascontiguousarray(array)


def _fitting(name: str, view: DeviceView, size: int) -> DeviceView:
    """Array of another library, if it can be read where it is."""
    fits = view.dtype == "<f8" and len(view.shape) == 2 and view.shape[1] == size
    if not fits or any(step % 8 or step < 0 for step in view.strides):
        found = f"{view.dtype} of shape {view.shape} and strides {view.strides}"
        raise StateError(f"{name}: expected doubles (n, {size}) on the device, got {found}.")
    return view
