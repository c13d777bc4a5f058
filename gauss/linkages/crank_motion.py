"""Motion of the crank between the switching times of its motor: y = (θ, ω), y' = (ω, θ̈(θ, ω, t)), by DOP853.

No step crosses a switching time of the law of the motor, see :mod:`gauss.dynamics.laws.sampled_laws`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss.dynamics.laws.sampled_laws import sampled_times
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.errors import SimulationError
from gauss.integrators import LIBRARIES

DOP853 = next(method for method in LIBRARIES if method.name == "scipy_dop853")


class CrankMotion(NamedTuple):
    """Solution of the equation of the crank."""

    t: np.ndarray  # (k,): samples that were reached [s]
    y: np.ndarray  # (k, 2): angle and speed of the crank there [rad, rad/s]
    longest: float  # longest distance of two evaluations of the law of the motor [s]
    interruption: KeyboardInterrupt | None  # Ctrl-C, after which the samples end early


def motor_times(motor: Callable, start, duration: float, breaks=()) -> Timetable:
    """Switching times of the law of a motor (t, angle, speed), and a mesh where it varies, found by sampling in time.

    Parameters
    ----------
    motor : callable
        Law of the motor.
    start : array_like, shape (2,)
        Angle and speed of the crank at the start [rad, rad/s].
    duration : float
        Duration [s].
    breaks : sequence of float
        Further switching times, ascending [s].
    """
    given = Timetable(np.asarray(breaks, dtype=float), np.zeros(0))
    return sampled_times(lambda t, _: motor(t, *start), None, 0.0, duration, "the law of the motor").join(given)


def solved(rates: Callable, start, samples: np.ndarray, end: float, times: Timetable = NO_TIMES, **options) -> CrankMotion:
    """Solution of y' = rates(t, y) at samples.

    Parameters
    ----------
    rates : callable
        (t, y) → y'.
    start : array_like, shape (2,)
        Values at time 0.
    samples : ndarray, shape (k,)
        Ascending times [s].
    end : float
        Final time [s].
    times : Timetable
        Switching times and mesh.
    **options
        ``rtol``, ``atol`` and ``largest`` step [s] of the method.

    Raises
    ------
    SimulationError
        If the integrator fails.
    """
    begin, y = 0.0, np.asarray(start, dtype=float)
    reached, values = [np.zeros(0)], [np.zeros((0, 2))]
    evaluated, longest, interruption = begin, 0.0, None

    def watched(t, y):
        nonlocal evaluated, longest
        longest, evaluated = max(longest, t - evaluated), t
        return rates(t, y)

    for before, after in times.stops(0.0, end):
        inside = samples[(samples >= begin) & (samples <= before)]
        grid = np.unique(np.concatenate([[begin], inside, [before]]))
        found = DOP853.solve(watched, grid, y, options["rtol"], options["atol"], options["largest"])
        if found.failure is not None:
            raise SimulationError(found.failure)
        held = np.isin(found.t, inside)
        reached.append(found.t[held])
        values.append(found.y[held])
        interruption = found.interruption
        if interruption is not None:
            break
        y = found.y[-1]
        between = samples[(samples > before) & (samples < after)]  # a few units in the last place
        reached.append(between)
        values.append(np.tile(y, (len(between), 1)))
        if after > before:  # by the trapezoidal rule, whose evaluations are beside the switching time
            y = y + 0.5 * (after - before) * (np.array(rates(before, y)) + np.array(rates(after, y)))
        begin = after
    return CrankMotion(np.concatenate(reached), np.concatenate(values), longest, interruption)
