"""Poses that meet all position constraints φ(q) = 0, near a pose that nearly does, by compiled Newton steps: J ξ = −φ.

ξ is least in the units of the coordinates. Where Newton's method does not converge at once, damped steps follow
(:mod:`gauss.dynamics.projection`). Along straight lines of some coordinates the others follow from pose to pose, on their
branch.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gauss.analysis.tangents import Tangents
from gauss.codegen import Kernel, write
from gauss.dynamics.assembly_search import RESIDUAL_TOLERANCE
from gauss.dynamics.mechanism import loop_residual
from gauss.dynamics.null_space import RANK_TOLERANCE, row_lengths
from gauss.dynamics.projection import position_residual_of, project_positions, project_rates, relative
from gauss.dynamics.store import cached
from gauss.system import State, System, retract, whole

NEWTON_STEPS = 8
LONGEST_STEP = 0.2  # in units of the coordinates; longer ones are left to damped steps
CONVERGED = 1e-10  # step in units, after which the next one, quadratically smaller, is round-off
POSITION_STEPS = 30  # damped Gauss–Newton steps


def closed(system: System, state: State, held=()) -> tuple[State, bool]:
    """State near another one that meets the position constraints, and whether it does; entries ``held`` of v are fixed."""
    if not system.has_closures:
        return state, True
    kernel = position_residuals(system)
    free = np.setdiff1d(np.arange(system.n_v), list(held))
    units, found = system.scale.coordinates[free], state
    for _ in range(NEWTON_STEPS):
        phi = kernel(np.concatenate([[found.t], found.q]))
        J = Tangents(system, found).position_rows[:, free] * units
        lengths = row_lengths(J)
        xi = np.zeros(system.n_v)
        xi[free] = -units * np.linalg.lstsq(J / lengths[:, None], phi / lengths, rcond=RANK_TOLERANCE)[0]
        longest = np.abs(xi / system.scale.coordinates).max(initial=0.0)
        if not longest <= LONGEST_STEP:
            break
        found = replace(found, q=retract(system, found.q, xi))
        if longest <= CONVERGED:  # with all the coordinates of a row held there is no step, however far it is from being met
            return found, _is_met(system, found)
    found = project_positions(system, state, POSITION_STEPS, held)
    return found, _is_met(system, found)


def followed(system: System, start: State, targets: Mapping[int, float], shares) -> tuple[list[State], bool]:
    """States at rest whose coordinates go from a start to targets, and whether the loops of all of them are closed.

    Parameters
    ----------
    start : State
        State that meets the constraints.
    targets : mapping of int to float
        Coordinates that are led, by their places in q, and where they go; they are no parts of quaternions.
    shares : array_like, shape (k,)
        Shares of the way, increasing.
    """
    columns = [_column(system, place) for place in targets]
    places, state, states, all_closed = list(targets), start, list[State](), True
    way = np.array(list(targets.values())) - start.q[places]
    for share in shares:
        q = state.q.copy()
        q[places] = start.q[places] + share * way
        state, is_closed = closed(system, State(start.t, q, np.zeros(system.n_v)), columns)
        all_closed = all_closed and is_closed
        states.append(state)
    return states, all_closed


def _column(system: System, place: int) -> int:
    """Rate of a coordinate."""
    joint = next(one for one in system.joints if one.q.start <= place < one.q.stop)
    return joint.v.start + place - joint.q.start


def _is_met(system: System, found: State) -> bool:
    """Whether a pose meets the position constraints."""
    return relative(system, position_residual_of(system, found)) <= RESIDUAL_TOLERANCE


def with_rates(system: System, state: State, held=()) -> State:
    """State with rates that meet the velocity constraints, and keep the entries ``held``; the others follow."""
    if system.relations.placed:
        return project_rates(system, state, held)
    N, places = Tangents(system, state).rate, list(held)  # joints and couplings allow rest
    return replace(state, v=N @ np.linalg.lstsq(N[places], state.v[places], rcond=RANK_TOLERANCE)[0])


def position_residuals(system: System) -> Kernel:
    """(t, q) → position residuals, those of the coordinates of loop joints included; made once for a system."""
    return cached(system, (position_residuals,), lambda: _residuals(system))


def _residuals(system: System) -> Kernel:
    unreduced = (whole(system),)

    def residual(t, q):
        rows, slack = loop_residual(system, q, t[0], unreduced)
        return np.concatenate([rows, *(part for parts in slack for part in parts)])

    return Kernel(write(residual, 1, system.n_q, name="position residual"), batch=False)
