"""Measured samples of a motion, checked, projected onto the constraints, with the forces that inertias and friction take.

τ = Y π − Q for the loads Q of the scene: Y π = τ + Q, and with the known dry friction of other joints τ + Q − f sign v.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gauss.analysis.loop_closure import POSITION_STEPS, position_residuals
from gauss.analysis.regressor import RegressorModel
from gauss.arguments import real_numbers
from gauss.dynamics.projection import fixed_columns, project_positions
from gauss.errors import StateError, did_you_mean
from gauss.scene.set_valued import JointFriction
from gauss.system import State, System

SMALL_RESIDUAL = 1e-10  # of the positions, relative to the scales of the constraints: no projection
LARGEST_MOVE = 0.1  # of a projected sample, in the units of the coordinates


class MeasuredMotion(NamedTuple):
    """Samples of a motion."""

    matrix: np.ndarray  # (n, k, p) regressors
    forces: np.ndarray  # (n, k) forces Y π that inertias and friction take


def measured_motion(model: RegressorModel, q, v, acceleration, forces) -> MeasuredMotion:
    """Regressors and forces of samples.

    StateError if samples do not fit the system, are not finite or far off the constraints.
    SimulationError if a load of the scene cannot be compiled.
    """
    system, n_v = model.system, model.system.n_v
    q = _array(q, "q", None, system.n_q)
    v, acceleration = (_array(part, what, len(q), n_v) for part, what in ((v, "v"), (acceleration, "acceleration")))
    effort = _array(_efforts(system, forces, len(q)), "forces", len(q), n_v)
    if system.has_closures:
        q = _projected(system, q)
        v = model.rates(q, v)
    if system.loads:
        effort = effort + _load_forces(system, q, v)
    effort = effort - _known_friction(model, v)
    return MeasuredMotion(model.matrix(q, v, acceleration), model.projected_forces(q, effort))


def _array(given, what: str, rows: int | None, columns: int) -> np.ndarray:
    """Array (n, columns) of finite numbers."""
    found = real_numbers(given)
    if found is None:
        raise StateError(f"identify: {what}: expected numbers, got {given!r}.")
    if found.ndim != 2 or found.shape[1] != columns or rows not in (None, len(found)) or not len(found):
        shape = f"({'n' if rows is None else rows}, {columns})"
        raise StateError(f"identify: {what}: expected shape {shape}, got {found.shape}.")
    bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if bad.size:
        raise StateError(f"identify: {what}: sample {bad[0]} is not finite: {found[bad[0]]}.")
    return found


def _efforts(system: System, forces, count: int):
    """Efforts (n, n_v) of all joints; those that are not named are zero."""
    if not isinstance(forces, Mapping):
        return forces
    found, names = np.zeros((count, system.n_v)), list(system.coordinates)
    for name, own in forces.items():
        if name not in names:
            raise StateError(f"identify: forces: no coordinate {name!r}. {did_you_mean(str(name), names)}")
        found[:, names.index(name)] = _array(np.reshape(own, (-1, 1)), f"forces of {name!r}", count, 1)[:, 0]
    return found


def _projected(system: System, q: np.ndarray) -> np.ndarray:
    """Coordinates (n, n_q) that meet the constraints."""
    residual = position_residuals(system)(np.concatenate([np.zeros((1, len(q))), q.T]))
    found, units = q.copy(), np.append(system.scale.coordinates, system.scale.length)
    for k in np.flatnonzero(np.abs(residual).max(axis=0) > SMALL_RESIDUAL * units.min()):
        found[k] = project_positions(system, State(0.0, q[k], np.zeros(system.n_v)), POSITION_STEPS).q
        moved = np.abs(found[k] - q[k]).max() / system.scale.coordinates.max()
        if not moved <= LARGEST_MOVE:
            raise StateError(f"identify: sample {k} is off the constraints: they move its coordinates by {moved:.3g}.")
    return found


def _load_forces(system: System, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Generalised forces (n, n_v) of the loads of the scene."""
    return system.bias_forces(q, v) - system.function("inverse_dynamics")(q, v, np.zeros_like(v))


def _known_friction(model: RegressorModel, v: np.ndarray) -> np.ndarray:
    """Dry friction (n, n_v) of joints whose friction is not to be found."""
    found = np.zeros_like(v)
    for one in model.system.scene.set_valued.values():
        if not isinstance(one, JointFriction):
            raise StateError(f"identify: the force of {one.what} is unknown; leave it out of the scene.")
        (k,) = fixed_columns(model.system, [one.joint])
        if k in model.friction:
            continue
        if callable(one.limit):
            raise StateError(f"identify: the limit of {one.what} is a law; leave it out of the scene.")
        found[:, k] += one.limit * np.sign(v[:, k])
    return found
