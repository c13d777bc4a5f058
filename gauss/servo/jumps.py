"""Relations of servos whose law of time jumps, in position or in speed: no finite effort holds them."""

from dataclasses import replace

import numpy as np

from gauss.dynamics.prescribed_jumps import LOOKS, RELATIVE, SMOOTH
from gauss.dynamics.timetable import timetable
from gauss.errors import SimulationError
from gauss.servo.plan import Plan
from gauss.servo.project import residuals
from gauss.servo.servo import Servo
from gauss.system import State


def refuse_jumps(servo: Servo, plan: Plan, start: State, end: float):
    """Refuse a motion on the way of which a relation jumps.

    Parameters
    ----------
    servo : Servo
        The servo.
    plan : Plan
        How its relations are held.
    start : State
        Where the motion begins.
    end : float
        When it ends [s].

    Raises
    ------
    SimulationError
        With the name of the relation, when it jumps, and by how much.
    """
    times = timetable([scalar.residual for scalar in plan.scalars], servo.symbols.motion.state.t, start.t, end)
    stops = [stop for stop in times.stops(start.t, end) if stop[0] < stop[1]]
    if not stops:
        return

    def at(t: float) -> np.ndarray:
        return np.array(residuals(servo, plan, replace(start, t=t)))

    looks = np.array([at(t) for t in [*np.linspace(start.t, end, LOOKS), *np.ravel(stops)]])
    sizes = RELATIVE * (np.ptp(looks, axis=0) + np.abs(looks).max(axis=0))
    for before, after in stops:
        one, two = at(before), at(after)
        smooth = np.abs(one - at(2.0 * before - after)) + np.abs(at(2.0 * after - before) - two)
        jump = np.abs(two - one)
        wrong = np.argwhere(jump > np.maximum(sizes, SMOOTH * smooth))
        if wrong.size:
            level, which = wrong[0]
            what = ("position [m, rad]", "speed [m/s, rad/s]")[level]
            raise SimulationError(
                f"relation {plan.scalars[which].name!r}: its {what} jumps by {jump[level, which]:.6g} at "
                f"t = {before:.9g} s, which takes an infinite effort. Give a law whose speed does not jump, for instance "
                "the profile 'move'."
            )
