"""Traced accelerations with iterative refinement: M δ + Kᵀ y = r, K δ = s for the residuals r, s of inverse dynamics.

One refinement that bounds the error of a single state, or refinement to round-off where masses differ by many orders.
Limits are met by sums of absolute values, which NaN enters; a maximum ignores it.
"""

from collections.abc import Callable

import numpy as np

from gauss import math
from gauss.backends.estimate import SHARE_AT_REST
from gauss.backends.rank import COARSEST_LOOP_RANK, LOOP_RANK
from gauss.dynamics.front_rank import embedding_of
from gauss.dynamics.mechanism import Mechanism, refined_forward_dynamics
from gauss.dynamics.traced_system import Program, absolute_sum, applied_loads, largest
from gauss.system import State


def refined_once(program: Program, q, v, tau, t, elimination: Callable[..., Mechanism] = Mechanism):
    """q̈ after one refinement, and [its error, constraint residual of the state, sum of all inputs].

    The error is the size of the refinement and of the remaining residuals of loop joints and loop constraints, not zero
    near singular configurations and for inconsistent redundant rows. A subsystem may not depend on an input, but the
    result is not finite if one of them is not.
    """
    state, system = State(t[0], q, v), program.system
    own, forces, _ = applied_loads(system, program.loads, state)
    mechanism, total = elimination(system, q, v, state.t), own + tau
    found, multipliers = mechanism.motion(total, forces)
    change, _ = mechanism.response(*mechanism.residual(found, multipliers, total, forces))
    reached = found + change
    rows, along = mechanism.acceleration_residual(reached), mechanism.dependent_accelerations(reached) - reached
    left = np.abs(change * program.own).sum() + np.abs(along * program.own).sum() + np.abs(rows * program.shares).sum()
    error = left / math.maximum(largest(found * program.own), program.error_scale(v))
    return reached, [error, program.residual(state), absolute_sum(q, v, total, t)]


def embedded_once(program: Program, q, v, tau, t):
    """The same with loops eliminated where they close."""
    return refined_once(program, q, v, tau, t, embedding_of(program.pattern))


def refined(program: Program, q, v, tau, t):
    """q̈ refined to round-off, and [its error by the measure of certificates, the rest as of :func:`refined_once`]."""
    acceleration, _, error, residual = _refined(program, State(t[0], q, v), tau)
    return acceleration, [error, residual, absolute_sum(q, v, tau, t)]


def refined_rates(program: Program, t, q, v, tau):
    """q̈ refined to round-off, power of the loads, and the error by the measure of certificates."""
    acceleration, power, error, _ = _refined(program, State(t[0], q, v), tau)
    return acceleration, power, [error]


def _refined(program: Program, state: State, tau):
    own, forces, power = applied_loads(program.system, program.loads, state)
    residual = program.residual(state)
    cut = math.clip(math.sqrt(residual), LOOP_RANK, COARSEST_LOOP_RANK)
    found = refined_forward_dynamics(program.system, state, own + tau, forces, cut)
    size = math.maximum(largest(found.rates * program.own), program.error_scale(state.v))
    each = zip(found.error * program.own, found.rates * program.own, strict=True)
    shares = [off / math.maximum(np.abs(rate), SHARE_AT_REST * size) for off, rate in each]
    error = sum(shares) + np.abs(found.residual * program.shares).sum() / size
    return found.rates, power + np.array([found.power, 0.0, 0.0]), error, residual
