"""Assembly modes: all solutions q of the constraints g(q) = 0 with given values of some coordinates, from random starts."""

from dataclasses import replace
from typing import cast

import numpy as np

from gauss.arguments import generator
from gauss.backends.closure import Factor
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.assembly_search import NEWTON_STEPS, RESIDUAL_TOLERANCE
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.projection import (
    fixed_columns,
    held_factor,
    position_residual_of,
    project_positions,
    relative,
    within_limits,
)
from gauss.errors import StateError
from gauss.system import State, System, retract

IDLE_STARTS = 30  # successive random starts without a new mode, after which the search ends
EQUAL_POSES = 1e-6  # rad and sizes of the mechanism: closer poses are one mode


def assembly_modes(system: System, keep, state: State | None = None, seed: int = 0) -> list[State]:
    """Poses of a mechanism that satisfy its constraints with given values of some coordinates.

    The search starts from many poses. A planar loop with all its inputs given has at most two modes, which are found
    reliably; of mechanisms with more loops some may be missed.

    Parameters
    ----------
    system : System
        The system.
    keep : sequence of str
        Inputs: joints, or single rates such as "U.angle1"; as many as degrees of freedom.
    state : State, optional
        State with the values of the inputs; the start of the scene by default.
    seed : int
        Seed of the random poses.

    Returns
    -------
    list of State
        Modes at rest, in the order of their distance from the given state; angles of hinges lie in ±π.

    Raises
    ------
    StateError
        If degrees of freedom remain, so that modes are not isolated, or if no pose satisfies the constraints.
    """
    start = system.state(system.start(0.0).q) if state is None else system.state(state.q, t=state.t)
    held = fixed_columns(system, keep)
    free = np.ones(system.n_v)
    free[held] = 0.0
    rng, idle = generator(seed, "assembly_modes"), 0
    found: list[State] = []
    while idle < IDLE_STARTS:
        away = np.pi * free * system.scale.coordinates * rng.uniform(-1.0, 1.0, system.n_v)
        idle += 1
        pose = project_positions(
            system, within_limits(system, replace(start, q=retract(system, start.q, away))), NEWTON_STEPS, held
        )
        if relative(system, position_residual_of(system, pose)) > RESIDUAL_TOLERANCE:
            continue
        if not found:
            _refuse_freedoms(system, pose, held)
        pose = replace(pose, q=_wound_back(system, pose.q))
        if all(_distance(system, pose, other) > EQUAL_POSES for other in found):
            found.append(pose)
            idle = 0
    if not found:
        raise StateError(f"no pose closes the mechanism while {', '.join(keep)} keep their values; check them.")
    return sorted(found, key=lambda pose: _distance(system, pose, start))


def _refuse_freedoms(system: System, pose: State, held):
    motion = kinematics(system, pose)
    factor = cast(Factor, held_factor(system, assemble_motion(motion, Applied(motion, ())), held))  # no body is massless
    in_tree = sum(columns.stop - columns.start for columns in factor.tree.columns)
    remaining = in_tree - (factor.rank if factor.size else 0)
    if remaining:
        raise StateError(
            f"{remaining} freedom{'s remain' if remaining > 1 else ' remains'}, so that there are modes without end; "
            f"keep {remaining} more of {', '.join(system.coordinates)}."
        )


def _wound_back(system: System, q: np.ndarray) -> np.ndarray:
    """Pose with angles of hinges in ±π."""
    q = q.copy()
    for joint in system.joints:
        if joint.pair.kind == "revolute" and system.scene.joints[joint.name].limits is None:
            q[joint.q] = np.arctan2(np.sin(q[joint.q]), np.cos(q[joint.q]))
    return q


def _distance(system: System, one: State, two: State) -> float:
    """Largest difference of positions, in sizes of the mechanism, and of axes of the bodies."""
    a, b, n = kinematics(system, one), kinematics(system, two), system.structure.n_bodies
    places = max(np.linalg.norm(a.x[i] - b.x[i]) for i in range(n)) / system.scale.length
    return max(places, max(np.abs(a.R[i] - b.R[i]).max() for i in range(n)))
