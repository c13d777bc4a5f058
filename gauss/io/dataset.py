"""Motions as labelled arrays and tables: xarray, netCDF, pandas. Needs pip install xarray h5netcdf h5py pandas."""

import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from gauss.dynamics import Plan, compile_scene
from gauss.errors import ArgumentError, FileError, MissingPackageError, require
from gauss.io.columns import COLUMNS, as_dataset, columns
from gauss.io.labelled import of_motion, of_rollout, of_rotors, of_tracking
from gauss.io.load import LABELLED, RESULTS
from gauss.io.results import separated
from gauss.rotors import RotorMotion
from gauss.scene.toml import from_tables
from gauss.servo import Tracking
from gauss.simulation import Rollout, Trajectory
from gauss.simulation.motion_records import Event, SleepRecord, Stats
from gauss.simulation.provenance import library
from gauss.system import System

MAKERS: dict[type, Callable] = {Trajectory: of_motion, Tracking: of_tracking, RotorMotion: of_rotors, Rollout: of_rollout}


def to_dataset(motion, joints=()):
    """Motion of any kind as an xarray Dataset: named dimensions, units in the attributes, and how it was made.

    Parameters
    ----------
    motion : Trajectory, Tracking, RotorMotion or Rollout
        The motion: of a scene, of one under servos, of a rotor network, or many of a system.
    joints : iterable of str
        Joints of a scene whose reactions are wanted, too; each sample of them is an instant to solve.

    Returns
    -------
    xarray.Dataset
        Of a scene:

        * ``q`` (time, coordinate) and ``v`` (time, rate), units in ``coordinate_unit`` and ``rate_unit``;
        * ``position`` (time, body, axis) [m] of the body frames, ``orientation`` (time, body, component), unit quaternions;
        * ``kinetic``, ``potential``, ``drives``, ``loads``, ``dissipated``, ``balance`` (time) [J];
        * ``reaction_force`` [N] and ``reaction_moment`` [N m] (time, joint, axis) of ``joints``;
        * ``event_time`` [s], ``event_kind``, ``event_gaps``, ``event_loss`` [J], ``event_impulses`` (JSON) (event).

        Under servos also ``effort`` [N, N m], ``effort_work`` [J] (time, effort_name), ``gap`` (time, relation), ``hold``.
        Of rotors ``angle``, ``speed``, ``acceleration`` (time, shaft), ``torque``, ``slip``, heats (time, link), energies,
        events. Of many motions ``q`` and ``v`` (motion, time, …).

        Attributes: the scene or network as TOML and its SHA-256, versions, settings and cost of the simulation.

    Raises
    ------
    ArgumentError
        If it is no motion, or reactions are wanted of one that has none.
    MissingPackageError
        If xarray is not installed.
    """
    require(motion, tuple(MAKERS), "to_dataset")
    make = next(make for kind, make in MAKERS.items() if isinstance(motion, kind))
    if joints and make not in (of_motion, of_tracking):
        raise ArgumentError(f"to_dataset: joints= is for motions of scenes; a {type(motion).__name__} has no reactions.")
    return make(motion, joints) if joints else make(motion)


def to_table(result):
    """Result as a pandas DataFrame: one row a sample, columns with their units in the names.

    Parameters
    ----------
    result : Trajectory, Tracking, RotorMotion, Rollout, Cycle or CrankRun
        The motion: coordinates, rates and energies; of a linkage its cycle, or a run under its motor.

    Returns
    -------
    pandas.DataFrame
        Indexed by time [s]; of many motions by their number and time, of a cycle by the angle of the crank [rad].

    Raises
    ------
    MissingPackageError
        If pandas is not installed.
    """
    kinds = tuple(kind for kind in COLUMNS if kind is not dict)
    require(result, kinds, "to_table")
    named = columns(result)
    return library("pandas").DataFrame(named).set_index(list(named)[: 1 + isinstance(result, Rollout)])


def write_netcdf(thing, path: Path) -> Path:
    """Write a result as netCDF 4, which any netCDF or HDF5 reader reads."""
    found = _labelled(thing)
    meshes = {name: {"zlib": True} for name in ("mesh_vertex", "mesh_triangle") if name in found}
    found.to_netcdf(path, engine="h5netcdf", encoding=meshes)
    return path


def write_zarr(thing, path: Path) -> Path:
    """Write a result as a Zarr folder."""
    _labelled(thing).to_zarr(path, mode="w", zarr_format=2, consolidated=True)
    return path


