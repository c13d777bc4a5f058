"""GPUs of NVIDIA by the CUDA driver, through the package cuda-bindings; it is imported when a device is asked for.

The driver compiles PTX for the device and caches the result. Arrays are allocated in the memory of the device, and a program
waits for its threads, so that an error is raised where it happens.
"""

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np

from gauss.codegen.gpu import dlpack
from gauss.codegen.gpu.device import Lowered
from gauss.codegen.gpu.ptx import LEAST_CAPABILITY, ptx, refuse_libraries
from gauss.codegen.gpu.thread_code import THREADS_PER_BLOCK, ThreadCode
from gauss.errors import DeviceError, MissingPackageError

NEWEST_CAPABILITY = 90  # PTX for it runs on later devices, too
LOG_BYTES = 8192  # of the messages of the driver's compiler


class CudaDriver:
    """Functions of the CUDA driver: a status that is no success is a DeviceError.

    Raises
    ------
    MissingPackageError
        If cuda-bindings is not installed.
    DeviceError
        If there is no driver.
    """

    def __init__(self):
        try:
            from cuda.bindings import driver
        except ImportError:
            raise MissingPackageError(
                "device 'cuda' needs cuda-bindings, which is not installed: pip install cuda-bindings"
            ) from None
        self.api = driver
        try:
            self.call("cuInit", 0)
        except DeviceError:
            raise
        except Exception as error:  # cuda-bindings raises errors of its own where the library is missing
            raise DeviceError(
                f"device 'cuda': no driver of NVIDIA was found ({str(error).strip().splitlines()[0]})"
            ) from None

    def call(self, name: str, *arguments):
        """Result of a function of the driver, a tuple of several."""
        status, *found = getattr(self.api, name)(*arguments)
        if status != self.api.CUresult.CUDA_SUCCESS:
            raise DeviceError(f"device 'cuda': {name} failed with {status.name}.")
        return found[0] if len(found) == 1 else tuple(found)

    def attribute(self, name: str, device) -> int:
        """Attribute of a device."""
        return self.call("cuDeviceGetAttribute", getattr(self.api.CUdevice_attribute, f"CU_DEVICE_ATTRIBUTE_{name}"), device)


@cache
def driver() -> CudaDriver:
    """The driver, initialised once."""
    return CudaDriver()


def device_names() -> list[str]:
    """Names of the GPUs, as the driver gives them."""
    own = driver()
    devices = [own.call("cuDeviceGet", number) for number in range(own.call("cuDeviceGetCount"))]
    return [own.call("cuDeviceGetName", 256, device).split(b"\0")[0].decode() for device in devices]


class CudaDevice:
    """One GPU.

    Parameters
    ----------
    number : int
        Which one.

    Raises
    ------
    MissingPackageError
        If cuda-bindings is not installed.
    DeviceError
        If there is no driver, no such device, or it is too old.
    """

    def __init__(self, number: int = 0):
        self.driver, self.number, self.name = driver(), number, f"cuda:{number}"
        count = self.driver.call("cuDeviceGetCount")
        if number >= count:
            raise DeviceError(f"device {self.name!r} does not exist: the driver has {count}, numbered from 0.")
        device = self.driver.call("cuDeviceGet", number)
        major, minor = (self.driver.attribute(f"COMPUTE_CAPABILITY_{part}", device) for part in ("MAJOR", "MINOR"))
        if 10 * major + minor < LEAST_CAPABILITY:
            raise DeviceError(f"device {self.name!r} has compute capability {major}.{minor}; at least 6.0 is needed.")
        self.capability = min(10 * major + minor, NEWEST_CAPABILITY)
        self.context = self.driver.call("cuDevicePrimaryCtxRetain", device)
        self.current()

    def current(self):
        """Let the calls of this thread go to the device."""
        self.driver.call("cuCtxSetCurrent", self.context)

    def lowered(self, code: ThreadCode) -> Lowered:
        """Thread code as LLVM IR; PTX is made for the device at hand where the code is loaded."""
        text = code.gpu_text()
        refuse_libraries(text)
        return Lowered(code.name, text, code.is_array)

    def program(self, lowered: Lowered) -> "CudaProgram":
        """Thread code, ready to run."""
        return CudaProgram(self, lowered)

    def view(self, given) -> "CudaView | None":
        """An array of another library on a GPU, as it is; None if it is none. What writes to it has ended."""
        if not hasattr(given, "__cuda_array_interface__"):
            return None
        self.current()
        self.driver.call("cuCtxSynchronize")
        return CudaView(given)

    def put(self, array: np.ndarray) -> "CudaArray":
        """Copy of an array in the memory of the device."""
        found = self.empty(np.shape(array))
        found.put(array)
        return found

    def empty(self, shape: tuple[int, ...]) -> "CudaArray":
        """Array in the memory of the device, not initialised."""
        return CudaArray(self, shape)

    def free_bytes(self) -> int:
        """Free memory [bytes]."""
        self.current()
        return self.driver.call("cuMemGetInfo")[0]


