"""Devices by their names: "cuda", "cuda:1", "lanes" (this CPU lane by lane), several of them, "cuda float32"."""

import re
from functools import cache

from gauss.codegen.gpu.cuda import CudaDevice
from gauss.codegen.gpu.device import Device
from gauss.codegen.gpu.lane_by_lane import LaneByLane
from gauss.errors import ArgumentError, DeviceError

SINGLE = "float32"
NAME = re.compile(rf"(?:cuda(?::(?P<number>\d{{1,3}}))?|(?P<lanes>lanes))(?P<single> {SINGLE})?")


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
