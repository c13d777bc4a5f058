"""Results of every kind as columns, whose names hold their units: what is written as a table."""

import re
from collections.abc import Callable

import numpy as np

from gauss.io.labelled import RESIDUALS, energies
from gauss.linkages import CrankRun, Cycle
from gauss.linkages import table as of_cycle
from gauss.rotors import RotorMotion
from gauss.rotors import table as of_rotors
from gauss.servo import Tracking
from gauss.simulation import Rollout, Trajectory
from gauss.simulation.provenance import library
from gauss.system import System, coordinate_units, rate_units

UNIT = re.compile(r"(.*) \[(.*)\]")


def columns(thing) -> dict[str, np.ndarray]:
    """Columns of a result by name and unit; of a kind of :data:`COLUMNS`, or a Dataset of a sweep."""
    make = next((make for kind, make in COLUMNS.items() if isinstance(thing, kind)), of_sweep)
    return make(thing)


def of_motion(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Times, coordinates, rates and energies of a motion."""
    found = {"t [s]": trajectory.t} | _states(trajectory.system, trajectory.q, trajectory.v)
    return found | {f"{name} [J]": row for name, row in energies(trajectory).items()}


def of_tracking(tracking: Tracking) -> dict[str, np.ndarray]:
    """Columns of the motion; efforts, their work, residuals of the relations, and the hold of the efforts."""
    found, names = of_motion(tracking.motion), tracking.servo.efforts
    efforts = zip(names, tracking.servo.effort_units, tracking.efforts.T, strict=True)
    found |= {f"effort {name} [{unit}]": column for name, unit, column in efforts}
    found |= {f"work of {name} [J]": column for name, column in zip(names, tracking.work.T, strict=True)}
    held = zip(tracking.servo.held, tracking.residuals.T, strict=True)
    return found | {f"residual {name} [{RESIDUALS}]": column for name, column in held} | {"hold [1]": tracking.smallest}


def of_rollout(rollout: Rollout) -> dict[str, np.ndarray]:
    """Number of the motion, times, coordinates and rates: one motion after the other."""
    count, k = rollout.q.shape[:2]
    found = {"motion [1]": np.repeat(np.arange(count), k), "t [s]": np.tile(rollout.t, count)}
    return found | _states(rollout.system, *(values.reshape(count * k, -1) for values in (rollout.q, rollout.v)))


def of_run(run: CrankRun) -> dict[str, np.ndarray]:
    """Times and motion of the crank, and torque of the motor."""
    found = {"t [s]": run.t, "crank angle [rad]": run.angle, "crank speed [rad/s]": run.speed}
    return found | {"crank acceleration [rad/s^2]": run.acceleration, "motor torque [N m]": run.torque}


def of_sweep(dataset) -> dict[str, np.ndarray]:
    """One row a member: what is varied, coordinates and rates at the end, the outcome."""
    shape, found = dataset.status.shape, {}
    for name, values in dataset.coords.items():
        if not values.dims or not {*values.dims} <= {*dataset.status.dims}:
            continue
        along = [slice(None) if dim in values.dims else None for dim in dataset.status.dims]
        named = f"{name} [{values.attrs['units']}]" if "units" in values.attrs else name
        found[named] = np.broadcast_to(values.values[tuple(along)], shape).ravel()
    ends = dataset.isel(time=-1)
    for letter, axis in (("q", "coordinate"), ("v", "rate")):
        parts = zip(dataset[axis].values, dataset[f"{axis}_unit"].values, strict=True)
        found |= {
            f"{letter} {name} at the end [{unit}]": ends[letter].sel({axis: name}).values.ravel() for name, unit in parts
        }
    for name, values in dataset.data_vars.items():
        if values.dims == dataset.status.dims:
            found[f"{name} [1]" if name == "energy_error" else name] = values.values.ravel()
    return found


def as_dataset(named: dict[str, np.ndarray]):
    """Columns as an xarray Dataset: a variable for each, with its unit as an attribute."""
    data = {}
    for entry, values in named.items():
        found = UNIT.fullmatch(entry)
        name, unit = found.groups() if found else (entry, "")
        data[name.replace("/", "_")] = ("row", np.asarray(values), {"units": unit} if unit else {})  # netCDF refuses "/"
    return library("xarray").Dataset(data)


def _states(system: System, q: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
    """Coordinates (k, n_q) and rates (k, n_v) by name and unit."""
    found: dict[str, np.ndarray] = {}
    for letter, units, values in (("q", coordinate_units(system), q), ("v", rate_units(system), v)):
        found |= {f"{letter} {name} [{units[name]}]": column for name, column in zip(units, values.T, strict=True)}
    return found


COLUMNS: dict[type, Callable] = {
    Trajectory: of_motion,
    Tracking: of_tracking,
    RotorMotion: of_rotors,
    Rollout: of_rollout,
    Cycle: of_cycle,
    CrankRun: of_run,
    dict: dict,
}
