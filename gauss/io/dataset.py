"""Motions as labelled arrays and tables: xarray, netCDF, pandas. Needs pip install 'gauss[results]'."""

import hashlib
import platform
import tomllib
from dataclasses import fields
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from gauss.audit import energy, reactions
from gauss.dynamics import compile_scene
from gauss.errors import FileError, require
from gauss.io.toml import from_tables, toml_text
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.simulation.trajectory import Event, Stats
from gauss.system import coordinate_units, rate_units

AXES, COMPONENTS = ("x", "y", "z"), ("w", "x", "y", "z")
MADE_BY = ("gauss", "numpy", "scipy", "llvmlite")


def to_dataset(trajectory: Trajectory, joints=()):
    """Motion as an xarray Dataset: named dimensions, units in the attributes, and how it was made.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    joints : iterable of str
        Joints whose reactions are wanted, too; each sample of them is an instant to solve.

    Returns
    -------
    xarray.Dataset
        * ``q`` (time, coordinate) and ``v`` (time, rate), units in ``coordinate_unit`` and ``rate_unit``;
        * ``position`` (time, body, axis) [m] of the body frames, ``orientation`` (time, body, component), unit quaternions;
        * ``kinetic``, ``potential``, ``drives``, ``loads``, ``dissipated``, ``balance`` (time) [J];
        * ``reaction_force`` [N] and ``reaction_moment`` [N m] (time, joint, axis) of ``joints``;
        * ``event_time`` [s], ``event_kind``, ``event_gaps``, ``event_loss`` [J] (event).

        Attributes: the scene as TOML and its SHA-256, versions, settings and cost of the simulation.

    Raises
    ------
    FileError
        If xarray is not installed.
    """
    require(trajectory, (Trajectory,), "to_dataset")
    xarray = _library("xarray")
    system, (positions, rotations) = trajectory.system, trajectory.poses()
    coordinates, rates = coordinate_units(system), rate_units(system)
    held = {
        "time": ("time", trajectory.t, {"units": "s", "long_name": "time"}),
        "coordinate": list(coordinates),
        "coordinate_unit": ("coordinate", list(coordinates.values())),
        "rate": list(rates),
        "rate_unit": ("rate", list(rates.values())),
        "body": list(system.structure.bodies),
        "axis": list(AXES),
        "component": list(COMPONENTS),
    }
    data = {
        "q": (("time", "coordinate"), trajectory.q, {"long_name": "coordinates", "units": "see coordinate_unit"}),
        "v": (("time", "rate"), trajectory.v, {"long_name": "rates of the coordinates", "units": "see rate_unit"}),
        "position": (("time", "body", "axis"), positions, {"units": "m", "long_name": "origins of the body frames"}),
        "orientation": (
            ("time", "body", "component"),
            _quaternions(rotations),
            {"units": "1", "long_name": "rotations from the body frames to world"},
        ),
    }
    data |= {name: ("time", row, {"units": "J"}) for name, row in energies(trajectory).items()}
    data |= _events(trajectory)
    if joints:
        found = [reactions(trajectory, joint) for joint in joints]
        held["joint"] = list(joints)
        for part, unit in (("force", "N"), ("moment", "N m")):
            values = np.stack([getattr(reaction, part) for reaction in found], axis=1)
            about = {"units": unit, "long_name": f"{part} of the parent on the child at the joint, world axes"}
            data[f"reaction_{part}"] = (("time", "joint", "axis"), values, about)
    return xarray.Dataset(data, held, provenance(trajectory))


def to_table(trajectory: Trajectory):
    """Motion as a pandas DataFrame: one row a sample, coordinates, rates and energies with their units in the names.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.

    Returns
    -------
    pandas.DataFrame
        Indexed by time [s].

    Raises
    ------
    FileError
        If pandas is not installed.
    """
    require(trajectory, (Trajectory,), "to_table")
    table = _library("pandas").DataFrame(columns(trajectory))
    return table.set_index("t [s]")


