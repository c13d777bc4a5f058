"""Checks of the CUDA path with cuda-bindings itself and a driver that is a stub: run in a process of its own.

Arguments travel as they would to a GPU: PTX is loaded, parameters are packed by cuda-bindings, and the stub reads them from
memory. Programs run lane by lane on this CPU.
"""

import ctypes
import multiprocessing
import re
import threading
from typing import Any, cast

import numpy as np
from cuda.bindings import driver

import gauss
from gauss import doctor
from gauss.codegen import machine, write
from gauss.codegen.gpu import cuda, devices
from gauss.codegen.gpu.cuda_driver import device_names
from gauss.codegen.gpu.thread_code import states_code
from gauss.errors import DeviceError
from tests.support import mechanisms

stub = ctypes.CDLL("libcuda.so.1")
stub.stub_room_of.argtypes, stub.stub_room_of.restype = [ctypes.c_size_t, ctypes.POINTER(ctypes.c_int)], ctypes.c_size_t
stub.stub_alloc.argtypes, stub.stub_alloc.restype = [ctypes.c_size_t, ctypes.c_int], ctypes.c_size_t
stub.stub_memory.argtypes = [ctypes.c_size_t]
LAUNCH = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_long, ctypes.c_int, ctypes.POINTER(ctypes.c_void_p)
)
ILLEGAL_ADDRESS = 700
FREE = 1 << 30  # bytes
FRAMES = 64 * 132 * 2048  # bytes of all threads at once
on_cpu: dict[bytes, tuple[str, tuple[bool, ...]]] = {}  # code of this CPU for PTX
used: list[int] = []  # devices of programs


def key(text: bytes) -> bytes:
    """PTX without its comments, which number the calls of a process."""
    return re.sub(rb"//.*", b"", text)


@LAUNCH
def launch(text, name, threads, device, parameters):
    """Run a program lane by lane; arrays have to lie on its device."""
    own, is_array = on_cpu[key(text)]
    values, where = [], ctypes.c_int(-1)
    for k, one in enumerate(is_array):
        values.append(ctypes.cast(parameters[k], ctypes.POINTER(ctypes.c_int64))[0])
        if one and (not stub.stub_room_of(values[-1], ctypes.byref(where)) or where.value != device):
            return ILLEGAL_ADDRESS
    kinds = [ctypes.c_void_p if one else ctypes.c_int64 for one in is_array]
    entry = machine.load(own).entry(name.decode(), ctypes.CFUNCTYPE(None, ctypes.c_int64, *kinds))
    entry.call(threads, *values)
    used.append(device)
    return 0


class Recorded(cuda.CudaDevice):
    """Device that keeps the code of this CPU beside the PTX."""

    def lowered(self, code):
        """As of the base."""
        found = super().lowered(code)
        on_cpu[key(cuda.ptx(found.text, self.capability).encode())] = code.cpu_text(), found.is_array
        return found


class Foreign:
    """Array of another library on a device of the stub."""

    def __init__(self, array: np.ndarray, device: int = 0, **more):
        whole = np.ascontiguousarray(array)
        self.pointer = stub.stub_alloc(whole.nbytes, device)
        ctypes.memmove(self.pointer, whole.ctypes.data, whole.nbytes)
        self.__cuda_array_interface__ = {
            "shape": array.shape,
            "strides": None,
            "typestr": whole.dtype.str,
            "data": (self.pointer, False),
            "version": 3,
        } | more


class Waited(Foreign):
    """Array as of JAX, which has to be asked whether it is there."""

    count = 0

    def block_until_ready(self):
        """Count the calls."""
        self.count += 1


class TorchStream:
    def __init__(self, handle: int):
        self.cuda_stream = handle


def refused(action, *words: str):
    """Call what a DeviceError refuses, with these words."""
    try:
        action()
    except DeviceError as error:
        assert all(word in str(error) for word in words), error
        return
    raise AssertionError(f"expected a DeviceError with {words}")


def check_batches(system, q, v):
    run: dict[str, Any] = {"steps": 20, "step": 1e-3, "every": 10}
    here = gauss.rollout(system, q, v, **run)
    for device in ("cuda", "cuda:1", ["cuda:0", "cuda:1"]):
        used.clear()
        assert np.array_equal(gauss.rollout(system, q, v, device=device, **run).q, here.q)
        assert set(used) == ({0, 1} if isinstance(device, list) else {int(device[-1]) if ":" in device else 0})
    adaptive: dict[str, Any] = {"integrator": "dop853", "times": [0.05, 0.1], "rtol": 1e-9}
    there = gauss.rollout(system, q, v, device="cuda", **adaptive)
    assert np.array_equal(there.q, gauss.rollout(system, q, v, **adaptive).q)


