"""Explicit fixed-step methods: classical RK4; semi-implicit Euler v₁ = v₀ + h a₀, q₁ = q₀ ⊕ h v₁."""

import numpy as np

from gauss.codegen import Scalar
from gauss.integrators.method import FixedStep
from gauss.integrators.step import Chart, Cost, Equations, Point, stages
from gauss.integrators.tableaus import RK4
from gauss.system import State, retract


def rk4(equations: Equations, point: Point, h: Scalar) -> tuple[Point, Cost]:
    """One step of the classical Runge–Kutta method."""
    chart = Chart(equations, point.state)
    y = chart.start(point)
    K = stages(RK4, chart, y, chart.rate(y, point.rates), h)
    return chart.point(point.state.t + h, y + h * (RK4.b @ K)), Cost(4)


def semi_implicit_euler(equations: Equations, point: Point, h: Scalar) -> tuple[Point, Cost]:
    """One step of the semi-implicit Euler method: rates first, then coordinates with the new rates."""
    state = point.state
    v = state.v + h * point.rates.acceleration
    moved = State(state.t + h, retract(equations.system, state.q, h * v), v)
    return Point(moved, point.work + h * np.asarray(point.rates.power), equations.evaluate(moved)), Cost(1)


EXPLICIT_FIXED = (
    FixedStep("rk4", "classical Runge–Kutta", 4, "Kutta 1901", 4, rk4, evaluates_end=True),
    FixedStep(
        "semi_implicit_euler",
        "semi-implicit Euler",
        1,
        "Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2, eq. 1.9",
        1,
        semi_implicit_euler,
    ),
)