class CudaArray:
    """Array of doubles on a GPU; other packages read it without a copy (``__cuda_array_interface__``, DLPack).

    Parameters
    ----------
    device : CudaDevice
        The GPU.
    shape : tuple of int
        Its shape.
    """

    def __init__(self, device: CudaDevice, shape: tuple[int, ...]):
        self.device, self.shape = device, tuple(shape)
        self.nbytes = 8 * int(np.prod(shape, dtype=np.int64))
        device.current()
        self.pointer = int(device.driver.call("cuMemAlloc", max(self.nbytes, 8)))

    def __del__(self):
        if getattr(self, "pointer", 0):
            self.device.driver.api.cuMemFree(self.pointer)

    @property
    def __cuda_array_interface__(self) -> dict:
        return {"shape": self.shape, "typestr": "<f8", "data": (self.pointer, False), "strides": None, "version": 3}

    def __dlpack_device__(self) -> tuple[int, int]:
        """Kind of memory, and number of the device."""
        return dlpack.CUDA, self.device.number

    def __dlpack__(self, **_):
        """Capsule of the array; programs wait for their threads, so that no stream needs to."""
        return dlpack.capsule(self, self.pointer, self.shape, *self.__dlpack_device__())

    def numpy(self) -> np.ndarray:
        """A copy in the memory of this process."""
        found = np.empty(self.shape)
        self.device.current()
        if self.nbytes:
            self.device.driver.call("cuMemcpyDtoH", found.ctypes.data, self.pointer, self.nbytes)
        return found

    def put(self, array: np.ndarray):
        """Overwrite it."""
        given = np.ascontiguousarray(array, dtype=float)
        self.device.current()
        if self.nbytes:
            self.device.driver.call("cuMemcpyHtoD", self.pointer, given.ctypes.data, self.nbytes)


class CudaView:
    """Array of another library on a GPU.

    Parameters
    ----------
    given : object
        Array with ``__cuda_array_interface__``.
    """

    def __init__(self, given):
        described = given.__cuda_array_interface__
        self.given, self.shape, self.dtype = given, tuple(described["shape"]), described["typestr"]
        self.pointer, strides = described["data"][0], described.get("strides")
        contiguous = [8 * int(np.prod(self.shape[k + 1 :], dtype=np.int64)) for k in range(len(self.shape))]
        self.strides = tuple(contiguous if strides is None else strides)

    def numpy(self) -> np.ndarray:
        """A copy in the memory of this process."""
        last = sum(step * (size - 1) for step, size in zip(self.strides, self.shape, strict=True))
        whole = np.empty(1 + last // 8 if all(self.shape) else 0)
        if whole.size:
            driver().call("cuMemcpyDtoH", whole.ctypes.data, self.pointer, whole.nbytes)
        return np.lib.stride_tricks.as_strided(whole, self.shape, self.strides).copy()


class CudaProgram:
    """Thread code on a GPU.

    Parameters
    ----------
    device : CudaDevice
        The GPU.
    lowered : Lowered
        The code.

    Raises
    ------
    DeviceError
        If the driver refuses the code.
    """

    def __init__(self, device: CudaDevice, lowered: Lowered):
        self.device, self.is_array, api = device, lowered.is_array, device.driver.api
        device.current()
        log = np.zeros(LOG_BYTES, dtype=np.uint8)
        options = [api.CUjit_option.CU_JIT_ERROR_LOG_BUFFER, api.CUjit_option.CU_JIT_ERROR_LOG_BUFFER_SIZE_BYTES]
        text = ptx(lowered.text, device.capability).encode() + b"\0"
        try:
            self.module = device.driver.call("cuModuleLoadDataEx", text, 2, options, [log.ctypes.data, LOG_BYTES])
        except DeviceError as error:
            words = log.tobytes().split(b"\0")[0].decode(errors="replace").strip()
            raise DeviceError(f"{error} {words}") from None
        self.function = device.driver.call("cuModuleGetFunction", self.module, lowered.name.encode())

    def __del__(self):
        if hasattr(self, "module"):
            self.device.driver.api.cuModuleUnload(self.module)

    def __call__(self, threads: int, arguments: Sequence):
        """Run the threads, and wait for them."""
        values = tuple(given if isinstance(given, int) else given.pointer for given in arguments)
        kinds = tuple(ctypes.c_void_p if is_array else ctypes.c_int64 for is_array in self.is_array)
        blocks = -(-threads // THREADS_PER_BLOCK)
        if not blocks:
            return
        own = self.device
        own.current()
        own.driver.call("cuLaunchKernel", self.function, blocks, 1, 1, THREADS_PER_BLOCK, 1, 1, 0, 0, (values, kinds), 0)
        own.driver.call("cuCtxSynchronize")
