"""Global error of a motion, from the same motion with smaller steps (Richardson; Hairer, Nørsett, Wanner I, II.4)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.integrators import FixedStep, Integrator, Tolerance
from gauss.simulation.trajectory import Trajectory
from gauss.system import System

TIGHTER = 1e-2  # of the tolerance: what is left of the error is a few hundredths, and not counted
TIGHTEST = 1e-14  # of rtol, where rounding begins


def verified(motion: Trajectory, method: Integrator, step, tolerance: Tolerance, again: Callable) -> Trajectory:
    """Motion with an estimate of its global error in its statistics.

    Of a method with a fixed step the step is halved, and its order tells the error; of the others the tolerances become a
    hundredth, and the difference is the error.

    Parameters
    ----------
    motion : Trajectory
        What was computed.
    method, step, tolerance
        How.
    again : callable
        (step, tolerance, times) → the motion made again.
    """
    times, rows = np.unique(motion.t, return_index=True)
    if isinstance(method, FixedStep):
        finer, share = again(step / 2.0, tolerance, times), 2.0**method.order / (2.0**method.order - 1.0)
    else:
        rtol = max(tolerance.rtol * TIGHTER, min(tolerance.rtol, TIGHTEST))
        atol, atol_rates = tolerance.atol * TIGHTER, tolerance.atol_rates * TIGHTER
        tighter = replace(tolerance, rtol=rtol, atol=atol, atol_rates=atol_rates)
        finer, share = again(step, tighter, times), 1.0
    coordinates = share * np.abs(_apart(motion.system, motion.q[rows], finer.q)).max(initial=0.0)
    rates = share * np.abs(motion.v[rows] - finer.v).max(initial=0.0)
    return replace(motion, stats=replace(motion.stats, global_error=(float(coordinates), float(rates))))


def _apart(system: System, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Differences of coordinates; of quaternions the angle of the rotation between them [rad]."""
    apart = one - two
    for place in system.quaternions.values():
        same = np.where(np.sum(one[:, place] * two[:, place], axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        apart[:, place] = 2.0 * np.linalg.norm(one[:, place] - same * two[:, place], axis=1, keepdims=True)
    return apart
