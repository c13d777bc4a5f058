"""States that meet every constraint: assembled from a guess, or refused with what stands against it."""

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

RESIDUAL_TOLERANCE = 1e-10  # gap, relative to the sizes of the rows, with which a start is still called consistent
NOISE = 1e-6  # the same, that redundant constraints typed with 7 digits may leave
NEWTON_STEPS = 60
RESTARTS = 6
SPREAD = 2.0  # rad and sizes of the mechanism: how far from the guess the last restart may begin


def consistent(
    system: System, state: State, kept=(), required: bool = False, least_violation: bool = False, rough: bool = False
) -> State:
    """State near a guess that meets every constraint.

    Coordinates that are given are moved as little as the constraints ask for; poses are tried at random for others only.

    Parameters
    ----------
    system : System
        The system.
    state : State
        The guess.
    kept : sequence of str
        Joints, or single rates of joints, that keep their coordinates and rates if that is possible.
    required : bool
        Whether they must.
    least_violation : bool
        Return the pose of least violation where the constraints contradict each other.
    rough : bool
        Whether the guess is rough: poses around it are tried at random, where none is found from it.

    Raises
    ------
    AssemblyError
        If the constraints cannot be met; it carries the closest pose and what each constraint is off by.
    """
    state = within_limits(system, state)
    if not system.has_closures:
        return state
    columns = fixed_columns(system, kept)
    if columns:
        found = project_rates(system, _assembled(system, state, columns, required), columns)
        if (_is_met(system, found) and _keeps(system, state, found, columns)) or (required and least_violation):
            return found
        if required:
            _judge(system, found, f"while {', '.join(kept)} {'keeps its value' if len(kept) == 1 else 'keep their values'}")
            return found
    found = project_rates(system, _assembled(system, state, [], rough or _is_free(system, state, columns)))
    if columns and not _is_met(system, found):
        other = project_rates(system, _assembled(system, state, columns, True), columns)
        if _is_met(system, other):
            return other
    if not least_violation:
        _judge(system, found, "from this start")
    return found


def _is_free(system: System, state: State, held) -> bool:
    """Whether nobody has said where the mechanism is: only then may it be looked for at random."""
    return not held and np.array_equal(state.q, system.reference.q)


def project(system: System, state: State) -> State:
    """State after a step, brought back to the constraints: a few Newton steps in position, one in velocity."""
    if not system.has_closures:
        return state
    return project_rates(system, project_positions(system, state, 3), steps=1)


def violations(system: System, state: State) -> dict[str, str]:
    """What every constraint is off by, in words, the worst first; constraints that are met are left out."""
    motion = kinematics(system, state)
    gap, slip, sizes = position_residual(motion), velocity_residual_of(system, motion), constraint_scales(system)
    speed = system.scale.fastest(state.v)
    found = {}
    for constraint in system.structure.constraints:
        rows = constraint.rows
        off, fast = np.abs(gap[rows] / sizes[rows]).max(), np.abs(slip[rows] / sizes[rows]).max() / speed
        if off > RESIDUAL_TOLERANCE:
            found[constraint.name] = (off, _amount(gap[rows]))
        elif fast > RESIDUAL_TOLERANCE:
            found[constraint.name] = (fast, f"off by {np.abs(slip[rows]).max():.3g} in its rates")
    return {name: words for name, (_, words) in sorted(found.items(), key=lambda item: -item[1][0])}


def _assembled(system: System, state: State, held, restart: bool) -> State:
    """Nearest pose found from the guess; from places around it, ever farther, where that fails."""
    best = project_positions(system, state, NEWTON_STEPS, held)
    rng, smallest = np.random.default_rng(0), relative(system, position_residual_of(system, best))
    free = np.ones(system.n_v)
    free[list(held)] = 0.0
    for k in range(RESTARTS if restart else 0):
        if smallest <= RESIDUAL_TOLERANCE:
            break
        away = free * rng.uniform(-1.0, 1.0, system.n_v) * SPREAD * (k + 1) / RESTARTS
        moved = within_limits(system, replace(state, q=retract(system, state.q, away * system.scale.coordinates)))
        found = project_positions(system, moved, NEWTON_STEPS, held)
        size = relative(system, position_residual_of(system, found))
        if size < smallest:
            best, smallest = found, size
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


def _judge(system: System, state: State, where: str):
    """Refuse a state that misses its constraints; a warning is enough where noise of typed digits is all that is left."""
    found = violations(system, state)
    if not found:
        return
    words = "; ".join(f"{name!r} {amount}" for name, amount in list(found.items())[:4])
    more = f" and {len(found) - 4} more" if len(found) > 4 else ""
    gap = relative(system, position_residual_of(system, state))
    if (
        max(gap, relative_velocity_residual(system, velocity_residual_of(system, kinematics(system, state)), state.v))
        <= NOISE
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
