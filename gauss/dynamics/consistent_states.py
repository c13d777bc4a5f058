"""Consistent states: assembled from a guess by projection, or refused with the residual of each constraint."""

import warnings
from dataclasses import replace

import numpy as np

from gauss.dynamics.assemble import position_residual
from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.projection import (
    fixed_columns,
    limits,
    position_residual_of,
    project_positions,
    project_rates,
    relative,
    relative_velocity_residual,
    scalar_coordinates,
    velocity_residual_of,
    within_limits,
)
from gauss.errors import AssemblyError, InconsistentConstraintsWarning
from gauss.system import State, System, retract

RESIDUAL_TOLERANCE = 1e-10  # residual relative to the scales of the rows of a consistent state
TYPED_DIGITS_RESIDUAL = 1e-6  # the same of redundant constraints with numbers of 7 digits
NEWTON_STEPS = 60
RESTARTS = 6
SPREAD = 2.0  # rad and lengths of the scene: largest distance of a restart from the guess


def consistent(
    system: System, state: State, kept=(), required: bool = False, least_violation: bool = False, rough: bool = False
) -> State:
    """State near a guess that meets every constraint.

    Given coordinates change as little as the constraints allow; random restarts are for other coordinates only.

    Parameters
    ----------
    system : System
        The system.
    state : State
        The guess.
    kept : sequence of str
        Joints, or single rates of joints, that keep their coordinates and rates if possible.
    required : bool
        Whether they must.
    least_violation : bool
        Return the pose of least residual for inconsistent constraints.
    rough : bool
        Whether the guess is rough: random restarts around it are allowed.

    Raises
    ------
    AssemblyError
        If the constraints cannot be met; it carries the closest pose and the residual of each constraint.
    """
    state = within_limits(system, state)
    if not system.has_closures:
        return state
    columns = fixed_columns(system, kept)
    if columns:
        found = project_rates(system, _assembled(system, state, columns, required), columns)
        if _is_met(system, found) and _keeps(system, state, found, columns):
            return found
        if required:
            if not least_violation:
                _check_start(system, found, _while_kept(kept))
            return found
    found = project_rates(system, _assembled(system, state, [], rough or _is_free(system, state, columns)))
    if columns and not _is_met(system, found):
        other = project_rates(system, _assembled(system, state, columns, True), columns)
        if _is_met(system, other):
            return other
    if not least_violation:
        _check_start(system, found, "from this start")
    return found


def _while_kept(kept) -> str:
    return f"while {', '.join(kept)} {'keeps its value' if len(kept) == 1 else 'keep their values'}"


def _is_free(system: System, state: State, held) -> bool:
    """Whether no coordinates are given: only then random restarts are allowed."""
    return not held and np.array_equal(state.q, system.reference.q)


def project(system: System, state: State) -> State:
    """State after a step, projected onto the constraints: three Newton steps in position, one in velocity."""
    if not system.has_closures:
        return state
    return project_rates(system, project_positions(system, state, 3), steps=1)


def violations(system: System, state: State) -> dict[str, str]:
    """Residual of every violated constraint, in words, the largest first."""
    motion = kinematics(system, state)
    phi, rates, sizes = position_residual(motion), velocity_residual_of(system, motion), constraint_scales(system)
    speed = system.scale.fastest(state.v)
    found = {}
    for constraint in system.structure.constraints:
        rows = constraint.rows
        off, fast = np.abs(phi[rows] / sizes[rows]).max(), np.abs(rates[rows] / sizes[rows]).max() / speed
        if off > RESIDUAL_TOLERANCE:
            found[constraint.name] = (off, _amount(phi[rows]))
        elif fast > RESIDUAL_TOLERANCE:
            found[constraint.name] = (fast, f"off by {np.abs(rates[rows]).max():.3g} in its rates")
    return {name: words for name, (_, words) in sorted(found.items(), key=lambda item: -item[1][0])}


def _assembled(system: System, state: State, held, restart: bool) -> State:
    """Pose by projection of the guess; by random restarts at growing distances where that fails."""
    best = project_positions(system, state, NEWTON_STEPS, held)
    smallest = relative(system, position_residual_of(system, best))
    if not restart or smallest <= RESIDUAL_TOLERANCE:
        return best
    rng, free = np.random.default_rng(0), np.ones(system.n_v)
    free[list(held)] = 0.0
    for k in range(RESTARTS):
        away = free * rng.uniform(-1.0, 1.0, system.n_v) * SPREAD * (k + 1) / RESTARTS
        moved = within_limits(system, replace(state, q=retract(system, state.q, away * system.scale.coordinates)))
        found = project_positions(system, moved, NEWTON_STEPS, held)
        size = relative(system, position_residual_of(system, found))
        if size < smallest:
            best, smallest = found, size
        if smallest <= RESIDUAL_TOLERANCE:
            break
    return best


def _is_met(system: System, state: State) -> bool:
    return not violations(system, state)


def _keeps(system: System, start: State, kept: State, held) -> bool:
    units, scale = system.scale.coordinates[held], system.scale
    moved = (np.abs(scalar_coordinates(system, start) - scalar_coordinates(system, kept))[held] / units).max()
    turned = [
        np.abs(start.q[j.q] - kept.q[j.q])[j.pair.quaternion :].max(initial=0.0)
        for j in system.joints
        if j.pair.quaternion is not None and set(range(*j.v.indices(system.n_v))) <= set(held)
    ]
    slowed = (np.abs(start.v - kept.v)[held] / units).max()
    return max([moved, *turned]) <= RESIDUAL_TOLERANCE and slowed <= RESIDUAL_TOLERANCE * scale.fastest(start.v)


def _check_start(system: System, state: State, where: str):
    """Refuse a state that violates its constraints; warn if the residual is that of numbers with few digits."""
    found = violations(system, state)
    if not found:
        return
    words = "; ".join(f"{name!r} {amount}" for name, amount in list(found.items())[:4])
    more = f" and {len(found) - 4} more" if len(found) > 4 else ""
    phi = relative(system, position_residual_of(system, state))
    if (
        max(phi, relative_velocity_residual(system, velocity_residual_of(system, kinematics(system, state)), state.v))
        <= TYPED_DIGITS_RESIDUAL
    ):
        warnings.warn(
            f"constraints contradict each other a little: {words}{more} in the pose of least violation, which is used. "
            "Give lengths and frames with all their digits.",
            InconsistentConstraintsWarning,
            stacklevel=4,
        )
        return
    worst = next(iter(found))
    message = f"constraint {worst!r} cannot be met {where}: {words}{more} in the closest pose found. "
    at_limit = _at_limits(system, state)
    if at_limit:
        message += f"At a limit: {', '.join(at_limit)}. "
    message += "Check the lengths and frames of its loop, or start nearer to an assembled pose."
    raise AssemblyError(message, state, found)


def _at_limits(system: System, state: State) -> list[str]:
    lowest, highest = limits(system)
    plain = scalar_coordinates(system, state)
    return [system.coordinates[k] for k in np.flatnonzero((plain <= lowest) | (plain >= highest))]


def _amount(part: np.ndarray) -> str:
    if part.size == 6:
        return f"{np.linalg.norm(part[3:]):.3g} m and {np.linalg.norm(part[:3]):.3g} rad apart"
    return f"off by {np.abs(part).max():.3g}"
