"""Storage of a sweep: labelled arrays in memory, or in a Zarr folder that grows with the finished members."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np

from gauss.errors import FileError, SimulationError, extra
from gauss.scene.named_numbers import unit_of
from gauss.simulation.sweeps.batch import DONE, FAILED, LONGEST_REASON, MISSING, MemberResults, SweepTask
from gauss.simulation.sweeps.parameters import Members
from gauss.system import System, coordinate_units, rate_units
from gauss.system.coordinate_names import axis_labels

PIECE_MEMBERS = 512  # members that are simulated, and written, at once


def pieces(members: Members) -> Iterator[tuple[int, int]]:
    """Spans begin … end of members, each a block of the arrays."""
    shape, inner, axis = members.shape, 1, len(members.shape) - 1
    while axis > 0 and inner * shape[axis] <= PIECE_MEMBERS:
        inner, axis = inner * shape[axis], axis - 1
    rows = max(1, PIECE_MEMBERS // inner)
    for outer in range(0, members.size, inner * shape[axis]):
        for row in range(0, shape[axis], rows):
            yield outer + row * inner, outer + min(row + rows, shape[axis]) * inner


def block(members: Members, begin: int, end: int) -> dict[str, slice]:
    """Slices of a span of members along each dimension."""
    first, last = (np.unravel_index(place, members.shape) for place in (begin, end - 1))
    return {dim: slice(int(a), int(b) + 1) for dim, a, b in zip(members.dims, first, last, strict=True)}


def empty(task: SweepTask, system: System, about: dict):
    """Empty dataset (xarray) of a sweep.

    Dimensions are the parameters, or ``member`` if all are varied together, then ``time`` and ``coordinate`` or ``rate``.
    SimulationError if a measured quantity has the name of another variable of the dataset.
    """
    xarray, members = library("xarray"), task.members
    coordinates, rates = coordinate_units(system), rate_units(system)
    held: dict[str, tuple] = {"time": ("time", task.times, {"units": "s", "long_name": "time"})} | axis_labels(system)
    for name, values in zip(members.names, members.values, strict=True):
        unit = unit_of(name, coordinates, rates)
        held[name] = ("member" if members.together else name, values, {"units": unit} if unit else {})
    k, dims, shape = len(task.times), members.dims, members.shape
    words = {"flag_values": [MISSING, DONE, FAILED], "flag_meanings": "missing done failed"}

    def unknown(*sizes, value=np.nan, dtype=float):
        return np.broadcast_to(np.array(value, dtype=dtype), (*shape, *sizes))

    data: dict[str, tuple] = {
        "q": (
            (*dims, "time", "coordinate"),
            unknown(k, system.n_q),
            {"long_name": "coordinates", "units": "see coordinate_unit"},
        ),
        "v": ((*dims, "time", "rate"), unknown(k, system.n_v), {"long_name": "rates", "units": "see rate_unit"}),
        "reason": (dims, unknown(value="", dtype=f"<U{LONGEST_REASON}"), {"long_name": "why a member failed"}),
    }
    words_of_energy = {"long_name": "energy balance is off by, relative to the largest energy", "units": "1"}
    data["energy_error"] = (dims, unknown(), words_of_energy)
    data["status"] = (dims, unknown(value=MISSING, dtype=np.int8), words)
    taken = sorted({*data, *held, *dims} & {*task.measure})
    if taken:
        names_taken = ", ".join(map(repr, taken))
        raise SimulationError(
            f"measure: {names_taken}: the dataset of a sweep has this already; expected a name of its own. "
            f"It has {', '.join(map(repr, [*data, *held]))}."
        )
    data |= {name: (dims, unknown()) for name in task.measure}
    return xarray.Dataset(data, held, about)


class InMemory:
    """Dataset in memory, a copy of an empty one."""

    def __init__(self, dataset):
        self.dataset = dataset.copy(deep=True)

    @property
    def status(self) -> np.ndarray:
        """Status of all members."""
        return self.dataset.status.values.ravel()

    def write(self, place: dict[str, slice], results: MemberResults):
        """Fill a block."""
        for name, values in _arrays(results).items():
            room = self.dataset[name].isel(place)
            room.values[...] = values.reshape(room.shape)


class OnDisk:
    """Dataset in a Zarr folder called ….zarr: an empty one to begin with, or that of an interrupted sweep, which goes on.

    ``piece``: sizes of a block by dimension. FileError if something else is there.
    """

    def __init__(self, path: Path, dataset, piece: dict[str, slice]):
        library("zarr")
        if path.suffix != ".zarr":
            raise FileError(f"{path}: a sweep is kept in a folder called ….zarr; to_netcdf of the result writes a file.")
        self.path, self.empty = path, dataset
        if path.exists():
            self._check(path, dataset)
            return
        sizes = {dim: entry.stop - entry.start for dim, entry in piece.items()}
        encoding = {
            name: {"chunks": tuple(sizes.get(dim, dataset.sizes[dim]) for dim in array.dims)}
            for name, array in dataset.data_vars.items()
        }
        dataset.to_zarr(path, encoding=encoding, zarr_format=2, consolidated=True)

    def _check(self, path: Path, dataset):
        try:
            there = library("xarray").open_zarr(path, chunks=None).attrs.get("sweep_sha256")
        except (OSError, KeyError, ValueError) as error:
            raise FileError(f"{path}: is there, but no sweep that could go on: {error}.") from error
        if there != dataset.attrs["sweep_sha256"]:
            raise FileError(
                f"{path}: holds another sweep: its scene, values, samples or settings differ. Choose another path, "
                "or remove it."
            )

    @property
    def dataset(self):
        """Dataset whose arrays are read when they are asked for."""
        return library("xarray").open_zarr(self.path, chunks=None)

    @property
    def status(self) -> np.ndarray:
        """Status of all members."""
        return self.dataset.status.values.ravel()

    def write(self, place: dict[str, slice], results: MemberResults):
        """Write a block; its status last, so that finished members are complete."""
        known, index = self.empty.isel(place).drop_vars(list(self.empty.coords)), {"region": place, "zarr_format": 2}
        given = _arrays(results).items()
        arrays = {name: known[name].copy(data=values.reshape(known[name].shape)) for name, values in given}
        status = arrays.pop("status")
        for some in (arrays, {"status": status}):
            library("xarray").Dataset(some).to_zarr(self.path, **index)


def _arrays(results: MemberResults) -> dict[str, np.ndarray]:
    return {
        "q": results.q,
        "v": results.v,
        "reason": results.reason,
        "energy_error": results.energy_error,
        **results.measured,
        "status": results.status,
    }


def library(name: str):
    """Package of the extra ``sweep``."""
    with extra("sweep"):
        return import_module(name)