def check_functions(system, q, v):
    f, right = system.function("forward_dynamics", device="cuda"), system.forward_dynamics(q, v, v)
    assert np.array_equal(f(q, v, v), right)
    found = f(*map(Foreign, (q, v, v)))
    assert np.array_equal(found.numpy(), right) and found.__cuda_array_interface__["stream"] is None
    assert np.array_equal(f(found, v, v).numpy(), system.forward_dynamics(right, v, v))
    assert np.array_equal(system.function("forward_dynamics", device=["cuda:0", "cuda:1"])(q, v, v), right)
    single = system.function("forward_dynamics", device="cuda float32")
    assert np.abs(single(q, v, v) - right).max() <= 1e-4 * np.abs(right).max() and 0.0 < single.error < 1e-4
    refused(lambda: f(Foreign(q, 1), v, v), "cuda:1")
    for wish in ({"copy": True}, {"dl_device": (1, 0)}):
        try:
            found.__dlpack__(**wish)
        except BufferError:
            continue
        raise AssertionError(f"expected a BufferError for {wish}")
    assert found.__dlpack__(copy=False, dl_device=(2, 0), stream=1)
    return f, right


def check_programs():
    """A program that nobody has any more leaves its device."""
    device, modules = devices.device("cuda"), stub.stub_modules()
    program = device.program(device.lowered(states_code(write(lambda x: x * x, 2))))
    assert stub.stub_modules() == modules + 1
    del program
    assert stub.stub_modules() == modules


def check_streams(f, right, q, v):
    _, context = driver.cuDevicePrimaryCtxRetain(0)
    driver.cuCtxPushCurrent(context)  # as another library does; it stays
    _, made = driver.cuStreamCreate(1)
    for stream in (made, TorchStream(int(made))):
        assert np.array_equal(f(q, v, v, stream=stream), right)
    assert np.array_equal(f(Foreign(q, stream=1), Foreign(v, stream=None), v).numpy(), right)
    result = f(Foreign(q), v, v, stream=made)
    assert not result.device.stream and np.array_equal(result.numpy(), right)  # which outlives the stream
    waited = Waited(q)
    assert np.array_equal(f(waited, v, v, stream=made).numpy(), right) and waited.count == 1
    refused(lambda: f(q, v, v, stream=12345), "stream")
    refused(lambda: f(q, v, v, stream="a"), "stream")


def check_errors(system, f, q, v):
    for call, status, words in (
        ("cuMemAlloc", 2, ("OUT_OF_MEMORY", "free arrays")),
        ("cuLaunchKernel", 702, ("LAUNCH_TIMEOUT", "fewer steps")),
        ("cuStreamSynchronize", 700, ("ILLEGAL_ADDRESS", "new one")),
    ):
        stub.stub_fail(call.encode(), status)
        refused(lambda: f(q, v, v), *words)  # noqa: B023
    fresh = system.function("bias_forces", device="cuda")
    stub.stub_fail(b"cuModuleLoadDataEx", 222)
    refused(lambda: fresh(q, v), "UNSUPPORTED_PTX_VERSION", "update")
    refused(lambda: cuda.CudaProgram(cast(cuda.CudaDevice, devices.device("cuda")), cuda.Lowered("run", "", ())), "no PTX")
    stub.stub_memory(1000)  # of a GPU that others use
    finding = doctor._gpu()
    assert finding.works and "does not fit" in finding.text
    stub.stub_memory(FRAMES + 60_000)  # beside the arrays of the other library: the batch is split
    assert np.array_equal(f(q, v, v), system.forward_dynamics(q, v, v))
    stub.stub_memory(FREE)


def in_child(f, q, v, answers):
    try:
        f(q, v, v)
    except DeviceError as error:
        answers.put(str(error))


def check_fork(f, q, v):
    forked = multiprocessing.get_context("fork")
    answers = forked.Queue()
    child = forked.Process(target=in_child, args=(f, q, v, answers))
    child.start()
    assert "spawn" in answers.get(timeout=60)
    child.join()
    assert child.exitcode == 0


def main():
    """All checks; contexts are left as they were, and nothing stays on a device."""
    cuda_ptx, patched = cuda.ptx, cast(Any, cuda)
    patched.ptx = lambda text, capability: cuda_ptx(text, capability) if text else "nothing"
    stub.stub_launch(launch)
    cast(Any, devices).CudaDevice = Recorded
    assert device_names() == ["stub 0", "stub 1"]
    system = gauss.compile_scene(mechanisms.chain([1.0, 2.0, 0.5]))
    q, v = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 300, 3))
    check_batches(system, q, v)
    f, right = check_functions(system, q, v)
    check_programs()
    assert stub.stub_depth() == 0
    check_streams(f, right, q, v)
    check_errors(system, f, q, v)
    rooms = stub.stub_rooms()
    thread = threading.Thread(target=lambda: f(q, v, v))
    thread.start()
    thread.join()
    check_fork(f, q, v)
    finding = doctor._gpu()
    assert finding.works and "cuda:1 stub 1: programs run and are right" in finding.text
    assert stub.stub_rooms() == rooms and stub.stub_depth() == 1  # the context of the other library
    refused(lambda: devices.device("cuda:2"), "cuda:2")
    print("all checks passed")


if __name__ == "__main__":
    main()
