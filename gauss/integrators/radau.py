"""Radau IIA of order 5, implicit: for stiff scenes, in which stability limits the steps of explicit methods.

Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.5 (the method), IV.8 (its implementation).
"""

from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.integrators.control import LARGEST_ERROR, Tolerance, TrialStep, next_factor
from gauss.integrators.iterate import newton
from gauss.integrators.step import Cost, Equations, Point
from gauss.system import State, System, chart_rate, retract

ROOT = np.sqrt(6.0)
A = np.array(
    [
        [(88 - 7 * ROOT) / 360, (296 - 169 * ROOT) / 1800, (-2 + 3 * ROOT) / 225],
        [(296 + 169 * ROOT) / 1800, (88 + 7 * ROOT) / 360, (-2 - 3 * ROOT) / 225],
        [(16 - ROOT) / 36, (16 + ROOT) / 36, 1 / 9],
    ]
)
C = np.array([(4 - ROOT) / 10, (4 + ROOT) / 10, 1.0])
REAL = (6 + 81 ** (1 / 3) - 9 ** (1 / 3)) / 30  # γ₀: the inverse of the real eigenvalue of A⁻¹
ERROR = REAL / 3 * np.array([-13 - 7 * ROOT, -13 + 7 * ROOT, -1.0])
ERROR_ORDER = 4  # power of h in the error estimate
REST_RATE = 1e-3  # units of the scene over its time: added to the rates that changes of rates are compared with


@dataclass(frozen=True)
class RadauIIA:
    """Collocation at three Radau points, stiffly accurate."""

    name: str = "radau5"
    title: str = "Radau IIA, 3 stages"
    order: int = 5
    reference: str = "Hairer, Wanner, Solving ODEs II, 2nd ed., IV.5 and IV.8"
    evaluations: int = 48
    mechanical: bool = False

    def attempt(
        self, equations: Equations, point: Point, h: Scalar, tolerance: Tolerance, steps: Scalar | None = None
    ) -> TrialStep:
        """Trial step; the number of steps so far does not bound its step-size factor."""
        reached, slopes, cost = self._step(equations, point, h)
        system, state, n = equations.system, point.state, equations.system.n_v
        scale = math.maximum(*(tolerance.scale(system, at) for at in (state, reached.state)))
        raw = h * ((ERROR @ A) @ slopes)

        def residual(e):
            q, v = retract(system, state.q, e[:n]), state.v + e[n:]
            rates = equations.evaluate(State(state.t, q, v))
            return e - REAL * h * np.concatenate([chart_rate(system, e[:n], v), rates.acceleration]) - raw

        start = REAL * h * np.concatenate([state.v, point.rates.acceleration]) + raw
        found = newton(residual, start, *compared(system, state))
        unsolved = cost.unsolved + found.unsolved
        error = np.sqrt(np.sum((found.x / scale) ** 2) / scale.size)
        error = math.where(unsolved > 0.0, 10.0 * LARGEST_ERROR, error)
        cost = Cost(cost.evaluations + found.calls, cost.factorisations + found.factorisations, unsolved)
        return TrialStep(reached, error, next_factor(error, ERROR_ORDER), np.zeros(0), cost)

    def _step(self, equations: Equations, point: Point, h: Scalar) -> tuple[Point, np.ndarray, Cost]:
        """End of the step, slopes (3, 2 n_v) of (θ, v), and the cost."""
        system, state, n = equations.system, point.state, equations.system.n_v

        def stages(x):
            """Slopes, chart coordinates θ, and rates of all stages."""
            moved = x.reshape(len(C), -1)
            v = state.v + A @ moved[:, -n:]
            turning = v if system.is_flat else moved[:, :n] / h
            return turning, h * (A @ turning), v

        def rates(theta, v):
            states = [
                State(state.t + c * h, retract(system, state.q, own), u) for c, own, u in zip(C, theta, v, strict=True)
            ]
            return [equations.evaluate(at) for at in states]

        def residual(x):
            turning, theta, v = stages(x)
            found = np.array([one.acceleration for one in rates(theta, v)])
            if system.is_flat:
                return x - h * found.ravel()
            turned = np.array([chart_rate(system, own, u) for own, u in zip(theta, v, strict=True)])
            return x - h * np.concatenate([turned, found], axis=1).ravel()

        first = point.rates.acceleration if system.is_flat else np.concatenate([state.v, point.rates.acceleration])
        size, units = compared(system, state)
        found = newton(residual, h * np.concatenate([first] * len(C)), size, np.tile(units[-first.size :], len(C)))
        turning, theta, v = stages(found.x)
        powers = np.array([one.power for one in rates(theta, v)])
        end = State(state.t + h, retract(system, state.q, theta[-1]), v[-1])
        reached = Point(end, point.work + h * (A[-1] @ powers), equations.evaluate(end))
        slopes = np.concatenate([turning, found.x.reshape(len(C), -1)[:, -n:] / h], axis=1)
        return reached, slopes, Cost(len(C) * (found.calls + 1), found.factorisations, found.unsolved)

    def dense(self, equations: Equations, point: Point, h: Scalar, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """No coefficients: the collocation polynomial is of lower order than the method, so samples take shorter steps."""
        return np.zeros(0), 0

    def interpolate(self, equations: Equations, point: Point, h: Scalar, coefficients, t) -> tuple[State, np.ndarray]:
        """State and work after a shorter step, from which the motion does not continue."""
        reached, _, _ = self._step(equations, point, t - point.state.t)
        return State(t, reached.state.q, reached.state.v), reached.work


def compared(system: System, state: State) -> tuple[Scalar, np.ndarray]:
    """Size that changes of the unknowns are compared with [1/s], and units (2 n_v,) of coordinates and rates for this."""
    scale = system.scale
    size = np.sum(np.abs(state.v) / scale.coordinates) + REST_RATE / scale.time
    return size, np.concatenate([scale.coordinates * scale.time, scale.coordinates])


RADAU = (RadauIIA(),)
