"""Explicit Runge–Kutta pairs with step control and dense output, on the configuration manifold.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.5 (the pairs), II.6 (dense output).
"""

from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.integrators.control import TINY, Tolerance, Trial, next_factor
from gauss.integrators.step import Chart, Cost, Equations, Point, stages
from gauss.integrators.tableaus import DOP853, DOPRI5, Pair
from gauss.system import State
from gauss.tracing import Scalar


@dataclass(frozen=True)
class ExplicitPair:
    """Embedded pair.

    Parameters
    ----------
    name, title, reference : str
        See :class:`gauss.integrators.method.Integrator`.
    pair : Pair
        Its coefficients.
    """

    name: str
    title: str
    reference: str
    pair: Pair

    @property
    def order(self) -> int:
        """Order of convergence."""
        return self.pair.order

    @property
    def evaluations(self) -> int:
        """Evaluations of the accelerations in a step."""
        return self.pair.c.size

    def attempt(self, equations: Equations, point: Point, h: Scalar, tolerance: Tolerance) -> Trial:
        """Try one step; what is kept are its slopes."""
        chart = Chart(equations, point.state)
        y = chart.start(point)
        K = stages(self.pair, chart, y, chart.rate(y, point.rates), h)
        end = y + h * (self.pair.b @ K)
        reached = chart.point(point.state.t + h, end)
        K = np.concatenate([K, chart.rate(end, reached.rates)[None]])
        scale = math.maximum(*(tolerance.scale(chart.system, state) for state in (point.state, reached.state)))
        error = h * self._norm(K[:, : scale.size], scale)  # the work follows from the motion, without control of its own
        return Trial(reached, error, next_factor(error, self.order), K, Cost(self.evaluations))

    def _norm(self, K: np.ndarray, scale: np.ndarray) -> Scalar:
        """Error of the slope over the step, relative to what is allowed."""
        first, *second = (np.sum((weights @ K / scale) ** 2) for weights in self.pair.errors)
        if not second:
            return np.sqrt(first / scale.size)
        return first / np.sqrt(math.maximum((first + 0.01 * second[0]) * scale.size, TINY))

    def dense(self, equations: Equations, point: Point, h: Scalar, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """Coefficients of dense output."""
        pair, chart = self.pair, Chart(equations, point.state)
        y = chart.start(point)
        K = kept.reshape(pair.c.size + 1, -1)
        first, last = K[0], K[-1]
        for a, c in zip(pair.extra_A, pair.extra_c, strict=True):
            K = np.concatenate([K, chart(chart.origin.t + c * h, y + h * (a[: len(K)] @ K))[None]])
        moved = h * (pair.b @ K[: pair.c.size])
        F = np.concatenate([[moved, h * first - moved, 2 * moved - h * (first + last)], h * (pair.dense @ K)])
        return F, pair.extra_c.size

    def interpolate(self, equations: Equations, point: Point, h: Scalar, coefficients, t) -> tuple[State, np.ndarray]:
        """State and work at a time within a step from a point."""
        chart = Chart(equations, point.state)
        start = chart.start(point)
        x, y = (t - point.state.t) / h, np.zeros_like(start)
        for i, coefficient in enumerate(coefficients.reshape(-1, start.size)[::-1]):
            y = (y + coefficient) * (x if (len(self.pair.dense) + i) % 2 == 0 else 1.0 - x)
        y = y + start
        return chart.state(t, y), y[2 * chart.system.n_v :]


EXPLICIT = (
    ExplicitPair(
        "dop853", "Dormand–Prince 8(5,3)", "Hairer, Nørsett, Wanner, Solving ODEs I, 2nd ed., II.5 and II.6", DOP853
    ),
    ExplicitPair(
        "dopri5", "Dormand–Prince 5(4)", "Dormand and Prince 1980; Hairer, Nørsett, Wanner, Solving ODEs I, II.5", DOPRI5
    ),
)
