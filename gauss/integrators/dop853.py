"""Dormand–Prince 8(5,3) with step control and dense output of order 7, on the configuration manifold.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4 (step control), II.5, II.6.
"""

from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.integrators.step import Chart, Evaluate, Point, stages
from gauss.integrators.tableaus import (
    DOP853,
    DOP853_DENSE,
    DOP853_ERROR_3,
    DOP853_ERROR_5,
    DOP853_EXTRA_A,
    DOP853_EXTRA_C,
)
from gauss.system import System, sizes
from gauss.tracing import Scalar

SAFETY, SLOWEST, FASTEST = 0.9, 0.2, 10.0  # of the next step against this one
TINY, HUGE = 1e-300, 1e300


@dataclass(frozen=True)
class Tolerance:
    """Local error allowed on coordinates and rates: atol + rtol · size.

    Parameters
    ----------
    rtol : float
        Relative to the coordinate or rate.
    atol : float
        In rad, m and their rates.
    """

    rtol: Scalar
    atol: Scalar

    def scale(self, system: System, state) -> np.ndarray:
        """Allowed error (2 n_v,) of (θ, v)."""
        return self.atol + self.rtol * np.concatenate([sizes(system, state.q), np.abs(state.v)])


@dataclass(frozen=True)
class Trial:
    """A step that was tried: where it leads, its error (accepted if ≤ 1), and what dense output needs."""

    chart: Chart
    start: np.ndarray
    h: Scalar
    K: np.ndarray
    point: Point
    error: Scalar

    @property
    def accepted(self) -> bool:
        """Whether the estimated error is within the tolerance."""
        return bool(self.error <= 1.0)

    @property
    def factor(self) -> Scalar:
        """Length of the next step over that of this one."""
        root = np.sqrt(np.sqrt(np.sqrt(math.maximum(self.error, TINY))))
        factor = math.clip(SAFETY / root, SLOWEST, math.where(self.error <= 1.0, FASTEST, 1.0))
        return math.where(self.error <= HUGE, factor, SLOWEST)  # not a number is no small error


def attempt(system: System, evaluate: Evaluate, point: Point, h: Scalar, tolerance: Tolerance) -> Trial:
    """Try one step of length h."""
    chart = Chart(system, point.state, evaluate)
    y = chart.start(point)
    K = stages(DOP853, chart, y, chart.rate(y, point.rates), h)
    end = y + h * (DOP853.b @ K)
    reached = chart.point(point.state.t + h, end)
    K = np.concatenate([K, chart.rate(end, reached.rates)[None]])
    scale = math.maximum(tolerance.scale(system, point.state), tolerance.scale(system, reached.state))
    checked = slice(0, scale.size)  # the work follows from the motion and needs no control of its own
    fifth, third = (np.sum((weights @ K[:, checked] / scale) ** 2) for weights in (DOP853_ERROR_5, DOP853_ERROR_3))
    size = math.maximum((fifth + 0.01 * third) * scale.size, TINY)
    return Trial(chart, y, h, K, reached, h * fifth / np.sqrt(size))


def first_step(system: System, evaluate: Evaluate, point: Point, tolerance: Tolerance) -> float:
    """Step to begin with, from sizes of the first and second derivative (Hairer et al., II.4, "Starting step size")."""
    chart = Chart(system, point.state, evaluate)
    y = chart.start(point)
    scale = tolerance.scale(system, point.state)
    checked = slice(0, scale.size)
    norm = lambda part: np.linalg.norm(part[checked] / scale) / np.sqrt(scale.size)  # noqa: E731
    slope = chart.rate(y, point.rates)
    size = np.linalg.norm(np.concatenate([sizes(system, point.state.q), point.state.v]) / scale) / np.sqrt(scale.size)
    d1 = norm(slope)
    h = 1e-6 if size < 1e-5 or d1 < 1e-5 else 0.01 * size / d1
    d2 = norm(chart(point.state.t + h, y + h * slope) - slope) / h
    largest = max(d1, d2)
    return min(100 * h, max(1e-6, h * 1e-3) if largest <= 1e-15 else (0.01 / largest) ** (1 / 8))


@dataclass(frozen=True)
class Dense:
    """Dense output of order 7 inside an accepted step."""

    chart: Chart
    start: np.ndarray
    h: Scalar
    F: np.ndarray

    @classmethod
    def of(cls, chart: Chart, y: np.ndarray, h: Scalar, K: np.ndarray) -> "Dense":
        """Dense output of a step from y with slopes K, at the cost of three more evaluations."""
        first, last = K[0], K[-1]
        K = np.concatenate([K, np.empty((len(DOP853_EXTRA_C), y.size), dtype=K.dtype)])
        for i, (a, c) in enumerate(zip(DOP853_EXTRA_A, DOP853_EXTRA_C, strict=True), start=DOP853.c.size + 1):
            K[i] = chart(chart.origin.t + c * h, y + h * (a[:i] @ K[:i]))
        moved = h * (DOP853.b @ K[: DOP853.c.size])
        F = np.concatenate([[moved, h * first - moved, 2 * moved - h * (first + last)], h * (DOP853_DENSE @ K)])
        return cls(chart, y, h, F)

    def __call__(self, t: Scalar):
        """State and work at a time within the step."""
        x = (t - self.chart.origin.t) / self.h
        y = np.zeros_like(self.start)
        for i, coefficient in enumerate(self.F[::-1]):
            y = (y + coefficient) * (x if i % 2 == 0 else 1.0 - x)
        y = y + self.start
        return self.chart.state(t, y), y[2 * self.chart.system.n_v :]
