"""Devices: processors with a memory of their own that run thread code."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from gauss.codegen.gpu.thread_code import ThreadCode


class Lowered(NamedTuple):
    """Thread code for a device: name of its entry, its text, and which of its arguments are arrays."""

    name: str
    text: str
    is_array: tuple[bool, ...]


class DeviceArray(Protocol):
    """Array of doubles in the memory of a device."""

    shape: tuple[int, ...]  # its shape; rows are contiguous

    def numpy(self) -> np.ndarray:
        """A copy in the memory of this process."""

    def put(self, array: np.ndarray):
        """Overwrite it with an array of its shape."""


class DeviceView(Protocol):
    """Array of another library in the memory of a device."""

    shape: tuple[int, ...]  # its shape
    strides: tuple[int, ...]  # its strides [bytes]
    dtype: str  # type of its entries, as numpy writes it

    def numpy(self) -> np.ndarray:
        """A copy in the memory of this process."""


class DeviceProgram(Protocol):
    """Thread code that can be run."""

    memory_bytes: int  # memory of the device that the frames of all threads at once take [bytes]

    def __call__(self, threads: int, arguments: Sequence, stream: int = 0):
        """Run a number of threads in a stream of the device, and wait for them."""


class Device(Protocol):
    """Processor with a memory of its own."""

    name: str  # its name, such as "cuda:0"
    stream: int  # stream of copies and programs; 0 is the default stream

    def on(self, stream) -> "Device":
        """The device with another stream; None is the default stream.

        DeviceError if it has no streams, or this is none.
        """

    def lowered(self, code: ThreadCode) -> Lowered:
        """Thread code for this device; DeviceError if it calls what a GPU does not have."""

    def program(self, lowered: Lowered) -> DeviceProgram:
        """Thread code, ready to run."""

    def view(self, given) -> "DeviceView | None":
        """An array of another library on the device, as it is; None if it is none."""

    def put(self, array: np.ndarray) -> DeviceArray:
        """Copy of an array on the device."""

    def empty(self, shape: tuple[int, ...]) -> DeviceArray:
        """Array on the device, not initialised."""

    def free_bytes(self) -> int:
        """Free memory [bytes]."""
