"""Realisability of servo-constraints: rank of S at a state and around it; index reduction for higher relative degrees."""

from dataclasses import replace

import numpy as np

from gauss.backends.closure import Factor
from gauss.dynamics.assemble import assemble
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.servo.instant import ServoInstant
from gauss.servo.kernels import responses, tree_rows, untraced
from gauss.servo.plan import NoReductionError, RelationPlan, direct, neighbours, reduced
from gauss.servo.saddle import Saddle
from gauss.servo.servo import Servo, state_of
from gauss.servo.verdict import UnrealisableError, Verdict, verdict_of
from gauss.system import State


def realisable(servo: Servo, state: State | None = None) -> Verdict:
    """Whether the relations can be held by the actuators, at a state and around it.

    * r > j: more relations than efforts, impossible; r = j: determinate; r < j: indeterminate, efforts of least weighted
      norm are chosen;
    * S = G N H_N⁻¹Nᵀ Wᵀ must have rank r: elsewhere, neighbouring states tell a singular configuration from a
      relation whose second derivative contains no effort; then index reduction is tried.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State, optional
        State; the start of the scene when not given. It need not be on the relations.

    Returns
    -------
    Verdict
        True if they can be held; else with the reason.
    """
    state = state_of(servo, state, "servo.realisable")
    servo.follow_laws()
    plan = direct(servo)
    verdict = verdict_of(instant(servo, state, plan), servo.held, servo.efforts)
    if verdict.outcome != "rank lost":
        return replace(verdict, degree=plan.degree)
    around = [verdict_of(instant(servo, near, plan), servo.held, servo.efforts) for near in neighbours(servo, state)]
    if any(near.outcome != "rank lost" for near in around):
        return verdict
    if len(servo.held) > len(servo.efforts):
        return replace(verdict, outcome="impossible", reason=f"more relations than efforts, and {verdict.reason}")
    try:
        plan = servo.made((reduced,), lambda: reduced(servo, state))
    except NoReductionError as error:
        return replace(verdict, outcome="no hold", reason=f"{verdict.reason}; {str(error).rstrip('.')}")
    names = tuple(plan.scalars[servo.n_contacts + i].name for i in plan.active)
    local = verdict_of(instant(servo, state, plan).part(list(plan.active)), names, servo.efforts)
    if not local:
        return replace(local, degree=plan.degree)
    return Verdict(
        servo.held,
        servo.efforts,
        local.rank,
        local.singular_values,
        "higher degree",
        f"efforts act on the derivative of order {plan.degree} only (the second derivative alone has rank {verdict.rank})",
        plan.degree,
    )


def planned(servo: Servo, state: State) -> RelationPlan:
    """Rows by which the relations are held from a state on; UnrealisableError if they cannot be held."""
    verdict = realisable(servo, state)
    if not verdict:
        raise UnrealisableError(f"t = {state.t:.6g} s: {verdict}.", verdict)
    return servo.made((reduced,), lambda: reduced(servo, state)) if verdict.outcome == "higher degree" else direct(servo)


def instant(servo: Servo, state: State, plan: RelationPlan) -> ServoInstant:
    """Instant at a state on the contacts, by machine code where the dynamics can be traced.

    UnrealisableError if a number is not finite: an actuator has no direction, or the state is singular. StateError if a loop
    that cannot move has another pose than in the scene.
    """
    if untraced(servo):
        found = Saddle(servo, state).instant
    else:
        refuse_other_pose(servo.system, state.q)
        found = responses(servo, plan.scalars)(state).onto_contacts(servo.n_contacts)
    if not (np.isfinite(found.S).all() and np.isfinite(found.b).all()):
        raise UnrealisableError(
            f"t = {state.t:.6g} s: rows or directions of the servos are not finite: a cable of no length, or a residual "
            "that is not defined here."
        )
    return found


def contact_responses(servo: Servo, state: State, plan: RelationPlan) -> ServoInstant:
    """Instant of the relations that contacts keep, before these contacts act."""
    kept = slice(0, servo.n_contacts)
    if not untraced(servo):
        return responses(servo, plan.scalars)(state).part(kept)
    rows, W = tree_rows(servo, plan.scalars)(state)
    factor, width = Factor(assemble(servo.system, state)), servo.system.n_v
    zeros = np.zeros(servo.system.Phi.size), np.zeros(factor.compulsion.D.size)
    X_W, X_G = (np.array([factor.solve(*zeros, row)[1] for row in part]).reshape(-1, width).T for part in (W, rows.G[kept]))
    return ServoInstant(
        rows.position[kept],
        rows.velocity[kept],
        rows.G[kept],
        rows.gamma[kept],
        W,
        np.zeros(width),
        X_W,
        X_G,
        W @ state.v,
        np.zeros(3),
    )
