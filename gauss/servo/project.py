"""Projection onto servo-constraints, through the actuators and not in the mass metric: consistent start, drift control.

    Δq = −X_W S⁻¹ c,   Δv = −X_W S⁻¹ ċ,   X_W = N H_N⁻¹ Nᵀ Wᵀ        (impulses of the servos alone)

Contacts come first, in the mass metric. Hidden relations of an index reduction restrict positions on which no effort acts;
with them the correction is the least one in the mass metric.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from gauss.dynamics.assembly_search import NEWTON_STEPS
from gauss.dynamics.consistent_states import project
from gauss.errors import StateError, require
from gauss.servo.kernels import tree_rows
from gauss.servo.plan import RelationPlan
from gauss.servo.realisable import contact_responses, instant, planned
from gauss.servo.relation import ServoRows
from gauss.servo.servo import Servo
from gauss.system import State, System, retract

Trial = TypeVar("Trial")

ROUNDING_RESIDUAL = 1e-13  # residual relative to the size of its row, and its rate relative to the rates: rounding
CONSISTENT_START = 1e-10  # the same: largest one of a consistent start
AROUND, LOOKED = 0.1, 4  # units of the scene, and states: how far from the start, and how often, rows are evaluated
SMALLEST_RELATION_SHARE = 1e-3  # of a Newton step: where none larger lowers the residual, it cannot be removed


def initial_state(servo: Servo, state: State | None = None) -> State:
    """Consistent state nearby: contacts, relations and hidden relations hold in position and velocity.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State, optional
        First guess; the start of the scene when not given. It moves along the responses to the efforts.

    Returns
    -------
    State
        Consistent state.

    Raises
    ------
    UnrealisableError
        If the servos cannot hold the relations.
    StateError
        If the relations cannot be met from there; the message names the worst one.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> state = servo.initial_state(held)
    >>> state.t, state.q.round(6)
    (0.0, array([0., 0.]))
    """
    require(servo, (Servo,), "servo.initial_state")
    state = servo.system.initial_state() if state is None else servo.system.projected(state)
    plan = planned(servo, state)
    state = projected(servo, plan, state, NEWTON_STEPS)
    name, share, size = worst(servo, plan, state)
    if share > CONSISTENT_START:
        raise StateError(
            f"relation {name!r} cannot be met from this start: off by {size:.3g} in the closest state "
            "found. Start nearer to it, or check the relation."
        )
    return state


def projected(servo: Servo, plan: RelationPlan, state: State, steps: int = 3) -> State:
    """State projected onto contacts and relations: Newton steps in position, then in velocity."""
    state, own = project(servo.system, state), sizes(servo, plan)
    residual = residuals(servo, plan, state)[0] / own
    for _ in range(steps):
        size = np.abs(residual).max(initial=0.0)
        if size <= ROUNDING_RESIDUAL:
            break
        found = _damped_step(servo, plan, state, own, size)
        if found is None:
            break
        state, residual = found
    for _ in range(steps):
        _, rate = residuals(servo, plan, state)
        if np.abs(rate / own).max(initial=0.0) <= ROUNDING_RESIDUAL * servo.system.scale.fastest(state.v):
            break
        state = replace(state, v=state.v - _correction(servo, plan, state, lambda rows: rows.velocity, "velocity"))
    return state


def _damped_step(servo: Servo, plan: RelationPlan, state: State, own: np.ndarray, size: float):
    """State after a damped Newton step in position and its relative residual; None if no share of the step lowers it."""
    move = _correction(servo, plan, state, lambda rows: rows.position, "position")

    def trial_at(share: float) -> tuple[State, np.ndarray]:
        trial = project(servo.system, replace(state, q=retract(servo.system, state.q, -share * move)))
        return trial, residuals(servo, plan, trial)[0] / own

    return first_accepted(trial_at, lambda trial: np.abs(trial[1]).max() < size, SMALLEST_RELATION_SHARE)


def worst(servo: Servo, plan: RelationPlan, state: State) -> tuple[str, float, float]:
    """Relation with the largest relative residual, that residual, and its value in its own unit.

    Residuals at position and velocity level are relative to the size of the row and to the rates.
    """
    position, velocity = residuals(servo, plan, state)
    if not position.size:
        return "", 0.0, 0.0
    shares = np.abs([position, velocity / servo.system.scale.fastest(state.v)]) / sizes(servo, plan)
    level, row = np.unravel_index(int(shares.argmax()), shares.shape)
    return plan.scalars[row].name, float(shares.max()), float(abs((position, velocity)[level][row]))


def sizes(servo: Servo, plan: RelationPlan) -> np.ndarray:
    """Sizes (r,) of the rows of a plan: largest changes of residuals while a coordinate moves by one unit of the scene."""
    slopes = lambda state: _rows(servo, plan, state).G  # noqa: E731
    return servo.made(("sizes", plan.scalars), lambda: sizes_of(servo.system, slopes))


def sizes_of(system: System, slopes: Callable[[State], np.ndarray]) -> np.ndarray:
    """Sizes (r,) of rows, from their slopes (r, n_v) in a state."""
    rng, start, units, found = np.random.default_rng(0), system.start(), system.scale.coordinates, 0.0
    for around in np.linspace(0.0, AROUND, LOOKED):  # at the start itself a row may vanish
        q = retract(system, start.q, around * units * rng.uniform(-1.0, 1.0, system.n_v))
        there = np.nan_to_num(slopes(system.state(q, start.v)), posinf=0.0, neginf=0.0)
        found = np.maximum(found, np.abs(there * units).max(axis=1, initial=0.0))
    return np.where(found > 0.0, found, 1.0)


def residuals(servo: Servo, plan: RelationPlan, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Residuals at position and at velocity level of all relations of a plan, contacts and hidden ones included."""
    rows = _rows(servo, plan, state)
    return rows.position, rows.velocity


def _rows(servo: Servo, plan: RelationPlan, state: State) -> ServoRows:
    return tree_rows(servo, plan.scalars)(state)[0]


def _correction(servo: Servo, plan: RelationPlan, state: State, residual, level: str) -> np.ndarray:
    """Change of q or v that removes the residual to first order."""
    count, width = servo.n_contacts, servo.system.n_v
    rows = _rows(servo, plan, state)
    values = residual(rows)
    meets = np.array([scalar.level in ("position", level) for scalar in plan.scalars])
    contacts, held = np.flatnonzero(meets[:count]), np.flatnonzero(meets[count:])
    move = np.zeros(width)
    if contacts.size:
        move = contact_responses(servo, state, plan).part(contacts).guided(move, values[contacts])
    if not held.size:
        return move
    part = instant(servo, state, plan).part(held)
    left = values[count:][held] - rows.G[count:][held] @ move
    if plan.reduced:
        return move + part.guided(np.zeros(width), left)
    root, own = np.sqrt(servo.weight), sizes(servo, plan)[count:][held]
    efforts = np.linalg.lstsq(part.S / own[:, None] / root, left / own, rcond=None)[0] / root
    return move + part.X_W[-width:] @ efforts


def first_accepted(trial_at: Callable[[float], Trial], accepted: Callable[[Trial], bool], smallest: float) -> Trial | None:
    """First accepted trial of a share of a step, halved down to the smallest one; None if there is none."""
    share = 1.0
    while share >= smallest:
        trial = trial_at(share)
        if accepted(trial):
            return trial
        share /= 2
    return None
