"""Keeping relations: consistent start and drift control, through the actuators and not through the mass metric.

Δq = −X_W S⁻¹ c,  Δv = −X_W S⁻¹ ċ,  X_W = N H_N⁻¹ Nᵀ Wᵀ: what impulses of the servos alone would do. Contacts come
first, in the mass metric. Hidden relations of an index reduction say where the system must be for the efforts to act at
all; with them the correction is the least one in the mass metric.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.dynamics.consistent_states import project
from gauss.errors import StateError
from gauss.servo.kernels import tree_rows
from gauss.servo.plan import Plan
from gauss.servo.realisable import contact_responses, instant, planned
from gauss.servo.rows import Rows
from gauss.servo.servo import Servo
from gauss.system import State, System, retract

HELD = 1e-13  # gap beside the size of its row, and rate of it beside the rates, at which rounding is reached
ACCEPTED = 1e-10  # the same, with which a start is still called consistent
AROUND, LOOKED = 0.1, 4  # units of the scene, and states: how far from the start and how often rows are looked at
NEWTON_STEPS = 60
SMALLEST_SHARE = 1e-3  # of a Newton step: shorter ones mean that the gap cannot be closed from here


def initial_state(servo: Servo, state: State | None = None) -> State:
    """State nearby that meets contacts, relations and hidden relations, in position and velocity.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State, optional
        From where; the start of the scene when not given. What relations leave open moves as the servos would move it.

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
    """
    state = servo.system.initial_state() if state is None else servo.system.projected(state)
    plan = planned(servo, state)
    state = settle(servo, plan, state, NEWTON_STEPS)
    name, share, size = worst(servo, plan, state)
    if share > ACCEPTED:
        raise StateError(
            f"relation {name!r} cannot be met from this start: off by {size:.3g} in the closest state "
            "found. Start nearer to it, or check the relation."
        )
    return state


def settle(servo: Servo, plan: Plan, state: State, steps: int = 3) -> State:
    """State brought back to contacts and relations: Newton steps in position, then in velocity."""
    state, own = project(servo.system, state), sizes(servo, plan)
    gap = residuals(servo, plan, state)[0] / own
    for _ in range(steps):
        size = np.abs(gap).max(initial=0.0)
        if size <= HELD:
            break
        move = _correction(servo, plan, state, lambda rows: rows.gap, "position")
        share = 1.0
        while share >= SMALLEST_SHARE:
            trial = project(servo.system, replace(state, q=retract(servo.system, state.q, -share * move)))
            trial_gap = residuals(servo, plan, trial)[0] / own
            if np.abs(trial_gap).max() < size:
                break
            share /= 2
        else:
            break
        state, gap = trial, trial_gap
    for _ in range(steps):
        _, rate = residuals(servo, plan, state)
        if np.abs(rate / own).max(initial=0.0) <= HELD * servo.system.scale.fastest(state.v):
            break
        state = replace(state, v=state.v - _correction(servo, plan, state, lambda rows: rows.rate, "velocity"))
    return state


def worst(servo: Servo, plan: Plan, state: State) -> tuple[str, float, float]:
    """Relation that is met worst, its residual beside the size of its row and the rates, and in its own unit.

    That is the residual at position level, or that of rates.
    """
    gap, rate = residuals(servo, plan, state)
    if not gap.size:
        return "", 0.0, 0.0
    shares = np.abs([gap, rate / servo.system.scale.fastest(state.v)]) / sizes(servo, plan)
    level, row = np.unravel_index(int(shares.argmax()), shares.shape)
    return plan.scalars[row].name, float(shares.max()), float(abs((gap, rate)[level][row]))


def sizes(servo: Servo, plan: Plan) -> np.ndarray:
    """Sizes (r,) of the rows of a plan: largest changes of residuals while a coordinate moves by one unit of the scene."""
    slopes = lambda state: _rows(servo, plan, state).G  # noqa: E731
    return servo.made(("sizes", plan.scalars), lambda: sizes_of(servo.system, slopes))


def sizes_of(system: System, slopes: Callable[[State], np.ndarray]) -> np.ndarray:
    """Sizes (r,) of rows, from their slopes (r, n_v) in a state."""
    rng, start, units, found = np.random.default_rng(0), system.start(), system.scale.coordinates, 0.0
    for around in np.linspace(0.0, AROUND, LOOKED):  # at the start itself a row may have no slopes
        q = retract(system, start.q, around * units * rng.uniform(-1.0, 1.0, system.n_v))
        there = np.nan_to_num(slopes(system.state(q, start.v)), posinf=0.0, neginf=0.0)
        found = np.maximum(found, np.abs(there * units).max(axis=1, initial=0.0))
    return np.where(found > 0.0, found, 1.0)


def residuals(servo: Servo, plan: Plan, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Gaps at position level and at velocity level of all relations of a plan, contacts and hidden ones included."""
    rows = _rows(servo, plan, state)
    return rows.gap, rows.rate


def _rows(servo: Servo, plan: Plan, state: State) -> Rows:
    return tree_rows(servo, plan.scalars)(state)[0]


def _correction(servo: Servo, plan: Plan, state: State, residual, level: str) -> np.ndarray:
    """Change of q or v that removes the residual to first order."""
    count, width = servo.n_contacts, servo.system.n_v
    rows = _rows(servo, plan, state)
    short = residual(rows)
    meets = np.array([scalar.level in ("position", level) for scalar in plan.scalars])
    contacts, held = np.flatnonzero(meets[:count]), np.flatnonzero(meets[count:])
    move = np.zeros(width)
    if contacts.size:
        move = contact_responses(servo, state, plan).part(contacts).guided(move, short[contacts])
    if not held.size:
        return move
    part = instant(servo, state, plan).part(held)
    left = short[count:][held] - rows.G[count:][held] @ move
    if plan.reduced:
        return move + part.guided(np.zeros(width), left)
    root, own = np.sqrt(servo.weight), sizes(servo, plan)[count:][held]
    efforts = np.linalg.lstsq(part.S / own[:, None] / root, left / own, rcond=None)[0] / root
    return move + part.X_W[-width:] @ efforts
