"""Rank of the loop constraints at generic configurations, by the pivots of S = K M⁻¹ Kᵀ, 1 for a row as on free bodies.

States near the start of the scene are assembled until one has large pivots. Where rows are redundant, Gauss and Newton's
method converges slowly; there a pivot differs from its final value by the order of the position residual, so that the first
steps decide.
"""

from contextlib import suppress
from itertools import islice

import numpy as np

from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.error_scale import states_around
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.projection import position_residual_of, project_positions, relative, within_limits
from gauss.errors import GaussError
from gauss.system import State, System

INDEPENDENT_PIVOT = 1e-4  # above which a row is independent of the others
CLEARLY_DEPENDENT_PIVOT = INDEPENDENT_PIVOT / 3.0  # bound of the final pivot by that of a step and its residual
PIVOT_PER_RESIDUAL = 10.0  # change of a pivot over a relative position residual; at most 3 in a biped with locked ankles
FIRST_STEPS = 12  # of Gauss and Newton, after which a state is assembled
ROUNDOFF_PIVOT = PIVOT_PER_RESIDUAL * RESIDUAL_TOLERANCE  # of a dependent row at a consistent state, at most
SIMILAR_PIVOTS = 0.1  # over the largest: the first row of them is taken, for round-off must not choose


def has_full_generic_rank(system: System) -> bool:
    """Whether the loop constraints of a system of numbers have full rank at some state around the start."""
    return any(_has_full_rank(system, state) for state in states_around(system))


def _has_full_rank(system: System, guess: State) -> bool:
    """Whether the constraints have full rank at the assembled state near a guess; False if there is none."""
    state = within_limits(system, guess)
    with suppress(GaussError):
        for _ in range(FIRST_STEPS):
            residual = relative(system, position_residual_of(system, state))
            if residual <= RESIDUAL_TOLERANCE:
                return _least_pivot(system, state) > INDEPENDENT_PIVOT
            allowed = CLEARLY_DEPENDENT_PIVOT - PIVOT_PER_RESIDUAL * residual
            if allowed > 0.0 and _least_pivot(system, state) < allowed:
                return False
            state = project_positions(system, state, 1)
        return _least_pivot(system, system.initial_state(state.q, state.v)) > INDEPENDENT_PIVOT
    return False


def dependent_rows(system: System, state: State, tolerance: float = ROUNDOFF_PIVOT) -> list[tuple[int, ...]]:
    """Rows of each subsystem that depend on others at a state, by pivots up to a tolerance over those on free bodies."""
    with np.errstate(all="ignore"):
        bodies = Mechanism(system, state.q, state.v, state.t).bodies
    return [_dependent_rows(body.S.astype(float), tolerance) if body.unit_forces else () for body in bodies]


def _dependent_rows(S: np.ndarray, tolerance: float) -> tuple[int, ...]:
    """Rows that are left once the others are eliminated, the largest pivots first (Higham 2002, sec. 10.3)."""
    left = np.ones(len(S), dtype=bool)
    while left.any():
        pivots = np.where(left, np.diag(S), -np.inf)
        if not pivots.max() > tolerance:  # NaN, too: bodies whose inertia does not determine their motion
            break
        row = int(np.argmax(pivots >= SIMILAR_PIVOTS * pivots.max()))
        left[row] = False
        S = S - np.outer(S[row], S[row]) / S[row, row]
    return tuple(int(row) for row in np.flatnonzero(left))


def is_generic_rank(system: System, dependent) -> bool:
    """Whether as many rows as those dependent at the start depend on others around it, too; False if that is not known."""
    for guess in islice(states_around(system), 1, None):
        state = _nearly_assembled(system, guess)
        if state is not None:
            return count(dependent_rows(system, state, INDEPENDENT_PIVOT)) >= count(dependent) > 0
    return False


def count(rows) -> int:
    """Number of rows of all subsystems."""
    return sum(map(len, rows))


def _nearly_assembled(system: System, guess: State) -> State | None:
    """State with pivots that are off by less than :data:`CLEARLY_DEPENDENT_PIVOT`; None if the first steps reach none."""
    state = within_limits(system, guess)
    with suppress(GaussError):
        for _ in range(FIRST_STEPS):
            if PIVOT_PER_RESIDUAL * relative(system, position_residual_of(system, state)) < CLEARLY_DEPENDENT_PIVOT:
                return state
            state = project_positions(system, state, 1)
    return None


def _least_pivot(system: System, state: State) -> float:
    return min(Mechanism(system, state.q, state.v, state.t).pivots, default=0.0)
