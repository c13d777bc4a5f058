"""Consistent states: assembled from a guess by projection, or refused with the residual of each constraint."""

import warnings
from dataclasses import replace

import numpy as np

from gauss.dynamics.assemble import position_residual
from gauss.dynamics.assembly_search import RESIDUAL_TOLERANCE, SPREAD, AssembledPose, assembled
from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.projection import (
    fixed_columns,
    limits,
    newton_step,
    position_residual_of,
    project_positions,
    project_rates,
    relative,
    relative_velocity_residual,
    scalar_coordinates,
    velocity_residual_of,
    within_limits,
)
from gauss.errors import AssemblyError, InconsistentConstraintsWarning, StartWarning, StateError, listed, user_level
from gauss.system import State, System

SHOWN = 4  # constraints or joints that a message names before it counts
STATIONARY = 0.1  # share of a residual that no small motion of the joints takes away
TYPED_DIGITS_RESIDUAL = 1e-6  # the same of redundant constraints with numbers of 7 digits


def consistent(
    system: System, state: State, kept=(), required: bool = False, least_violation: bool = False, rough: bool = False
) -> State:
    """State near a guess that meets every constraint.

    Given coordinates change as little as the constraints allow; random restarts are for other coordinates only.

    ``kept``: joints, or single rates of joints, that keep their coordinates and rates if possible. ``required``: whether
    they must. ``least_violation``: return the pose of least residual for inconsistent constraints. ``rough``: whether the
    guess is rough: random restarts around it are allowed.

    AssemblyError if the constraints cannot be met; it carries the closest pose and the residual of each constraint.
    """
    state = within_limits(system, state)
    if not system.has_closures:
        return state
    columns = fixed_columns(system, kept)
    if not columns:
        return _moved_freely(system, state, kept, rough, least_violation, columns)
    pose = assembled(system, state, columns, required)
    found = project_rates(system, pose.state, columns)
    if _is_met(system, found) and _keeps(system, state, found, columns):
        return found
    if not required:
        return _moved_freely(system, state, kept, rough, least_violation, columns)
    if not least_violation:
        _check_start(system, found, _while_kept(kept), pose)
    return found


def _moved_freely(system: System, state: State, kept, rough: bool, least_violation: bool, columns) -> State:
    """State near a guess in which every coordinate may change, those to be kept, too."""
    pose = assembled(system, state, [], rough or _is_free(system, state, columns))
    found = project_rates(system, pose.state)
    if columns and not _is_met(system, found):
        other_pose = assembled(system, state, columns, True)
        other = project_rates(system, other_pose.state, columns)
        if _is_met(system, other):
            pose, found = other_pose, other
    if not least_violation:
        _check_start(system, found, "from this start", pose)
        _warn_of_changes(system, state, found, kept, rough and pose.starts > 0)
    return found


def _while_kept(kept) -> str:
    return f"while {', '.join(kept)} {'keeps its value' if len(kept) == 1 else 'keep their values'}"


def _is_free(system: System, state: State, held) -> bool:
    """Whether no coordinates are given: only then random restarts are allowed."""
    return not held and np.array_equal(state.q, system.reference.q)


def changed_starts(system: System, given: State, found: State, kept) -> dict[str, str]:
    """Joints, or single rates of joints, whose coordinates or rates are no longer the given ones, with both in words."""
    changed, scale = {}, system.scale
    for name in kept:
        columns = fixed_columns(system, [name])
        pairs = [(scalar_coordinates(system, state)[columns], state.v[columns]) for state in (given, found)]
        (q, v), (q_found, v_found) = pairs
        units = scale.coordinates[columns]
        off = (np.abs(q - q_found) / units).max(initial=0.0), (np.abs(v - v_found) / units).max(initial=0.0)
        if off[0] > TYPED_DIGITS_RESIDUAL:
            changed[name] = f"{name!r} from {_numbers(q)} to {_numbers(q_found)}"
        elif off[1] > TYPED_DIGITS_RESIDUAL * scale.fastest(given.v):
            changed[name] = f"the rate of {name!r} from {_numbers(v)} to {_numbers(v_found)}"
    return changed


