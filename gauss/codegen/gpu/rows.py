"""A function over rows of arrays on a device: states (n, …) in, results (n, …) out, a row in a thread.

A thread copies its row to memory of its own, evaluates the function, and compares the limited quantities with their limits;
where one is exceeded, it sets a mark, and only then the limited quantities travel back.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from llvmlite import ir

from gauss.codegen.function import Function
from gauss.codegen.gpu.device import Device, DeviceArray
from gauss.codegen.gpu.devices import device, is_single
from gauss.codegen.gpu.on_device import OnDevice
from gauss.codegen.gpu.thread_code import ThreadCode
from gauss.codegen.ir_blocks import POINTER, counted_loop
from gauss.codegen.lanes import DOUBLE, INTEGER
from gauss.codegen.python_wrapper import Interface

SINGLE_LIMIT = 1e-2  # relative error of accelerations, and residual, above which single precision is not enough


def rows_code(function: Function, interface: Interface, single: bool = False) -> ThreadCode:
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
        super().__init__(name, device(name).lowered(rows_code(function, interface, self.is_single)))
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
