"""Dormand–Prince 8(5,3) with step control and dense output of order 7, on the configuration manifold.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4 (step control), II.5, II.6.
"""

from dataclasses import dataclass

import numpy as np

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

SAFETY, SLOWEST, FASTEST = 0.9, 0.2, 10.0  # of the next step against this one
EXPONENT = -1.0 / 8.0


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

    rtol: float
    atol: float

    def scale(self, system: System, state) -> np.ndarray:
        """Allowed error (2 n_v,) of (θ, v)."""
        return self.atol + self.rtol * np.concatenate([sizes(system, state.q), np.abs(state.v)])


@dataclass(frozen=True)
class Trial:
    """A step that was tried: where it leads, its error (accepted if ≤ 1), and what dense output needs."""

    chart: Chart
    h: float
    start: np.ndarray
    end: np.ndarray
    K: np.ndarray
    point: Point
    error: float

    @property
    def accepted(self) -> bool:
        """Whether the estimated error is within the tolerance."""
        return self.error <= 1.0

    def next_step(self) -> float:
        """Step to try next."""
        if not np.isfinite(self.error):
            return SLOWEST * self.h
        factor = FASTEST if self.error == 0 else SAFETY * self.error**EXPONENT
        return self.h * float(np.clip(factor, SLOWEST, FASTEST if self.accepted else 1.0))


def attempt(system: System, evaluate: Evaluate, point: Point, h: float, tolerance: Tolerance) -> Trial:
    """Try one step of length h."""
    chart = Chart(system, point.state, evaluate)
    y = chart.start(point)
    K = stages(DOP853, chart, y, chart.rate(y, point.rates), h)
    end = y + h * (DOP853.b @ K)
    reached = chart.point(point.state.t + h, end)
    K = np.concatenate([K, chart.rate(end, reached.rates)[None]])
    scale = np.maximum(tolerance.scale(system, point.state), tolerance.scale(system, reached.state))
    checked = slice(0, scale.size)  # the work follows from the motion and needs no control of its own
    fifth = np.linalg.norm(DOP853_ERROR_5 @ K[:, checked] / scale) ** 2
    third = np.linalg.norm(DOP853_ERROR_3 @ K[:, checked] / scale) ** 2
    error = 0.0 if fifth == 0 else h * fifth / np.sqrt((fifth + 0.01 * third) * scale.size)
    return Trial(chart, h, y, end, K, reached, float(error))


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


class Dense:
    """Dense output of order 7 inside an accepted step; made at the cost of three more evaluations."""

    def __init__(self, trial: Trial):
        chart, h, y = trial.chart, trial.h, trial.start
        K = np.concatenate([trial.K, np.empty((len(DOP853_EXTRA_C), y.size))])
        for i, (a, c) in enumerate(zip(DOP853_EXTRA_A, DOP853_EXTRA_C, strict=True), start=len(trial.K)):
            K[i] = chart(chart.origin.t + c * h, y + h * (a[:i] @ K[:i]))
        moved = trial.end - y
        first, last = K[0], trial.K[-1]
        self.trial = trial
        self.F = np.concatenate([[moved, h * first - moved, 2 * moved - h * (first + last)], h * (DOP853_DENSE @ K)])

    def __call__(self, t: float):
        """State and work at a time within the step."""
        chart, h = self.trial.chart, self.trial.h
        x = (t - chart.origin.t) / h
        y = np.zeros_like(self.trial.start)
        for i, coefficient in enumerate(self.F[::-1]):
            y = (y + coefficient) * (x if i % 2 == 0 else 1.0 - x)
        y = y + self.trial.start
        return chart.state(t, y), y[2 * chart.system.n_v :]
