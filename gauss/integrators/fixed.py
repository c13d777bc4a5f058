"""Methods of a fixed step: classical RK4 and semi-implicit Euler."""

import numpy as np

from gauss.integrators.step import Chart, Evaluate, Point, stages
from gauss.integrators.tableaus import RK4
from gauss.system import State, System, retract
from gauss.tracing import Scalar


def rk4(system: System, evaluate: Evaluate, point: Point, h: Scalar) -> Point:
    """One step of the classical Runge–Kutta method, order 4 (Kutta 1901)."""
    chart = Chart(system, point.state, evaluate)
    y = chart.start(point)
    K = stages(RK4, chart, y, chart.rate(y, point.rates), h)
    return chart.point(point.state.t + h, y + h * (RK4.b @ K))


def semi_implicit_euler(system: System, evaluate: Evaluate, point: Point, h: Scalar) -> Point:
    """One step of the semi-implicit (symplectic) Euler method, order 1: rates first, then coordinates with the new rates.

    Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2, eq. 1.9.
    """
    state = point.state
    v = state.v + h * point.rates.acceleration
    moved = State(state.t + h, retract(system, state.q, h * v), v)
    return Point(moved, point.work + h * np.asarray(point.rates.power), evaluate(moved))


FIXED = {"rk4": rk4, "semi_implicit_euler": semi_implicit_euler}
