"""A device that is this CPU: the threads of a GPU run one after the other, and results are checked without one."""

import ctypes
from collections.abc import Sequence

import numpy as np

from gauss.codegen import machine
from gauss.codegen.gpu.ptx import refuse_libraries
from gauss.codegen.gpu.thread_code import Lowered, ThreadCode
from gauss.errors import DeviceError

FREE_BYTES = 1 << 31  # of the memory of this process that a batch may take at a time


class HostArray:
    """Contiguous array of doubles in the memory of this process."""

    def __init__(self, array: np.ndarray):
        self.array, self.shape = array, array.shape

    def numpy(self) -> np.ndarray:
        """A copy."""
        return self.array.reshape(self.shape).copy()

    def put(self, array: np.ndarray):
        """Overwrite it."""
        self.array[...] = array.reshape(self.array.shape)


class LaneByLane:
    """The device."""

    name, stream = "lanes", 0

    def on(self, stream) -> "LaneByLane":
        """The same: it has no streams."""
        if stream is not None:
            raise DeviceError("device 'lanes': this CPU has no streams; leave out stream=.")
        return self

    def lowered(self, code: ThreadCode) -> Lowered:
        """Thread code as LLVM IR, refused where a GPU would refuse it."""
        text = code.cpu_text()
        refuse_libraries(text)
        return Lowered(code.name, text, code.is_array)

    def program(self, lowered: Lowered) -> "HostProgram":
        """Thread code, ready to run."""
        return HostProgram(lowered)

    def view(self, given) -> None:
        """No array of another library is on this device."""

    def put(self, array: np.ndarray) -> HostArray:
        """Copy of an array."""
        return HostArray(np.array(array, dtype=float, order="C"))

    def empty(self, shape: tuple[int, ...]) -> HostArray:
        """Array, not initialised."""
        return HostArray(np.empty(shape))

    def free_bytes(self) -> int:
        """Memory that a batch may take [bytes]."""
        return FREE_BYTES


class HostProgram:
    """Thread code on this CPU; its frames are on the stack."""

    memory_bytes = 0

    def __init__(self, lowered: Lowered):
        kinds = [ctypes.c_void_p if is_array else ctypes.c_int64 for is_array in lowered.is_array]
        self.code = machine.load(lowered.text, optimise=2)
        self._run = self.code.entry(lowered.name, ctypes.CFUNCTYPE(None, ctypes.c_int64, *kinds))

    def __call__(self, threads: int, arguments: Sequence, stream: int = 0):
        """Run the threads one after the other."""
        self._run.call(threads, *(given.array.ctypes.data if isinstance(given, HostArray) else given for given in arguments))
