"""Zeros of a function along a motion, to rounding: Brent's method on repeated short motions."""

from collections.abc import Callable
from numbers import Real

import numpy as np

from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.errors import GaussError, SimulationError, require
from gauss.simulation.brent import brent
from gauss.simulation.simulate import simulate
from gauss.simulation.tolerances import shares_of_scale
from gauss.simulation.trajectory import Trajectory
from gauss.system import State

FINEST = 1e-14  # tolerance, relative to the scale of the scene or to a time


def crossings(trajectory: Trajectory, function: Callable[[Kinematics], float], *, direction: int = 0) -> list[State]:
    """States in which a function of the motion passes through zero.

    The function is evaluated at every sample; between two samples of different sign the motion is repeated from the first
    one, with tolerances near rounding, and the zero is located by Brent's method.

    Parameters
    ----------
    trajectory : Trajectory
        The motion; pairs of zeros between two samples are not detected.
    function : callable
        Takes a :class:`gauss.Kinematics`, returns a number.
    direction : int
        1: only where it increases; −1: only where it decreases; 0: both.

    Returns
    -------
    list of State
        States at the zeros, in the order of time.

    Raises
    ------
    ArgumentError
        If the first argument is no trajectory.
    SimulationError
        If ``direction`` is none of these, or the function raises or gives no finite number.
    """
    require(trajectory, (Trajectory,), "crossings")
    if not isinstance(direction, int | np.integer) or direction not in (-1, 0, 1):
        raise SimulationError(f"direction: expected -1, 0 or 1, got {direction!r}.")
    system = trajectory.system
    values = np.array([_value(function, motion) for motion in trajectory.motions])
    found = []
    for k in range(len(trajectory) - 1):
        before, after = values[k], values[k + 1]
        if direction and direction * (after - before) <= 0.0:
            continue
        if before == 0.0 and k == 0:
            found.append(trajectory.state(0))
        if after == 0.0:
            found.append(trajectory.state(k + 1))
        elif before * after < 0.0:
            found.append(_between(system, function, trajectory.state(k), trajectory.state(k + 1)))
    return found


def _between(system, function, begin: State, end: State) -> State:
    reached = {begin.t: begin, end.t: end}
    atol = shares_of_scale(system, FINEST)

    def value(t: float) -> float:
        if t not in reached:
            span = t - begin.t
            motion = simulate(system, span, state=begin, times=[span], rtol=10.0 * FINEST, atol=atol, progress=False)
            reached[t] = motion.state(-1)
        return _value(function, kinematics(system, reached[t]))

    t = brent(value, begin.t, end.t, xtol=FINEST * (system.scale.time + abs(end.t)), rtol=9e-16)
    value(t)
    return reached[t]


def _value(function, motion: Kinematics) -> float:
    try:
        value = function(motion)
    except GaussError:
        raise
    except Exception as error:  # whatever a function of the user raises
        t = motion.state.t
        text = f"crossings: at t = {t:.6g} s its function raised {type(error).__name__}: {error}"
        raise SimulationError(text) from error
    if not isinstance(value, Real) or not np.isfinite(float(value)):
        raise SimulationError(f"crossings: at t = {motion.state.t:.6g} s its function gave {value!r}; expected a number.")
    return float(value)
