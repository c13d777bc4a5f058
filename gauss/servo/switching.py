"""Switching times and functions of a motion under servos: of the laws of loads, and of the relations."""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression, Function
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.switching import Switching, switching
from gauss.dynamics.laws.switching_functions import SwitchingFunctions
from gauss.dynamics.laws.switching_times import timetable
from gauss.dynamics.laws.traced_laws import Laws
from gauss.servo.instant import number
from gauss.servo.plan import RelationPlan
from gauss.servo.relation import rows
from gauss.servo.servo import Servo
from gauss.system import State


class _RelationLaws(NamedTuple):
    """Relations with their derivatives, in the form of the laws of :mod:`gauss.dynamics.laws.switching_functions`."""

    motion: Kinematics
    outputs: list[Expression]
    functions: list[tuple[str, Function]]


def servo_switching(servo: Servo, plan: RelationPlan, start: State, end: float, breaks) -> Switching:
    """Switching times and functions that the steps of a motion under servos resolve, up to its end [s].

    ``breaks``: further switching times [s].
    """
    loads = switching(servo.system, Laws(servo.system), start, end, breaks)
    laws = _relation_laws(servo, plan)
    times = loads.times.join(timetable(laws.outputs, servo.symbols.t, number(start.t), end))
    watch = servo.made((SwitchingFunctions, plan.scalars), lambda: SwitchingFunctions(servo.system, laws))
    if not watch:
        return loads._replace(times=times)
    own, other = watch.machine_code, loads.watch
    both = own if other is None else lambda ends: _joined(own(ends), other(ends))
    return loads._replace(times=times, watch=both, conditional=(*loads.conditional, *watch.names))


def _joined(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Share, number and place of crossings of both."""
    share, _, place = np.minimum(one, other)
    return np.array([share, one[1] + other[1], place])


def _relation_laws(servo: Servo, plan: RelationPlan) -> _RelationLaws:
    """Relations and the entries of their rows, in symbols."""
    found = rows(list(plan.scalars), servo.symbols)
    functions = []
    for k, scalar in enumerate(plan.scalars):
        entries = [found.position[k], found.velocity[k], *found.G[k], found.gamma[k]]
        functions.append((scalar.name, Function("relation", [], [x for x in entries if isinstance(x, Expression)])))
    return _RelationLaws(
        servo.symbols.motion, [output for _, function in functions for output in function.outputs], functions
    )
