"""Explicit Runge–Kutta pairs with step control and dense output, on the configuration manifold.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.5 (the pairs), II.6 (dense output).
"""

from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.integrators.control import SMALLEST_DIVISOR, Tolerance, TrialStep, next_factor
from gauss.integrators.step import Chart, Cost, Equations, Point, stages
from gauss.integrators.tableaus import DOP853, DOPRI5, EmbeddedPair
from gauss.system import State, System


@dataclass(frozen=True)
class ExplicitPair:
    """Embedded pair of explicit Runge–Kutta methods.

    Parameters
    ----------
    name, title, reference : str
        See :class:`gauss.integrators.method.Integrator`.
    pair : EmbeddedPair
        Its coefficients.
    """

    name: str
    title: str
    reference: str
    pair: EmbeddedPair
    mechanical: bool = False

    @property
    def order(self) -> int:
        """Order of convergence."""
        return self.pair.order

    @property
    def evaluations(self) -> int:
        """Evaluations of the accelerations in a step."""
        return self.pair.c.size

    def state_size(self, system: System) -> int:
        """Size of its method state: compensation of y and t, σ of the constraint Jacobian, number of steps so far."""
        return 2 * system.n_v + 3 + 1 + 2

    def attempt(
        self, equations: Equations, point: Point, h: Scalar, tolerance: Tolerance, steps: Scalar | None = None
    ) -> TrialStep:
        """Trial step; its slopes are kept for dense output."""
        chart = Chart(equations, point.state)
        y = chart.start(point)
        K = stages(self.pair, chart, y, chart.rate(y, point.rates), h)
        end = y + h * (self.pair.b @ K)
        reached = chart.point(point.state.t + h, end)
        K = np.concatenate([K, chart.rate(end, reached.rates)[None]])
        error = self.error(chart.system, (point.state, reached.state), self.pair.errors @ K, h, tolerance)
        return TrialStep(reached, error, next_factor(error, self.order, steps), K, Cost(self.evaluations))

    def error(self, system: System, ends, estimates, h: Scalar, tolerance: Tolerance, noise=None) -> Scalar:
        """Error of a step between two states over the tolerance, from estimates (k, len(y)) of the error of the slope.

        The contribution of rounding to each estimate, ``noise`` (k,), is added to the tolerance. Of two estimates e₁, e₂ the
        error is h e₁² / √(e₁² + 0.01 e₂²) (Hairer et al. I, II.10, for DOP853).
        """
        scale = math.maximum(*(tolerance.scale(system, state) for state in ends))
        allowed = [scale] * len(estimates) if noise is None else [scale + np.abs(h * rounding) for rounding in noise]
        checked = slice(0, scale.size)  # (θ, v): the quadratures of work are not controlled
        squares = (np.sum((estimate[checked] / size) ** 2) for estimate, size in zip(estimates, allowed, strict=True))
        return self.error_of_squares(list(squares), scale.size, h)

    def error_of_squares(self, squares: list, count: int, h: Scalar) -> Scalar:
        """Error over the tolerance, from the sums of squares of ``count`` entries of each estimate over its tolerance."""
        first, *second = squares
        if not second:
            return h * np.sqrt(first / count)
        return h * first / np.sqrt(math.maximum((first + 0.01 * second[0]) * count, SMALLEST_DIVISOR))

    def dense(self, equations: Equations, point: Point, h: Scalar, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """Coefficients of dense output, and the evaluations of its extra stages."""
        pair, chart = self.pair, Chart(equations, point.state)
        y = chart.start(point)
        K = kept.reshape(pair.c.size + 1, -1)
        for a, c in zip(pair.extra_A, pair.extra_c, strict=True):
            K = np.concatenate([K, chart(chart.origin.t + c * h, y + h * (a[: len(K)] @ K))[None]])
        return h * (pair.polynomial @ K), pair.extra_c.size

    def interpolate(self, equations: Equations, point: Point, h: Scalar, coefficients, t) -> tuple[State, np.ndarray]:
        """State and work at a time within a step from a point, by dense output."""
        chart = Chart(equations, point.state)
        start = chart.start(point)
        y = start + self.change(coefficients.reshape(-1, start.size), (t - point.state.t) / h)
        return chart.state(t, y), y[2 * chart.system.n_v :]

    def change(self, coefficients: np.ndarray, x: Scalar) -> np.ndarray:
        """Change of y within a step by dense output, x being the time relative to the step."""
        y = np.zeros_like(coefficients[0])
        for i, coefficient in enumerate(coefficients[::-1]):
            y = (y + coefficient) * (x if (len(self.pair.dense) + i) % 2 == 0 else 1.0 - x)
        return y


EXPLICIT = (
    ExplicitPair(
        "dop853", "Dormand–Prince 8(5,3)", "Hairer, Nørsett, Wanner, Solving ODEs I, 2nd ed., II.5 and II.6", DOP853
    ),
    ExplicitPair(
        "dopri5", "Dormand–Prince 5(4)", "Dormand and Prince 1980; Hairer, Nørsett, Wanner, Solving ODEs I, II.5", DOPRI5
    ),
)
