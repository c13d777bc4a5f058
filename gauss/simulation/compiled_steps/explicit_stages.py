"""Steps of explicit pairs as machine code; the sums over stages are loops of :mod:`gauss.codegen.kernels.explicit`.

Stages within a step have a small constraint residual, which is harmless but near configurations with rank-deficient
constraint
Jacobian, as a flat parallelogram: there, accelerations are off by the residual over the square of the smallest pivot. Stages
with a small pivot are therefore projected onto the constraints before they are evaluated; motions on the constraints are the
same.

Constraints that are redundant on the constraint manifold only, as those of an overconstrained spatial loop, are independent
off it and contradict each other by the residual. Systems with such constraints have all their stages projected.
"""

from dataclasses import replace

import numpy as np

from gauss import math
from gauss.codegen import Scalar, write
from gauss.codegen.kernels import CheckedSwitch, ExplicitTrial, Interpolation, stride
from gauss.dynamics.traced_system import Program
from gauss.integrators import Chart, ExplicitPair, Rates, advance, compensation_size, method_state_of
from gauss.simulation.compiled_steps.projected_stages import SMALL_PIVOT
from gauss.simulation.compiled_steps.step_control import StepControl
from gauss.system import State, System


def method_state_size(system: System) -> int:
    """Size of the method state: compensation of y and t, σ of the constraint Jacobian, number of steps so far."""
    return compensation_size(system) + 2


class ExplicitStages:
    """Functions of an explicit pair over points x and rows of y = (θ, v, work) of one system.

    Each slope is followed by the smallest singular value σ of the constraint Jacobian there, about 1 as on free bodies.

    Parameters
    ----------
    program : Program
        The system.
    method : ExplicitPair
        The method.
    batch : bool
        Whether they are for a batch of motions.
    shares : ndarray, optional
        Factors of the tolerance, see :class:`gauss.integrators.Tolerance`.
    """

    def __init__(self, program: Program, method: ExplicitPair, batch: bool = False, shares=None):
        self.program, self.system, self.layout, self.method = program, program.system, program.layout, method
        self.n_y, self.shares = self.layout.n_y, shares
        self.row = self.n_y + 1 if batch else stride(self.n_y + 1)
        self.near_singular = program.may_lose_rank

    def functions(self) -> tuple[ExplicitTrial, Interpolation]:
        """Trial step, and dense output."""
        size, row, pair = self.layout.size, self.row, self.method.pair
        start = write(self._start, size, name="start")
        slope = self._slope_function(size, row)
        finish = write(self._finish, size, 1, row, name="finish")
        control = StepControl(self.program, self.method, self.near_singular, row, self.shares).function()
        trial = ExplicitTrial(pair.A, pair.b, pair.c, pair.errors, size, row, self.n_y, start, slope, finish, control)
        return trial, Interpolation(pair.extra_A, pair.extra_c, pair.polynomial, size, row, start, slope)

    def _slope_function(self, size: int, row: int):
        projected = lambda: write(self._projected_slope, size, 1, row, name="projected_slope")  # noqa: E731
        if self.program.has_redundant_rows:
            return projected()
        slope = write(self._slope, size, 1, row, name="slope")
        return CheckedSwitch(slope, projected(), SMALL_PIVOT) if self.near_singular else slope

    def coefficients(self, rows) -> np.ndarray:
        """Coefficients of dense output without padding."""
        return rows.reshape(-1, self.row)[:, : self.n_y]

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        return self._with_pivots(state)[0]

    def _with_pivots(self, state: State) -> tuple[Rates, np.ndarray]:
        """Rates of a state, and the smallest pivot p of the constraints and Σ 1/p ≈ σ⁻²."""
        if not self.near_singular:
            return self.program.evaluate(state), np.ones(2)
        return self.program.split_rates(self.program.monitored_rates([state.t], state.q, state.v))

    def _start(self, x):
        chart, point = self._chart(x), self.layout.point(x)
        y, sigma = chart.start(point), method_state_of(point)[-2]
        return self._row(y), self._row(chart.rate(y, point.rates), math.where(sigma > 0.0, sigma, 1.0))

    def _slope(self, x, t, y):
        chart, y = self._chart(x), y[: self.n_y]
        rates, (smallest, weakness) = self._with_pivots(chart.state(t[0], y))
        return self._row(chart.rate(y, rates), 1.0 / np.sqrt(weakness)), [smallest] if self.near_singular else []

    def _projected_slope(self, x, t, y):
        chart, y, n = self._chart(x), y[: self.n_y].copy(), self.system.n_v
        state, rates, (weakness, _) = self.program.on_constraints(chart.state(t[0], y))
        y[n : 2 * n] = state.v
        return self._row(chart.rate(y, rates), 1.0 / np.sqrt(weakness))

    def _finish(self, x, h, change):
        chart, point, change = self._chart(x), self.layout.point(x), change[: self.n_y]
        *compensation, _, steps = method_state_of(point)
        reached = advance(chart, replace(point, method_state=np.array(compensation)), h[0], change)
        sigma = 1.0 / np.sqrt(self._with_pivots(reached.state)[1][1])
        method_state = np.concatenate([method_state_of(reached), [sigma, steps + 1.0]])
        packed = self.layout.pack(replace(reached, method_state=method_state))
        return packed, self._row(chart.rate(chart.start(point) + change, reached.rates), sigma)

    def _chart(self, x) -> Chart:
        return Chart(self, self.layout.state(x))

    def _row(self, y: np.ndarray, sigma: Scalar = 1.0) -> np.ndarray:
        return np.concatenate([y, [sigma], np.zeros(self.row - y.size - 1)])