def _warn_of_changes(system: System, given: State, found: State, kept, is_elsewhere: bool):
    """Warn of starts that were changed, and of a pose that no path from the given one leads to."""
    changed = changed_starts(system, given, found, kept)
    if changed:
        words = listed(changed.values(), SHOWN)
        message = f"the constraints cannot be met with the given start: it was changed, {words}."
    elif is_elsewhere:
        message = "the constraints cannot be met near the given coordinates: the start is another assembled pose."
    else:
        return
    warnings.warn(message, StartWarning, stacklevel=user_level())


def _numbers(values) -> str:
    return " ".join(f"{value:.6g}" for value in values)


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


def _is_met(system: System, state: State) -> bool:
    return not violations(system, state)


def refuse_off_constraints(system: System, state: State, what: str):
    """Refuse a state that is farther from its constraints than numbers of few digits explain.

    StateError with the residuals of the constraints.
    """
    if system.has_closures and _distance(system, state) > TYPED_DIGITS_RESIDUAL:
        raise StateError(
            f"{what}: the state does not meet its constraints: {_named(violations(system, state))}; system.projected and "
            "system.initial_state make states that do."
        )


def _distance(system: System, state: State) -> float:
    """Largest residual of positions or rates, in shares of the scales of the rows."""
    motion = kinematics(system, state)
    of_rates = relative_velocity_residual(system, velocity_residual_of(system, motion), state.v)
    return max(relative(system, position_residual(motion)), of_rates)


def _named(found: dict[str, str]) -> str:
    """Violated constraints with their residuals, the largest first."""
    return listed((f"{name!r} {amount}" for name, amount in found.items()), SHOWN)


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


def _check_start(system: System, state: State, where: str, pose: AssembledPose):
    """Refuse a state that violates its constraints; warn if the residual is that of numbers with few digits."""
    found = violations(system, state)
    if not found:
        return
    words = _named(found)
    if _distance(system, state) <= TYPED_DIGITS_RESIDUAL:
        warnings.warn(
            f"constraints contradict each other a little: {words} in the pose of least violation, which is used. "
            "Give lengths and frames with all their digits.",
            InconsistentConstraintsWarning,
            stacklevel=user_level(),
        )
        return
    worst = next(iter(found))
    message = f"constraint {worst!r} cannot be met {where}: {words} in the closest pose found. "
    at_limit = _at_limits(system, state)
    if at_limit:
        message += f"At a limit: {', '.join(at_limit)}. "
    message += _against(system, pose)
    message += "Check the lengths and frames of its loop, or start nearer to an assembled pose."
    raise AssemblyError(message, state, found)


def _against(system: System, pose: AssembledPose) -> str:
    """Obstacles of the assembly: starts that failed, directions in which the loops cannot move."""
    words = f"So it is from {pose.starts} other starts, up to {SPREAD:g} rad away. " if pose.starts else ""
    if pose.is_met:
        return words
    phi = position_residual_of(system, pose.state)
    step = newton_step(system, pose.state, phi, (), *limits(system))
    left = relative(system, phi + velocity_residual_of(system, kinematics(system, replace(pose.state, v=step))))
    if left > STATIONARY * pose.residual:
        words += f"No motion of the joints reduces {left / pose.residual:.0%} of the residual: the chain does not reach. "
    return words


def _at_limits(system: System, state: State) -> list[str]:
    lowest, highest = limits(system)
    plain = scalar_coordinates(system, state)
    return [system.coordinates[k] for k in np.flatnonzero((plain <= lowest) | (plain >= highest))]


def _amount(part: np.ndarray) -> str:
    if part.size == 6:
        return f"{np.linalg.norm(part[3:]):.3g} m and {np.linalg.norm(part[:3]):.3g} rad apart"
    return f"off by {np.abs(part).max():.3g}"