def _labelled(thing):
    """Dataset of a motion; of other results that of their columns, and a Dataset itself."""
    if isinstance(thing, Trajectory | Tracking):
        scene = (thing if isinstance(thing, Trajectory) else thing.motion).system.scene
        return to_dataset(thing).assign(_meshes(scene))
    if isinstance(thing, tuple(MAKERS)):
        return to_dataset(thing)
    return as_dataset(columns(thing)) if isinstance(thing, tuple(COLUMNS)) else thing


def _meshes(scene) -> dict:
    """Meshes of the robot of a scene, as variables of its Dataset."""
    if not scene.source:
        return {}
    try:
        visuals = import_module("gauss.io.visuals")
    except MissingPackageError:  # Pinocchio reads them
        return {}
    return visuals.as_arrays(visuals.visuals_of(scene))


def load_motion(path) -> Trajectory:
    """Motion of a file that :func:`gauss.save` wrote as netCDF or Zarr.

    Parameters
    ----------
    path : str or Path
        The file, .nc or .h5, or folder, .zarr.

    Returns
    -------
    Trajectory
        The motion, its system compiled from the scene in the file.

    Raises
    ------
    FileError
        If it is no such file, or its scene was made of Python functions, which no file can hold.
    """
    if not Path(path).exists():
        raise FileError(f"{path}: no such file.")
    kind = Path(path).suffix.lower()
    if kind in RESULTS and kind not in LABELLED:
        others = ", ".join(LABELLED)
        raise FileError(f"{path}: {kind} files hold numbers without their scene; motions are read from {others}.")
    try:
        engine = "zarr" if Path(path).suffix == ".zarr" else "h5netcdf"
        with library("xarray").open_dataset(path, engine=engine) as file:
            found = file.load()
        about = found.attrs
        parts = _columns(found, "time", "q", "v")
        work = np.stack(_columns(found, "drives", "loads", "dissipated"), axis=1)
        stats, events = _stats(about), _events(found)
        text, names = about["scene_toml"], found["rate"].values.tolist()
    except OSError as error:  # the libraries below tell their own affairs
        what = error.strerror or "cut off, damaged, or of another format"
        raise FileError(f"{path}: not a motion that gauss wrote as netCDF or Zarr: {what}.") from error
    except KeyError as error:
        missing = str(error.args[0]).partition(".")[0]  # the first sentence of the library
        raise FileError(f"{path}: not a result file of gauss; missing: {missing}.") from error
    except (TypeError, ValueError) as error:
        raise FileError(f"{path}: not a motion that gauss wrote: {error}.") from error
    if not text:
        raise FileError(f"{path}: holds numbers but no scene: {about.get('scene_remark', 'none was written')}.")
    system = compile_scene(replace(from_tables(tomllib.loads(text)), source=str(about.get("source", ""))))
    _require_own(path, system, names, parts[1])
    settings = {key.removeprefix("setting_"): _read(value) for key, value in about.items() if key.startswith("setting_")}
    t, q, v = parts
    return Trajectory(system, t, q, v, work, stats, events, settings=settings)


def _columns(found, *names: str) -> list[np.ndarray]:
    return [found[name].values for name in names]


def _require_own(path, system: System, rates: list[str], q: np.ndarray):
    if list(system.coordinates) != rates or q.shape[1:] != (system.n_q,):
        raise FileError(f"{path}: its numbers do not belong to its scene: rates {', '.join(rates)}.")


def _stats(about: dict) -> Stats:
    stats = Stats(**{name: _read(about[f"cost_{name}"]) for name in Stats._fields if f"cost_{name}" in about})
    if isinstance(stats.sleep, dict):
        stats = stats._replace(sleep=SleepRecord(**stats.sleep))
    return stats if stats.plan is None else stats._replace(plan=Plan.from_json(str(stats.plan)))


def _events(found) -> tuple[Event, ...]:
    names = ("time", "kind", "gaps", "loss", "impulses")
    return tuple(
        Event(t, kind, separated(gaps), loss, {name: tuple(each) for name, each in json.loads(impulses).items()})
        for t, kind, gaps, loss, impulses in zip(*(found[f"event_{name}"].values.tolist() for name in names), strict=True)
    )


def _read(value):
    if isinstance(value, str) and value.startswith("{"):
        return {name: _read(each) for name, each in json.loads(value).items()}
    return tuple(np.asarray(value).tolist()) if np.ndim(value) else value
