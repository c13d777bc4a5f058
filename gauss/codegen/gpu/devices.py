"""Devices by their names: "cuda", "cuda:1", and "lanes", this CPU lane by lane."""

import re
from functools import cache

from gauss.codegen.gpu.cuda import CudaDevice
from gauss.codegen.gpu.device import Device
from gauss.codegen.gpu.lane_by_lane import LaneByLane
from gauss.errors import ArgumentError


def device(name: str) -> Device:
    """Device of a name.

    Parameters
    ----------
    name : str
        "cuda" or "cuda:0" for the first GPU, "cuda:1" for the second; "lanes" for this CPU, one thread after the other.

    Raises
    ------
    ArgumentError
        If it is no such name.
    MissingPackageError
        If cuda-bindings is not installed.
    DeviceError
        If there is no driver, or no such device.
    """
    found = re.fullmatch(r"cuda(?::(\d{1,3}))?|lanes", name) if isinstance(name, str) else None
    if found is None:
        raise ArgumentError(f"device: expected 'cuda', 'cuda:NUMBER' or 'lanes' (this CPU, lane by lane), got {name!r}.")
    return _device(None if name == "lanes" else int(found[1] or 0))


@cache
def _device(number: int | None) -> Device:
    found: Device = LaneByLane() if number is None else CudaDevice(number)
    return found
