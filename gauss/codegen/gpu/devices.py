"""Devices by their names: "cuda", "cuda:1", "lanes" (this CPU lane by lane), several of them, "cuda float32"."""

import re
from functools import cache

from gauss.codegen.gpu.cuda import CudaDevice
from gauss.codegen.gpu.device import Device
from gauss.codegen.gpu.lane_by_lane import LaneByLane
from gauss.errors import ArgumentError

SINGLE = "float32"
NAME = re.compile(rf"(?:cuda(?::(?P<number>\d{{1,3}}))?|(?P<lanes>lanes))(?P<single> {SINGLE})?")


def device_name(given) -> str:
    """Name of one device, or of several: "cuda:0", "cuda:0,cuda:1", "cuda:0 float32".

    Parameters
    ----------
    given : str or sequence of str
        "cuda" or "cuda:0" for the first GPU, "cuda:1" for the second; "lanes" for this CPU, one thread after the other;
        with " float32" behind it for single precision. A sequence of such names shares a batch.

    Raises
    ------
    ArgumentError
        If it is no such name, or GPUs and this CPU are to share a batch.
    """
    names = given.split(",") if isinstance(given, str) else given if isinstance(given, list | tuple) and given else [given]
    found = [NAME.fullmatch(name.strip()) if isinstance(name, str) else None for name in names]
    matches = [match for match in found if match]
    if len(matches) < len(names):
        raise ArgumentError(
            f"device: expected 'cuda', 'cuda:NUMBER' or 'lanes' (this CPU, lane by lane), several of them in a list, "
            f"or 'cuda {SINGLE}', got {given!r}."
        )
    if len({match["lanes"] for match in matches}) > 1 or len({match["single"] for match in matches}) > 1:
        raise ArgumentError(f"device: expected devices of one kind, in one precision, got {given!r}.")
    own = ("lanes" if match["lanes"] else f"cuda:{int(match['number'] or 0)}" for match in matches)
    return ",".join(own) + (matches[0]["single"] or "")


def is_single(name: str) -> bool:
    """Whether a name asks for single precision."""
    return name.endswith(SINGLE)


def devices(name: str) -> tuple[Device, ...]:
    """Devices of a name.

    Parameters
    ----------
    name : str
        As of :func:`device_name`.

    Raises
    ------
    ArgumentError
        If it is no such name.
    MissingPackageError
        If cuda-bindings is not installed.
    DeviceError
        If there is no driver, or no such device.
    """
    own = device_name(name).partition(" ")[0].split(",")
    return tuple(_device(None if one == "lanes" else int(one.partition(":")[2])) for one in own)


def device(name: str) -> Device:
    """The first of the devices of a name; see :func:`devices`."""
    return devices(name)[0]


@cache
def _device(number: int | None) -> Device:
    found: Device = LaneByLane() if number is None else CudaDevice(number)
    return found
