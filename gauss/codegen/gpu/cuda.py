"""GPUs of NVIDIA by the CUDA driver; cuda-bindings is imported when a device is asked for.

The driver compiles PTX for the device and caches the result. A program waits for its threads, in the stream that it was
given, so that an error is raised where it happens.
"""

import copy
import ctypes
from collections.abc import Sequence

import numpy as np

from gauss.codegen.gpu.cuda_driver import driver
from gauss.codegen.gpu.cuda_memory import CudaArray, CudaView, stream_handle
from gauss.codegen.gpu.ptx import LEAST_CAPABILITY, ptx, refuse_libraries
from gauss.codegen.gpu.thread_code import THREADS_PER_BLOCK, Lowered, ThreadCode
from gauss.errors import DeviceError

NEWEST_CAPABILITY = 90  # PTX for it runs on later devices, too
LOG_BYTES = 8192  # of the messages of the driver's compiler
WARP = 32


class CudaDevice:
    """One GPU.

    MissingPackageError if cuda-bindings is not installed.
    DeviceError if there is no driver, no such device, or it is too old.

    Attributes
    ----------
    name : str
        Its name, such as "cuda:0".
    stream : int
        Stream of copies and programs; 0 is the default stream.
    """

    def __init__(self, number: int = 0):
        self.driver, self.number, self.name, self.stream = driver(), number, f"cuda:{number}", 0
        count = self.driver.call("cuDeviceGetCount")
        if number >= count:
            raise DeviceError(f"device {self.name!r} does not exist: the driver has {count}, numbered from 0.")
        device = self.driver.call("cuDeviceGet", number)
        major, minor = (self.driver.attribute(f"COMPUTE_CAPABILITY_{part}", device) for part in ("MAJOR", "MINOR"))
        if 10 * major + minor < LEAST_CAPABILITY:
            raise DeviceError(f"device {self.name!r} has compute capability {major}.{minor}; at least 6.0 is needed.")
        self.capability = min(10 * major + minor, NEWEST_CAPABILITY)
        names = "MULTIPROCESSOR_COUNT", "MAX_THREADS_PER_MULTIPROCESSOR"
        self.resident_threads = int(np.prod([self.driver.attribute(name, device) for name in names]))
        self.context = self.driver.call("cuDevicePrimaryCtxRetain", device)

    def entered(self):
        """Context in which the calls of this thread go to the device."""
        return self.driver.entered(self.context)

    def on(self, stream) -> "CudaDevice":
        """The device with another stream; None is the default stream."""
        if stream is None:
            return self
        found = copy.copy(self)
        found.stream = stream_handle(stream)
        return found

    def lowered(self, code: ThreadCode) -> Lowered:
        """Thread code as LLVM IR; PTX is made where the code is loaded, for that device."""
        text = code.gpu_text()
        refuse_libraries(text)
        return Lowered(code.name, text, code.is_array)

    def program(self, lowered: Lowered) -> "CudaProgram":
        """Thread code, ready to run."""
        return CudaProgram(self, lowered)

    def view(self, given) -> CudaView | None:
        """An array of another library on this GPU, as it is; None if it is on none.

        What writes to it has ended, or comes before in the stream of this device.
        """
        if not hasattr(given, "__cuda_array_interface__"):
            return None
        found = CudaView(self, given)
        if hasattr(given, "block_until_ready"):  # of JAX: what writes to it may be in no stream yet
            given.block_until_ready()
        elif not self.stream:
            found.wait()
        return found

    def put(self, array: np.ndarray) -> CudaArray:
        """Copy of an array in the memory of the device."""
        found = self.empty(np.shape(array))
        found.put(array)
        return found

    def empty(self, shape: tuple[int, ...]) -> CudaArray:
        """Array in the memory of the device, not initialised."""
        return CudaArray(self, shape)

    def copied(self, pointer: int, target: np.ndarray) -> np.ndarray:
        """``target`` (contiguous), overwritten with the numbers at an address of the device."""
        if target.nbytes:
            with self.entered():
                self.driver.call("cuMemcpyDtoHAsync", target.ctypes.data, pointer, target.nbytes, self.stream)
                self.driver.call("cuStreamSynchronize", self.stream)
        return target

    def free_bytes(self) -> int:
        """Free memory [bytes]."""
        with self.entered():
            return int(self.driver.call("cuMemGetInfo")[0])


class CudaProgram:
    """Thread code on a GPU.

    DeviceError if the driver refuses the code.

    Attributes
    ----------
    threads_per_block : int
        Threads that start together; fewer where each takes many registers.
    memory_bytes : int
        Memory that the driver takes for the frames of all threads at once [bytes].
    """

    def __init__(self, device: CudaDevice, lowered: Lowered):
        self.device, own, api = device, device.driver, device.driver.api
        self.kinds = tuple(ctypes.c_void_p if is_array else ctypes.c_longlong for is_array in lowered.is_array)
        log = bytearray(LOG_BYTES)  # the driver writes to it: no other thread has it
        options = [api.CUjit_option.CU_JIT_ERROR_LOG_BUFFER, api.CUjit_option.CU_JIT_ERROR_LOG_BUFFER_SIZE_BYTES]
        text = ptx(lowered.text, device.capability).encode() + b"\0"
        with device.entered():
            try:
                self.module = own.call("cuModuleLoadDataEx", text, 2, options, [log, LOG_BYTES])
            except DeviceError as error:
                words = bytes(log).split(b"\0")[0].decode(errors="replace").strip()
                raise DeviceError(f"{error} {words}".strip()) from None
            self.function = own.call("cuModuleGetFunction", self.module, lowered.name.encode())
            names = "LOCAL_SIZE_BYTES", "MAX_THREADS_PER_BLOCK"
            attributes = (getattr(api.CUfunction_attribute, f"CU_FUNC_ATTRIBUTE_{name}") for name in names)
            frame_bytes, most = (int(own.call("cuFuncGetAttribute", attribute, self.function)) for attribute in attributes)
        self.threads_per_block = min(THREADS_PER_BLOCK, most // WARP * WARP)
        self.memory_bytes = frame_bytes * device.resident_threads

    def __del__(self):
        if hasattr(self, "module"):
            try:
                with self.device.entered():
                    self.device.driver.api.cuModuleUnload(self.module)
            except Exception:  # at the end of the process, the driver has unloaded it already
                del self.module

    def __call__(self, threads: int, arguments: Sequence, stream: int = 0):
        """Run the threads in a stream, and wait for them."""
        values = tuple(given.pointer if hasattr(given, "pointer") else int(given) for given in arguments)
        blocks, own = -(-threads // self.threads_per_block), self.device.driver
        if not blocks:
            return
        grid = (blocks, 1, 1, self.threads_per_block, 1, 1)
        with self.device.entered():
            own.call("cuLaunchKernel", self.function, *grid, 0, stream, (values, self.kinds), 0)
            own.call("cuStreamSynchronize", stream)
