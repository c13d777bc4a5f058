"""Steps of explicit pairs as machine code; the sums over stages are loops of :mod:`gauss.codegen.kernels.explicit`.

Between the ends of a step, stages are a little off the constraints. That does no harm, except where rows of the constraints
fade, as in a parallelogram that is flat: there, accelerations depend on the gap over the square of what is left of a row. So
stages with a weak pivot are moved onto the constraints before they are evaluated, which leaves the motion on the
constraints the same.

Constraints that are redundant on the constraint manifold only, as those of an overconstrained spatial loop, are independent
off it and contradict each other by the residual. Systems with such constraints have all their stages projected.
"""

from dataclasses import replace

import numpy as np

from gauss import math
from gauss.codegen import Scalar, write
from gauss.codegen.kernels import CheckedSwitch, ExplicitTrial, Interpolation, stride
from gauss.dynamics.traced_system import Program
from gauss.integrators import Chart, ExplicitPair, Rates, advance, lost
from gauss.simulation.compiled_steps.step_control import StepControl
from gauss.system import State, System

WEAK = 0.003  # pivot of closing rows, 1 on free bodies, below which a stage is moved onto the constraints


def memory(system: System) -> int:
    """Numbers that a point carries: what rounding took from sums, what is left of closing rows, and steps made so far."""
    return lost(system) + 2


class Stages:
    """Functions of an explicit pair over points x and rows of y = (θ, v, work) of one system.

    Beside slopes stands what is left of the closing rows there, 1 or so where they bind as on free bodies.

    Parameters
    ----------
    program : Program
        The system.
    method : ExplicitPair
        The method.
    many : bool
        Whether they are for many motions side by side.
    shares : ndarray, optional
        Of the tolerance, see :class:`gauss.integrators.Tolerance`.
    """

    def __init__(self, program: Program, method: ExplicitPair, many: bool = False, shares=None):
        self.program, self.system, self.layout, self.method = program, program.system, program.layout, method
        self.n_y, self.shares = self.layout.n_y, shares
        self.row = self.n_y + 1 if many else stride(self.n_y + 1)
        self.fades = program.may_lose_rank

    def functions(self) -> tuple[ExplicitTrial, Interpolation]:
        """Trial step, and what dense output needs."""
        size, row, pair = self.layout.size, self.row, self.method.pair
        start = write(self._start, size, name="start")
        slope = self._slope_function(size, row)
        finish = write(self._finish, size, 1, row, name="finish")
        judge = StepControl(self.program, self.method, self.fades, row, self.shares).function()
        trial = ExplicitTrial(pair.A, pair.b, pair.c, pair.errors, size, row, self.n_y, start, slope, finish, judge)
        return trial, Interpolation(pair.extra_A, pair.extra_c, pair.polynomial, size, row, start, slope)

    def _slope_function(self, size: int, row: int):
        if self.program.has_redundant_rows:
            return write(self._closed_slope, size, 1, row, name="closed_slope")
        slope = write(self._slope, size, 1, row, name="slope")
        return (
            CheckedSwitch(slope, write(self._closed_slope, size, 1, row, name="closed_slope"), WEAK) if self.fades else slope
        )

    def coefficients(self, rows) -> np.ndarray:
        """Coefficients of dense output without what fills their rows up."""
        return rows.reshape(-1, self.row)[:, : self.n_y]

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        return self._watched(state)[0]

    def _watched(self, state: State) -> tuple[Rates, np.ndarray]:
        """Rates of a state, and (weakest pivot, weakness) of the closing rows."""
        if not self.fades:
            return self.program.evaluate(state), np.ones(2)
        n, found = self.system.n_v, self.program.monitored_rates([state.t], state.q, state.v)
        return Rates(found[:n], found[n : n + 3]), found[n + 3 :]

    def _start(self, x):
        chart, point = self._chart(x), self.layout.point(x)
        y, left = chart.start(point), point.memory[-2]
        return self._row(y), self._row(chart.rate(y, point.rates), math.where(left > 0.0, left, 1.0))

    def _slope(self, x, t, y):
        chart, y = self._chart(x), y[: self.n_y]
        rates, (weakest, weakness) = self._watched(chart.state(t[0], y))
        return self._row(chart.rate(y, rates), 1.0 / np.sqrt(weakness)), [weakest] if self.fades else []

    def _closed_slope(self, x, t, y):
        chart, y, n = self._chart(x), y[: self.n_y].copy(), self.system.n_v
        state, rates, (weakness, _) = self.program.on_constraints(chart.state(t[0], y))
        y[n : 2 * n] = state.v
        return self._row(chart.rate(y, rates), 1.0 / np.sqrt(weakness))

    def _finish(self, x, h, change):
        chart, point, change = self._chart(x), self.layout.point(x), change[: self.n_y]
        reached = advance(chart, replace(point, memory=point.memory[:-2]), h[0], change)
        left = 1.0 / np.sqrt(self._watched(reached.state)[1][1])
        reached = replace(reached, memory=np.concatenate([reached.memory, [left, point.memory[-1] + 1.0]]))
        return self.layout.pack(reached), self._row(chart.rate(chart.start(point) + change, reached.rates), left)

    def _chart(self, x) -> Chart:
        return Chart(self, self.layout.state(x))

    def _row(self, y: np.ndarray, left: Scalar = 1.0) -> np.ndarray:
        return np.concatenate([y, [left], np.zeros(self.row - y.size - 1)])
