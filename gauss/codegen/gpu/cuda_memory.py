"""Arrays of doubles on GPUs: own ones, which other libraries read without a copy, and those of other libraries.

Copies are in the order of a stream, and are waited for (CUDA array interface, version 3; DLPack).
"""

import ctypes
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from gauss.codegen.gpu import dlpack
from gauss.errors import DeviceError

if TYPE_CHECKING:
    from gauss.codegen.gpu.cuda import CudaDevice


class CudaArray:
    """Array of doubles on a GPU; other packages read it without a copy (``__cuda_array_interface__``, DLPack)."""

    def __init__(self, device: "CudaDevice", shape: tuple[int, ...]):
        self.device, self.shape = device, tuple(map(int, shape))
        self.nbytes = 8 * int(np.prod(self.shape, dtype=np.int64))
        with device.entered():
            self.pointer = int(device.driver.call("cuMemAlloc", max(self.nbytes, 8)))

    def __del__(self):
        if getattr(self, "pointer", 0):
            with suppress(Exception), self.device.entered():  # at the end of the process, the driver has freed it already
                self.device.driver.api.cuMemFree(self.pointer)

    @property
    def __cuda_array_interface__(self) -> dict:
        pointer = self.pointer if self.nbytes else 0
        typed = {"typestr": "<f8", "strides": None, "version": 3, "stream": None}  # what writes to it has ended
        return {"shape": self.shape, "data": (pointer, False), **typed}

    def __dlpack_device__(self) -> tuple[int, int]:
        """Kind of memory, and number of the device."""
        return dlpack.CUDA, self.device.number

    def __dlpack__(self, *, dl_device=None, copy=None, **_):
        """Capsule of the array; programs wait for their threads, so that no stream needs to.

        Raises
        ------
        BufferError
            If a copy is asked for, or another device.
        """
        if copy or dl_device not in (None, self.__dlpack_device__()):
            raise BufferError("gauss lends this array where it is; numpy() copies it.")
        return dlpack.capsule(self, self.pointer, self.shape, *self.__dlpack_device__())

    def numpy(self) -> np.ndarray:
        """A copy in the memory of this process."""
        return self.device.copied(self.pointer, np.empty(self.shape))

    def put(self, array: np.ndarray):
        """Overwrite it with an array of as many numbers."""
        given, device = np.ascontiguousarray(array, dtype=float), self.device
        if given.nbytes != self.nbytes:
            raise ValueError(f"expected {self.nbytes} bytes, got {given.nbytes}.")
        if self.nbytes:
            with device.entered():
                device.driver.call("cuMemcpyHtoDAsync", self.pointer, given.ctypes.data, self.nbytes, device.stream)
                device.driver.call("cuStreamSynchronize", device.stream)


class CudaView:
    """Array with ``__cuda_array_interface__`` of another library on a GPU.

    DeviceError if it lies on another GPU.
    """

    def __init__(self, device: "CudaDevice", given):
        described = given.__cuda_array_interface__
        self.device, self.given, self.described = device, given, described
        self.shape, self.dtype = tuple(map(int, described["shape"])), described["typestr"]
        self.pointer, strides = int(described["data"][0] or 0), described.get("strides")
        contiguous = [8 * int(np.prod(self.shape[k + 1 :], dtype=np.int64)) for k in range(len(self.shape))]
        self.strides = tuple(contiguous if strides is None else map(int, strides))
        if all(self.shape):
            self._refuse_other_device()

    def _refuse_other_device(self):
        own, attribute = self.device.driver, self.device.driver.api.CUpointer_attribute
        with self.device.entered():
            number = own.call("cuPointerGetAttribute", attribute.CU_POINTER_ATTRIBUTE_DEVICE_ORDINAL, self.pointer)
        if int(number) != self.device.number:
            raise DeviceError(f"device {self.device.name!r}: an argument lies on 'cuda:{int(number)}'; take that device.")

    def wait(self):
        """Wait for what writes to it: in its stream where it names one, else on the whole device."""
        named = "stream" in self.described
        stream = self.described.get("stream")
        if named and stream is None:
            return
        with self.device.entered():
            if named:
                self.device.driver.call("cuStreamSynchronize", int(stream))
            else:
                self.device.driver.call("cuCtxSynchronize")

    def numpy(self) -> np.ndarray:
        """A copy in the memory of this process."""
        last = sum(step * (size - 1) for step, size in zip(self.strides, self.shape, strict=True))
        whole = self.device.copied(self.pointer, np.empty(1 + last // 8 if all(self.shape) else 0))
        return np.lib.stride_tricks.as_strided(whole, self.shape, self.strides).copy()


def stream_handle(stream) -> int:
    """Handle of a stream: a whole number, or a stream of cuda.core, torch or CuPy; DeviceError if it is no stream."""
    protocol = getattr(stream, "__cuda_stream__", None)
    if callable(protocol):
        return int(protocol()[1])
    for name in ("cuda_stream", "ptr"):  # of torch, of CuPy
        handle = getattr(stream, name, None)
        if isinstance(handle, int):
            return handle
    try:
        return ctypes.c_size_t(stream.__index__()).value
    except (AttributeError, TypeError):
        raise DeviceError(f"stream: expected a stream of CUDA or its handle, got {stream!r}.") from None
