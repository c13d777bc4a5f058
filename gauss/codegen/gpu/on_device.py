"""Code for devices that is kept on disk as text, and loaded on each device at its first use; batches go there in parts.

Parts go to several devices at once, each as large as the memory of its device allows.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Lock

from gauss.codegen.gpu.devices import Device, DeviceProgram, devices
from gauss.codegen.gpu.thread_code import Lowered
from gauss.errors import DeviceError

SHARE_OF_MEMORY = 0.8  # of the free memory of a device: other libraries and its driver need some


class OnDevice:
    """Base of code for a device, or for several: what is kept on disk is its text, which is loaded at the first use."""

    def __init__(self, name: str, lowered: Lowered):
        self.device_name, self.lowered = name, lowered
        self._programs: dict[str, DeviceProgram] = {}

    def __getstate__(self) -> dict:
        return vars(self) | {"_programs": {}}

    @property
    def devices(self) -> tuple[Device, ...]:
        """The devices."""
        return devices(self.device_name)

    def program(self, device: Device) -> DeviceProgram:
        """The code on a device."""
        found = self._programs.get(device.name)
        if found is None:
            found = self._programs[device.name] = device.program(self.lowered)
        return found

    def run(self, device: Device, threads: int, arguments: Sequence):
        """Run the threads on a device, and wait for them."""
        self.program(device)(threads, arguments, device.stream)

    def in_parts(self, count: int, bytes_of_one: int, work: Callable[[Device, slice], None], what: str):
        """Work on parts of a batch, as :func:`gauss.codegen.gpu.on_device.in_parts`, beside the frames of the threads."""
        free_bytes = lambda device: device.free_bytes() - self.program(device).memory_bytes  # noqa: E731
        in_parts(self.devices, free_bytes, count, bytes_of_one, work, what)


def in_parts(
    devices: Sequence[Device],
    free_bytes: Callable[[Device], int],
    count: int,
    bytes_of_one: int,
    work: Callable[[Device, slice], None],
    what: str,
):
    """Work on all parts of a batch; devices take the parts that are left, one after the other, until one fails.

    DeviceError if one member alone does not fit.

    Parameters
    ----------
    free_bytes : callable
        Memory of a device that a batch may take [bytes].
    count : int
        Length of the batch.
    bytes_of_one : int
        Memory of one member [bytes].
    work : callable
        ``work(device, part)``.
    what : str
        What one member is, and what makes it smaller, for the message.
    """
    lock, begun = Lock(), 0

    def part_for(device: Device) -> slice:
        nonlocal begun
        free = SHARE_OF_MEMORY * free_bytes(device)
        fits = int(free / max(bytes_of_one, 1))
        if fits < 1:
            raise DeviceError(
                f"device {device.name!r}: {what} ({bytes_of_one / 1e6:.4g} MB; {max(free, 0) / 1e6:.4g} MB are there)."
            )
        with lock:
            first = begun
            begun = min(begun + min(fits, -(-count // len(devices))), count)
            return slice(first, begun)

    def run(device: Device):
        nonlocal begun
        try:
            while begun < count:
                part = part_for(device)
                if part.stop > part.start:
                    work(device, part)
        except BaseException:
            begun = count
            raise

    if len(devices) == 1:
        run(devices[0])
        return
    with ThreadPoolExecutor(len(devices)) as pool:
        for done in [pool.submit(run, device) for device in devices]:
            done.result()