def columns(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Times, coordinates, rates and energies of a motion by name and unit."""
    system = trajectory.system
    found = {"t [s]": trajectory.t}
    for letter, units, values in (("q", coordinate_units(system), trajectory.q), ("v", rate_units(system), trajectory.v)):
        found |= {f"{letter} {name} [{units[name]}]": column for name, column in zip(units, values.T, strict=True)}
    return found | {f"{name} [J]": row for name, row in energies(trajectory).items()}


def energies(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Energies (k,) [J] by name."""
    found = energy(trajectory)
    return {name: getattr(found, name) for name in ("kinetic", "potential", "drives", "loads", "dissipated", "balance")}


def provenance(trajectory: Trajectory) -> dict[str, str | float]:
    """How a motion was made: scene, versions, settings, cost; texts and numbers, as netCDF takes them."""
    made = {"title": f"motion of {trajectory.system.scene.name}", "scene": trajectory.system.scene.name}
    made |= scene_text(trajectory.system.scene) | made_by()
    about = [("setting", trajectory.settings), ("cost", vars(trajectory.stats))]
    return made | {f"{kind}_{key}": _plain(value) for kind, of in about for key, value in of.items() if value is not None}


def write_netcdf(trajectory: Trajectory, path):
    """Write the Dataset of a motion as netCDF 4, which any netCDF or HDF5 reader reads."""
    _library("h5netcdf")
    to_dataset(trajectory).to_netcdf(path, engine="h5netcdf")
    return path


def load_motion(path) -> Trajectory:
    """Motion of a file that :func:`write_netcdf` wrote.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    Trajectory
        The motion, its system compiled from the scene in the file.

    Raises
    ------
    FileError
        If it is no such file, or its scene was made of Python functions, which no file can hold.
    """
    try:
        with _library("xarray").open_dataset(path, engine="h5netcdf") as file:
            found = file.load()
        about = found.attrs
        columns = [found[name].values for name in ("time", "q", "v")]
        work = np.stack([found[name].values for name in ("drives", "loads", "dissipated")], axis=1)
        stats = Stats(**{f.name: _read(about[f"cost_{f.name}"]) for f in fields(Stats) if f"cost_{f.name}" in about})
        events = zip(*(found[f"event_{name}"].values.tolist() for name in ("time", "kind", "gaps", "loss")), strict=True)
        events = tuple(Event(t, kind, tuple(gaps.split(", ")), loss) for t, kind, gaps, loss in events)
        text, names = about["scene_toml"], found["rate"].values.tolist()
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise FileError(f"{path}: not a motion that gauss wrote: {error}.") from error
    if not text:
        raise FileError(f"{path}: holds numbers but no scene: {about.get('scene_remark', 'none was written')}.")
    system = compile_scene(from_tables(tomllib.loads(text)))
    if list(system.coordinates) != names or columns[1].shape[1:] != (system.n_q,):
        raise FileError(f"{path}: its numbers do not belong to its scene: rates {', '.join(names)}.")
    settings = {key.removeprefix("setting_"): _read(value) for key, value in about.items() if key.startswith("setting_")}
    return Trajectory(system, *columns, work, stats, events, settings=settings)


def made_by() -> dict[str, str]:
    """Versions of the packages that numbers depend on."""
    return {f"version_{name}": _version(name) for name in MADE_BY} | {"version_python": platform.python_version()}


def scene_text(scene: Scene) -> dict[str, str]:
    """Scene as TOML and its SHA-256; empty, with a remark, where no file can hold it."""
    try:
        text = toml_text(scene)
    except FileError as error:
        return {"scene_toml": "", "scene_sha256": "", "scene_remark": f"cannot be written as a file: {error}"}
    return {"scene_toml": text, "scene_sha256": hashlib.sha256(text.encode()).hexdigest()}


def _events(trajectory: Trajectory) -> dict:
    events = trajectory.events
    return {
        "event_time": ("event", np.array([event.t for event in events], dtype=float), {"units": "s"}),
        "event_kind": ("event", np.array([event.kind for event in events], dtype=str)),
        "event_gaps": ("event", np.array([", ".join(event.gaps) for event in events], dtype=str)),
        "event_loss": ("event", np.array([event.loss for event in events], dtype=float), {"units": "J"}),
    }


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions (k, n, 4), w first, of rotations (k, n, 3, 3)."""
    from scipy.spatial.transform import Rotation  # takes long to import

    turned = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return turned.reshape(*rotations.shape[:2], 4)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed as a package"


def _plain(value):
    """Number, text, or array of numbers of a pair, as netCDF takes them."""
    if isinstance(value, tuple):
        return np.array(value, dtype=float)
    return value if isinstance(value, int | float | str) and not isinstance(value, bool) else str(value)


def _read(value):
    return tuple(value.tolist()) if np.ndim(value) else value


def _library(name: str):
    try:
        return import_module(name)
    except ImportError as error:
        raise FileError(f"{name} is not installed: pip install 'gauss[results]'.") from error
