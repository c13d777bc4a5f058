"""What steps of a motion under servos heed: laws of the loads of the scene, and of the relations."""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression, Function
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.switching_functions import Switching, SwitchingFunctions, switching
from gauss.dynamics.laws.switching_times import timetable
from gauss.dynamics.laws.traced_laws import Laws
from gauss.servo.plan import Plan
from gauss.servo.rows import rows
from gauss.servo.servo import Servo
from gauss.system import State


class _RelationLaws(NamedTuple):
    """Relations with their derivatives, in the form of :class:`gauss.dynamics.laws.traced_laws.Laws`."""

    motion: Kinematics
    outputs: list[Expression]
    functions: list[tuple[str, Function]]


def servo_switching(servo: Servo, plan: Plan, start: State, end: float, breaks) -> Switching:
    """What steps of a motion under servos heed.

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
    breaks : ndarray
        Further times when something switches [s].
    """
    loads = switching(servo.system, Laws(servo.system), start, end, breaks)
    laws = _relation_laws(servo, plan)
    times = loads.times.join(timetable(laws.outputs, laws.motion.state.t, start.t, end))
    watch = servo.made((SwitchingFunctions, plan.scalars), lambda: SwitchingFunctions(servo.system, laws))
    if not watch:
        return loads._replace(times=times)
    own, other = watch.machine_code, loads.watch
    both = own if other is None else lambda ends: np.minimum(own(ends), other(ends))
    return loads._replace(times=times, watch=both, conditional=(*loads.conditional, *watch.names))


def _relation_laws(servo: Servo, plan: Plan) -> _RelationLaws:
    """Relations and what their rows are made of, in symbols."""
    found = rows(list(plan.scalars), servo.symbols)
    functions = []
    for k, scalar in enumerate(plan.scalars):
        entries = [found.gap[k], found.rate[k], *found.G[k], found.gamma[k]]
        functions.append((scalar.name, Function("relation", [], [x for x in entries if isinstance(x, Expression)])))
    return _RelationLaws(
        servo.symbols.motion, [output for _, function in functions for output in function.outputs], functions
    )
