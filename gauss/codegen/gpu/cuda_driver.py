"""The CUDA driver through the package cuda-bindings: calls, the primary context of a device, and what errors mean.

The primary context is that of the CUDA runtime, which torch, CuPy and JAX use, so that pointers are valid in all of them. It
is pushed for the calls of gauss, and popped after them: the device of another library in this thread remains what it was.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from gauss.errors import DeviceError, MissingPackageError

REMEDIES = {
    "CUDA_ERROR_NO_DEVICE": "the driver sees no GPU; CUDA_VISIBLE_DEVICES may hide it",
    "CUDA_ERROR_STUB_LIBRARY": "the library found is that of the toolkit, to link with; the driver has its own",
    "CUDA_ERROR_SYSTEM_NOT_READY": "the fabric manager of GPUs with NVLink does not run: start nvidia-fabricmanager",
    "CUDA_ERROR_OUT_OF_MEMORY": "the memory of the device is used up: take fewer states, or free arrays of other libraries",
    "CUDA_ERROR_UNSUPPORTED_PTX_VERSION": "the driver is older than CUDA 12.0: update it",
    "CUDA_ERROR_NOT_INITIALIZED": "a forked process cannot use the GPU of its parent: start it by 'spawn'",
    "CUDA_ERROR_LAUNCH_TIMEOUT": "a GPU with a display stops long programs: make fewer steps in a call",
    "CUDA_ERROR_ILLEGAL_ADDRESS": "an argument was no valid array; this process has lost the device: start a new one",
    "CUDA_ERROR_INVALID_HANDLE": "the stream may be of another device",
}


class CudaDriver:
    """Functions of the CUDA driver: a status that is no success is a DeviceError.

    MissingPackageError if cuda-bindings is not installed.
    DeviceError if there is no driver.
    """

    def __init__(self):
        try:
            from cuda.bindings import driver
        except ImportError:
            raise MissingPackageError(
                "device 'cuda' needs cuda-bindings, which is not installed: pip install cuda-bindings"
            ) from None
        self.api, self.process = driver, os.getpid()
        try:
            self.call("cuInit", 0)
        except DeviceError:
            raise
        except Exception as error:  # cuda-bindings raises errors of its own where the library is missing
            why = next(iter(str(error).strip().splitlines()), type(error).__name__)
            raise DeviceError(
                f"device 'cuda': no driver of NVIDIA was found ({why}); device 'lanes' runs the same code on this CPU."
            ) from None

    def call(self, name: str, *arguments):
        """Result of a function of the driver, a tuple of several."""
        try:
            status, *found = getattr(self.api, name)(*arguments)
        except ValueError as error:  # a status that cuda-bindings does not know yet
            raise DeviceError(f"device 'cuda': {name} failed: {error}.") from None
        if status != self.api.CUresult.CUDA_SUCCESS:
            code = getattr(status, "name", str(status))
            remedy = f": {REMEDIES[code]}" if code in REMEDIES else ""
            raise DeviceError(f"device 'cuda': {name} failed with {code}{remedy}.")
        return found[0] if len(found) == 1 else tuple(found)

    def attribute(self, name: str, device) -> int:
        """Attribute of a device."""
        return self.call("cuDeviceGetAttribute", getattr(self.api.CUdevice_attribute, f"CU_DEVICE_ATTRIBUTE_{name}"), device)

    @contextmanager
    def entered(self, context) -> Iterator[None]:
        """Calls of this thread go to a context; DeviceError if this process was forked from the one that began."""
        if os.getpid() != self.process:
            raise DeviceError("device 'cuda': a forked process cannot use the GPU of its parent: start it by 'spawn'.")
        self.call("cuCtxPushCurrent", context)
        try:
            yield
        finally:
            self.api.cuCtxPopCurrent()


@cache
def driver() -> CudaDriver:
    """The driver, initialised once."""
    return CudaDriver()


def device_names() -> list[str]:
    """Names of the GPUs, as the driver gives them."""
    own = driver()
    devices = [own.call("cuDeviceGet", number) for number in range(own.call("cuDeviceGetCount"))]
    return [own.call("cuDeviceGetName", 256, device).split(b"\0")[0].decode() for device in devices]
