"""Code for devices that is kept on disk as text, and loaded on each device at its first use."""

from collections.abc import Callable, Sequence

from gauss.codegen.gpu.device import Device, DeviceProgram, Lowered
from gauss.codegen.gpu.devices import devices
from gauss.codegen.gpu.parts import in_parts


class OnDevice:
    """Base of code for a device, or for several: what is kept on disk is its text, which is loaded at the first use.

    Parameters
    ----------
    name : str
        Name of the devices.
    lowered : Lowered
        The code.
    """

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
        """Work on parts of a batch, as :func:`gauss.codegen.gpu.parts.in_parts`, beside the frames of the threads."""
        free_bytes = lambda device: device.free_bytes() - self.program(device).memory_bytes  # noqa: E731
        in_parts(self.devices, free_bytes, count, bytes_of_one, work, what)
