"""Batches of motions on a device, in the form of the compiled loops of this CPU.

Each thread moves one motion, by the loop that moves a vector of them on a CPU.
"""

from collections.abc import Callable, Sequence

import numpy as np
from llvmlite import ir

from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.gpu.devices import Device, device
from gauss.codegen.gpu.on_device import OnDevice
from gauss.codegen.gpu.thread_code import ThreadCode, states_code
from gauss.codegen.ir_blocks import POINTER
from gauss.codegen.ir_module import DOUBLE, INTEGER, copy
from gauss.codegen.kernels.adaptive import Adaptive
from gauss.codegen.kernels.adaptive_batch import MOTION_RECORD, MotionQueue, write_adaptive_batch
from gauss.codegen.kernels.adaptive_batch import POINTERS as ADAPTIVE_POINTERS
from gauss.codegen.kernels.fixed_step import Fixed
from gauss.codegen.kernels.fixed_step_batch import POINTERS as FIXED_POINTERS
from gauss.codegen.kernels.fixed_step_batch import BatchSpan, write_fixed_step_batch
from gauss.codegen.kernels.loop_control import LoopStatus, Numbers
from gauss.codegen.native_function import NativeFunction

WHOLE = 1 << 40  # budget of steps that is never used up
FEWER = "take fewer samples: one motion does not fit into the memory of the device"


class DeviceKernel(OnDevice):
    """Traced function on a device, called as :class:`gauss.codegen.Kernel`."""

    def __init__(self, name: str, function: Function | NativeFunction):
        super().__init__(name, device(name).lowered(states_code(function)))
        self.n_in, self.n_out = len(function.inputs), len(function.outputs)

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """Outputs (n_out, k) of k columns (n_in, k)."""
        outputs = np.empty((self.n_out, columns.shape[1]))

        def evaluate(on: Device, some: slice):
            count = some.stop - some.start
            found = on.empty((self.n_out, count))
            self.run(on, count, [count, on.put(columns[:, some]), count, found, count])
            outputs[:, some] = found.numpy()

        self.in_parts(columns.shape[1], 8 * (self.n_in + self.n_out), evaluate, "one state does not fit into its memory")
        return outputs


class DeviceFixedStepLoop(OnDevice):
    """Fixed steps of a batch, called as :class:`gauss.codegen.kernels.FixedStepBatchLoop`.

    Parameters
    ----------
    method, start, written, inputs
        As of that class.
    """

    width = 1

    def __init__(self, name: str, method: Fixed, start: Function, written: slice, inputs: int = 0):
        super().__init__(name, device(name).lowered(_fixed_step_threads(method, start, written, inputs)))
        self.size, self.evaluations, self.written, self.inputs = method.size, method.evaluations, written, inputs

    def __call__(self, span: BatchSpan, points, worst, out, *inputs):
        """Make steps of all motions; arrays of this process are copied to the device and back.

        Parameters
        ----------
        points, worst, out, inputs : ndarray
            As of that class; the first three are changed.
        """
        self.move([span], points, worst, out, *inputs)

    def move(self, spans: Sequence[BatchSpan], points, worst, out, *inputs):
        """Make the steps of several calls, one after the other; in between, all arrays stay on the device."""
        changed = points, worst, out
        rows = [array for array in (out, *inputs) if array.size]
        of_one = 8 * (len(points) + len(worst) + sum(array[0].size for array in rows))

        def steps(on: Device, some: slice):
            count = some.stop - some.start
            held = [on.put(array[_part(array, some)]) for array in (*changed, *inputs)]
            for span in spans:
                own = {"columns": count, "begin": 0, "end": count, "motions": min(span.motions, count)}
                self.run(on, count, [on.put(_row(span, **own)), *held, count, WHOLE])
            for array, moved in zip(changed, held, strict=False):
                array[_part(array, some)] = moved.numpy()

        self.in_parts(points.shape[1], of_one, steps, FEWER)


