"""Devices, processors with a memory of their own that run thread code, by their names.

Names are "cuda", "cuda:1", "lanes" (this CPU lane by lane), several of them, "cuda float32".
"""

import re
from collections.abc import Sequence
from functools import cache
from typing import Protocol

import numpy as np

from gauss.codegen.gpu.cuda import CudaDevice
from gauss.codegen.gpu.lane_by_lane import LaneByLane
from gauss.codegen.gpu.thread_code import Lowered, ThreadCode
from gauss.errors import ArgumentError, DeviceError

SINGLE = "float32"
NAME = re.compile(rf"(?:cuda(?::(?P<number>\d{{1,3}}))?|(?P<lanes>lanes))(?P<single> {SINGLE})?")


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


def device_name(given) -> str:
    """Name of one device, or of several: "cuda:0", "cuda:0,cuda:1", "cuda:0 float32".

    ArgumentError if it is no such name, or GPUs and this CPU are to share a batch.

    Parameters
    ----------
    given : str or sequence of str
        "cuda" or "cuda:0" for the first GPU, "cuda:1" for the second; "lanes" for this CPU, one thread after the other;
        with " float32" behind it for single precision. A sequence of such names shares a batch.
    """
    matches = _matches(given)
    if not matches or None in matches:
        raise ArgumentError(
            f"device: expected 'cuda', 'cuda:NUMBER' or 'lanes' (this CPU, lane by lane), several of them in a list, "
            f"or 'cuda {SINGLE}', got {given!r}."
        )
    found = [match.groupdict() for match in matches if match]
    if len({(one["lanes"], one["single"]) for one in found}) > 1:
        raise ArgumentError(f"device: expected devices of one kind, in one precision, got {given!r}.")
    return ",".join((one["lanes"] or f"cuda:{int(one['number'] or 0)}") + (one["single"] or "") for one in found)


def _matches(given) -> list[re.Match | None]:
    """Matches of the single names; None of what is no name."""
    names = given.split(",") if isinstance(given, str) else given if isinstance(given, list | tuple) else [given]
    return [NAME.fullmatch(name.strip()) if isinstance(name, str) else None for name in names]


def is_single(name: str) -> bool:
    """Whether a name asks for single precision."""
    return name.endswith(SINGLE)


def double_precision(given) -> str:
    """Name of devices that move motions, which are checked to more digits than single precision has.

    ArgumentError if it is no such name.
    DeviceError if it asks for single precision.

    Parameters
    ----------
    given : str or sequence of str
        As of :func:`device_name`.
    """
    name = device_name(given)
    if is_single(name):
        raise DeviceError(f"device {name!r}: motions are in double precision; functions of a state take {SINGLE!r}.")
    return name


def devices(name: str) -> tuple[Device, ...]:
    """Devices of a name.

    ArgumentError if it is no such name.
    MissingPackageError if cuda-bindings is not installed.
    DeviceError if there is no driver, or no such device.

    Parameters
    ----------
    name : str
        As of :func:`device_name`.
    """
    own = device_name(name).removesuffix(f" {SINGLE}").replace(f" {SINGLE},", ",").split(",")
    return tuple(_device(None if one == "lanes" else int(one.partition(":")[2])) for one in own)


def device(name: str) -> Device:
    """The first of the devices of a name; see :func:`devices`."""
    return devices(name)[0]


@cache
def _device(number: int | None) -> Device:
    found: Device = LaneByLane() if number is None else CudaDevice(number)
    return found
