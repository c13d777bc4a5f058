"""Assembly from a rough guess: Newton's method, the path of small Newton steps, then such paths from starts around it.

Newton's steps follow q' = −J⁺ φ(q), along which φ shrinks to zero (Newton homotopy; Allgower and Georg, Introduction to
Numerical Continuation Methods, ch. 3). Full steps may leap over many turns of a joint; bounded ones stay near the path, and
so near the guess. Starts are drawn with a fixed seed: the same guess gives the same pose.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.projection import (
    LEAST_DAMPING,
    RESIDUAL_ROUNDOFF,
    clipped,
    limits,
    newton_step,
    position_residual_of,
    project_positions,
    relative,
    within_limits,
)
from gauss.system import State, System, retract

RESIDUAL_TOLERANCE = 1e-10  # residual relative to the scales of the rows of a consistent state
NEWTON_STEPS = 60
PATH_STEPS = 120
LARGEST_STEP = 0.5  # rad and lengths of the scene, of a step along the path
FAR_POSE = np.pi  # rad and lengths of the scene: from a pose that is farther away, a nearer one is looked for
STARTS = 24
SPREAD = 2.0  # rad and lengths of the scene: largest distance of a start from the guess


class AssembledPose(NamedTuple):
    """Pose that was found."""

    state: State  # coordinates
    residual: float  # position residual relative to the scales of the rows
    starts: int = 0  # number of starts tried beside the guess itself

    @property
    def is_met(self) -> bool:
        """Whether it meets the constraints."""
        return self.residual <= RESIDUAL_TOLERANCE


def assembled(system: System, guess: State, held, restart: bool) -> AssembledPose:
    """Pose that meets the constraints, near a guess if there is one, or that of the least residual.

    ``held``: entries of v whose coordinates are fixed. ``restart``: whether starts around the guess are tried where the
    paths from it end at a residual.
    """
    best = _pose(system, project_positions(system, guess, NEWTON_STEPS, held))
    if best.is_met and _distance(system, guess, best.state) <= FAR_POSE:
        return best
    best = min(best, followed(system, guess, held), key=lambda pose: _rank(system, guess, pose))
    if best.is_met or not restart:
        return best
    rng, free = np.random.default_rng(0), np.ones(system.n_v)
    free[list(held)] = 0.0
    for k in range(1, STARTS + 1):
        away = free * rng.uniform(-1.0, 1.0, system.n_v) * SPREAD * min(1.0, 4.0 * k / STARTS)
        moved = within_limits(system, replace(guess, q=retract(system, guess.q, away * system.scale.coordinates)))
        found = followed(system, moved, held)
        best = (found if found.residual < best.residual else best)._replace(starts=k)
        if best.is_met:
            break
    return best


def followed(system: System, state: State, held=()) -> AssembledPose:
    """End of the path of bounded Newton steps from a state."""
    lowest, highest = limits(system)
    phi, scales, units = position_residual_of(system, state), constraint_scales(system), system.scale.coordinates
    for _ in range(PATH_STEPS):
        size = np.linalg.norm(phi / scales)
        if relative(system, phi) <= RESIDUAL_ROUNDOFF:
            break
        step = newton_step(system, state, phi, held, lowest, highest)
        first = share = min(1.0, LARGEST_STEP / max(np.abs(step / units).max(), LARGEST_STEP))
        while share >= LEAST_DAMPING * first:
            trial = clipped(system, replace(state, q=retract(system, state.q, share * step)), lowest, highest)
            trial_phi = position_residual_of(system, trial)
            if np.linalg.norm(trial_phi / scales) < size:
                break
            share /= 2
        else:
            break
        state, phi = trial, trial_phi
    return _pose(system, state)


def _pose(system: System, state: State) -> AssembledPose:
    return AssembledPose(state, relative(system, position_residual_of(system, state)))


def _distance(system: System, guess: State, state: State) -> float:
    """Largest change of a coordinate [rad, lengths of the scene]."""
    found = 0.0
    for joint in system.joints:
        change = np.abs(state.q[joint.q] - guess.q[joint.q])
        units = system.scale.coordinates[joint.v][: joint.n_plain]
        found = max(found, float((change[: joint.n_plain] / units).max(initial=0.0)))
    return found


def _rank(system: System, guess: State, pose: AssembledPose) -> tuple[float, float]:
    """Met before unmet; of the met, the nearer first."""
    return (0.0, _distance(system, guess, pose.state)) if pose.is_met else (pose.residual, 0.0)
