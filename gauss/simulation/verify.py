"""Global error of a motion from its repetition with smaller steps (Richardson; Hairer, Nørsett, Wanner I, II.4)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Tolerance
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.system import System

TOLERANCE_FACTOR = 1e-2  # factor of the tolerances: the error of the repetition is neglected
LEAST_RTOL = 1e-14  # least rtol of the repetition: the level of rounding
MESH_PLACES = np.array([0.25, 0.75])  # places in every step at which steps of the repetition end
ROUNDINGS_PER_STEP = 2.0  # roundings of a coordinate in a step, which accumulate as a random walk


def verified(motion: Trajectory, problem: Problem, again: Callable[..., Trajectory]) -> Trajectory:
    """Motion with an estimate of its global error in its statistics.

    A fixed step is halved, and the order of the method gives the error. Other methods repeat the motion with a hundredth of
    the tolerances and steps that end at other times and are at most half as long; the difference is the error. It is no less
    than accumulated rounding, and infinite where the repetition fails. ``again``: (step, tolerance, times, mesh) →
    repetition, with steps that end at the times of the mesh.
    """
    method, step, tolerance = problem.method, problem.step, problem.tolerance
    times, rows = np.unique(motion.t, return_index=True)
    try:
        if isinstance(method, FixedStep) and step is not None:
            finer = again(step / 2.0, tolerance, times, ())
            share = 2.0**method.order / (2.0**method.order - 1.0)
        else:
            finer, share = _finer(motion, step, tolerance, times, again), 1.0
    except SimulationError:
        return replace(motion, stats=motion.stats._replace(global_error=(np.inf, np.inf)))
    coordinates = share * np.abs(differences(motion.system, motion.q[rows], finer.q)).max(initial=0.0)
    rates = share * np.abs(motion.v[rows] - finer.v).max(initial=0.0)
    rounding = ROUNDINGS_PER_STEP * np.finfo(float).eps * np.sqrt(max(motion.stats.steps, 1))
    floors = [rounding * np.abs(part).max(initial=0.0) for part in (motion.q, motion.v)]
    found = max(float(coordinates), float(floors[0])), max(float(rates), float(floors[1]))
    return replace(motion, stats=motion.stats._replace(global_error=found))


def _finer(motion: Trajectory, step, tolerance: Tolerance, times: np.ndarray, again: Callable) -> Trajectory:
    """Repetition with tighter tolerances and another mesh; with another mesh alone where they cannot be met."""
    steps = np.unique(motion.t if motion.stats.steps < len(motion) else again(step, tolerance, None, ()).t)
    mesh = np.ravel(steps[:-1, None] + MESH_PLACES * np.diff(steps)[:, None])
    rtol = max(tolerance.rtol * TOLERANCE_FACTOR, min(tolerance.rtol, LEAST_RTOL))
    atol, atol_rates = tolerance.atol * TOLERANCE_FACTOR, tolerance.atol_rates * TOLERANCE_FACTOR
    try:
        return again(step, replace(tolerance, rtol=rtol, atol=atol, atol_rates=atol_rates), times, mesh)
    except SimulationError:
        return again(step, tolerance, times, mesh)


def differences(system: System, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Differences of coordinates; of quaternions the angle of the rotation between them [rad]."""
    apart = one - two
    for place in system.quaternions.values():
        same = np.where(np.sum(one[:, place] * two[:, place], axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        apart[:, place] = 2.0 * np.linalg.norm(one[:, place] - same * two[:, place], axis=1, keepdims=True)
    return apart