class DeviceAdaptiveLoop(OnDevice):
    """Adaptive steps of a batch.

    Motions that are not at their end after some steps go on in threads side by side: a warp does not wait for one of them.
    In between, only their numbers and states of progress travel.

    Parameters
    ----------
    method, written
        As of :class:`gauss.codegen.kernels.AdaptiveBatchLoop`.
    """

    width = 1

    def __init__(self, name: str, method: Adaptive, written: slice):
        super().__init__(name, device(name).lowered(_adaptive_threads(method, written)))
        self.size = method.size

    def until(self, queue: MotionQueue, motions: np.ndarray, grid: np.ndarray, out: np.ndarray, budget: int):
        """Move all motions to the end in ``queue``; ``motions`` and ``out`` are changed.

        Parameters
        ----------
        queue : MotionQueue
            Settings.
        motions, grid, out : ndarray
            As of that class.
        budget : int
            Steps of a motion before the next round.
        """
        lane, control = self.size + len(MOTION_RECORD) + 1, len(MotionQueue.names())
        of_one = 8 * (len(motions) + out[0].size + lane + control + 2)

        def rounds(on: Device, some: slice):
            count = some.stop - some.start
            controls = np.repeat(_row(queue, columns=count, more=0.0)[None], count, axis=0)
            for name, values in (("following", np.arange(count)), ("last", np.arange(1, count + 1))):
                controls[:, MotionQueue.names().index(name)] = values
            lanes = np.zeros((count, lane))
            lanes[:, -1] = -1.0
            moved, written = on.put(motions[:, some]), on.put(out[some])
            held = [on.put(controls), on.put(lanes), moved, on.put(grid), written]
            which = np.arange(float(count))
            while which.size:
                status = on.empty(which.shape)
                self.run(on, which.size, [on.put(which), status, *held, which.size, budget])
                which = which[status.numpy() == LoopStatus.PAUSED]
            motions[:, some], out[some] = moved.numpy(), written.numpy()

        self.in_parts(motions.shape[1], of_one, rounds, FEWER)


def _row(record: Numbers, **changed: float) -> np.ndarray:
    """Record as an array, some numbers changed."""
    return np.array([changed.get(name, getattr(record, name)) for name in record.names()])


def _part(array: np.ndarray, some: slice):
    """Part of an array of motions: its columns, or first entries of more dimensions."""
    return (slice(None), some) if array.ndim == 2 else some


def _fixed_step_threads(method: Fixed, start: Function, written: slice, inputs: int) -> ThreadCode:
    """Loop of :class:`gauss.codegen.kernels.FixedStepBatchLoop`: (*POINTERS, inputs if there are some, count, budget).

    Thread k moves motion ``begin`` + k of the control, which all threads share.
    """
    pointers = len(FIXED_POINTERS) + bool(inputs)

    def arguments(code: ThreadCode, control, others):
        b, names = code.b, BatchSpan.names()
        own = b.alloca(DOUBLE, len(names))
        copy(b, own, control, len(names))
        at = lambda name: b.gep(own, [INTEGER(names.index(name))])  # noqa: E731
        begin = b.fadd(b.load(at("begin")), b.sitofp(code.thread, DOUBLE))
        b.store(begin, at("begin"))
        b.store(b.fadd(begin, DOUBLE(1.0)), at("end"))
        return [own, *others]

    return _threads(
        "fixed_step_threads",
        pointers,
        lambda writer: write_fixed_step_batch(writer, method, start, written, inputs, 1),
        arguments,
    )


def _adaptive_threads(method: Adaptive, written: slice) -> ThreadCode:
    """Loop of :class:`gauss.codegen.kernels.AdaptiveBatchLoop`: (which, status, *POINTERS, count, budget).

    Thread k moves motion ``which[k]``, which has a row of its own in the arrays of controls and of lanes, so that it is
    continued after a pause by whatever thread; ``status[k]`` is that of its control then.
    """
    names = MotionQueue.names()

    def arguments(code: ThreadCode, which, others):
        b, (_, controls, lanes, *rest) = code.b, others
        motion = b.fptosi(b.load(b.gep(which, [code.thread])), INTEGER)
        row = lambda pointer, length: b.gep(pointer, [b.mul(motion, INTEGER(length))])  # noqa: E731
        return [row(controls, len(names)), row(lanes, method.size + len(MOTION_RECORD) + 1), *rest]

    def after(code: ThreadCode, given, others):
        b = code.b
        status = b.gep(given[0], [INTEGER(names.index("status"))])
        b.store(b.load(status), b.gep(others[0], [code.thread]))

    return _threads(
        "adaptive_threads",
        2 + len(ADAPTIVE_POINTERS),
        lambda writer: write_adaptive_batch(writer, method, written, 1),
        arguments,
        after,
    )


def _threads(
    name: str, pointers: int, write: Callable[[Writer], ir.Function], arguments: Callable, after: Callable | None = None
) -> ThreadCode:
    """Thread code (*pointers, count, budget) that calls a loop with arguments of the thread."""
    code = ThreadCode(name, [POINTER] * pointers + [INTEGER, INTEGER])
    loop, b = write(code.writer), code.b
    loop.linkage = "internal"
    *given, count, budget = code.arguments
    with b.if_then(b.icmp_signed("<", code.thread, count)):
        own = arguments(code, given[0], given[1:])
        b.call(loop, [*own, budget])
        if after is not None:
            after(code, own, given[1:])
    b.ret_void()
    return code
