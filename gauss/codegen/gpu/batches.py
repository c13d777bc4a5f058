"""Batches of motions on a device, in the form of the compiled loops of this CPU."""

from collections.abc import Sequence

import numpy as np

from gauss.codegen.function import Function
from gauss.codegen.gpu.batch_threads import adaptive_threads, fixed_step_threads
from gauss.codegen.gpu.device import Device, DeviceArray, DeviceProgram, Lowered
from gauss.codegen.gpu.devices import device
from gauss.codegen.gpu.thread_code import states_code
from gauss.codegen.kernels.adaptive import Adaptive
from gauss.codegen.kernels.adaptive_batch import MOTION_RECORD, MotionQueue
from gauss.codegen.kernels.fixed_step import Fixed
from gauss.codegen.kernels.fixed_step_batch import BatchSpan
from gauss.codegen.kernels.loop_control import LoopStatus, Numbers
from gauss.codegen.native_function import NativeFunction

WHOLE = 1 << 40  # budget of steps that is never used up


class OnDevice:
    """Base of code for a device: what is kept on disk is its text, which is loaded at the first use.

    Parameters
    ----------
    name : str
        Name of the device.
    lowered : Lowered
        The code.
    """

    def __init__(self, name: str, lowered: Lowered):
        self.device_name, self.lowered = name, lowered
        self._program: DeviceProgram | None = None

    def __getstate__(self) -> dict:
        return vars(self) | {"_program": None}

    @property
    def device(self) -> Device:
        """The device."""
        return device(self.device_name)

    def run(self, threads: int, arguments: Sequence):
        """Run the threads, and wait for them."""
        if self._program is None:
            self._program = self.device.program(self.lowered)
        self._program(threads, arguments)


class DeviceKernel(OnDevice):
    """Traced function on a device, called as :class:`gauss.codegen.Kernel`.

    Parameters
    ----------
    name : str
        Name of the device.
    function : Function or NativeFunction
        The function.
    """

    def __init__(self, name: str, function: Function | NativeFunction):
        super().__init__(name, device(name).lowered(states_code(function)))
        self.n_in, self.n_out = len(function.inputs), len(function.outputs)

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """Outputs (n_out, k) of k columns (n_in, k)."""
        count = columns.shape[1]
        found = self.device.empty((self.n_out, count))
        self.run(count, [count, self.device.put(columns), count, found, count])
        return found.numpy()


class DeviceFixedStepLoop(OnDevice):
    """Fixed steps of a batch, called as :class:`gauss.codegen.kernels.FixedStepBatchLoop`.

    Parameters
    ----------
    name : str
        Name of the device.
    method, start, written, inputs
        As of that class.
    """

    width = 1

    def __init__(self, name: str, method: Fixed, start: Function, written: slice, inputs: int = 0):
        super().__init__(name, device(name).lowered(fixed_step_threads(method, start, written, inputs)))
        self.size, self.evaluations, self.written, self.inputs = method.size, method.evaluations, written, inputs

    def __call__(self, span: BatchSpan, points, worst, out, *inputs):
        """Make steps of a range of motions; arrays of this process are copied to the device and back.

        Parameters
        ----------
        span : BatchSpan
            Motions and steps.
        points, worst, out, inputs : ndarray
            As of that class; the first three are changed.
        """
        held = [self.device.put(array) for array in (points, worst, out, *inputs)]
        self.steps(span, held)
        for array, changed in zip((points, worst, out), held, strict=False):
            array[...] = changed.numpy()

    def steps(self, span: BatchSpan, arrays: Sequence[DeviceArray]):
        """Make steps of a range of motions, with arrays on the device."""
        count = int(span.end - span.begin)
        self.run(count, [self.device.put(_row(span)), *arrays, count, WHOLE])


class DeviceAdaptiveLoop(OnDevice):
    """Adaptive steps of a batch.

    Motions that are not at their end after some steps go on in threads side by side: a warp does not wait for one of them.

    Parameters
    ----------
    name : str
        Name of the device.
    method, written
        As of :class:`gauss.codegen.kernels.AdaptiveBatchLoop`.
    """

    width = 1

    def __init__(self, name: str, method: Adaptive, written: slice):
        super().__init__(name, device(name).lowered(adaptive_threads(method, written)))
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
        count, own = motions.shape[1], self.device
        controls = np.repeat(_row(queue)[None], count, axis=0)
        for name, values in (("following", np.arange(count)), ("last", np.arange(1, count + 1)), ("more", 0.0)):
            controls[:, _place(name)] = values
        lanes = np.zeros((count, self.size + len(MOTION_RECORD) + 1))
        lanes[:, -1] = -1.0
        moved, times, written = own.put(motions), own.put(grid), own.put(out)
        while len(controls):
            held = own.put(controls), own.put(lanes)
            self.run(len(controls), [*held, moved, times, written, len(controls), budget])
            controls, lanes = (array.numpy() for array in held)
            going = controls[:, _place("status")] == LoopStatus.PAUSED
            controls, lanes = controls[going], lanes[going]
        motions[...], out[...] = moved.numpy(), written.numpy()


def _row(numbers: Numbers) -> np.ndarray:
    """Record as an array."""
    return np.array([getattr(numbers, name) for name in numbers.names()])


def _place(name: str) -> int:
    return MotionQueue.names().index(name)
