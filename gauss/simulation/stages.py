"""Explicit pairs as machine code: what a step calls, the sums over stages being loops of :mod:`gauss.kernels.explicit`.

Between the ends of a step, stages are a little off the constraints. That does no harm, except where rows of the constraints
fade, as in a parallelogram that is flat: there, accelerations depend on the gap over the square of what is left of a row. So
stages with a weak pivot are moved onto the constraints before they are evaluated, which leaves the motion on the
constraints the same.
"""

import numpy as np

from gauss.dynamics.program import Program, largest
from gauss.integrators import Chart, ExplicitPair, Rates, Tolerance, advance, next_factor
from gauss.kernels import GIVEN, Guarded, Interpolation, Trial, stride
from gauss.tracing import Scalar, write

WEAK = 0.003  # pivot of closing rows, 1 on free bodies, below which a stage is moved onto the constraints
ROUNDING = 5e-18  # m, rad; rows of weakness 1/s² make v² / s³ times as much of it in accelerations
INSISTENCE = np.log(8.0)  # each time that a step is refused, eight times as much of its error is put down to rounding
PATIENCE = 1.0  # times before all of the rounding counts: a step of another length may keep further off


class Stages:
    """Functions of an explicit pair over points x and rows of y = (θ, v, work) of one system.

    Beside slopes stands what rounding contributes to the accelerations.

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

    def functions(self) -> tuple[Trial, Interpolation]:
        """Trial step, and what dense output needs."""
        size, row, pair = self.layout.size, self.row, self.method.pair
        start = write(self._start, size, name="start")
        slope = write(self._slope, size, 1, row, name="slope")
        if self.program.settles:
            slope = Guarded(slope, write(self._closed_slope, size, 1, row, name="closed_slope"), WEAK)
        finish = write(self._finish, size, 1, row, name="finish")
        judge = write(self._judge, size, *[1] * len(GIVEN), size, *[row] * len(pair.errors), name="judge")
        trial = Trial(pair.A, pair.b, pair.c, pair.errors, size, row, self.n_y, start, slope, finish, judge)
        return trial, Interpolation(pair.extra_A, pair.extra_c, pair.polynomial, size, row, start, slope)

    def coefficients(self, rows) -> np.ndarray:
        """Coefficients of dense output without what fills their rows up."""
        return rows.reshape(-1, self.row)[:, : self.n_y]

    def _start(self, x):
        chart, point = self._chart(x), self.layout.point(x)
        y = chart.start(point)
        return self._row(y), self._row(chart.rate(y, point.rates))

    def _slope(self, x, t, y):
        chart, y = self._chart(x), y[: self.n_y]
        state, n = chart.state(t[0], y), self.system.n_v
        function = self.program.watched if self.program.settles else self.program.rates
        found = function([state.t], state.q, state.v)
        return self._row(chart.rate(y, Rates(found[:n], found[n : n + 3]))), found[n + 3 :]

    def _closed_slope(self, x, t, y):
        chart, y, n = self._chart(x), y[: self.n_y].copy(), self.system.n_v
        state, rates, (weakness, _) = self.program.on_constraints(chart.state(t[0], y))
        y[n : 2 * n] = state.v
        return self._row(chart.rate(y, rates), ROUNDING * largest(state.v) ** 2 * weakness * np.sqrt(weakness))

    def _finish(self, x, h, change):
        chart, point, change = self._chart(x), self.layout.point(x), change[: self.n_y]
        reached = advance(chart, point, h[0], change)
        return self.layout.pack(reached), self._row(chart.rate(chart.start(point) + change, reached.rates))

    def _judge(self, x, h, rtol, atol, atol_rates, refused, reached, *estimates):
        ends, noise = (self.layout.state(x), self.layout.state(reached)), None
        if self.program.settles:
            noise = [estimate[self.n_y] * np.exp(INSISTENCE * (refused[0] - PATIENCE)) for estimate in estimates]
        tolerance = Tolerance(rtol[0], atol[0], atol_rates[0], self.shares)
        error = self.method.error(self.system, ends, estimates, h[0], tolerance, noise)
        return [error, next_factor(error, self.method.order), self.method.evaluations, 0.0]

    def _chart(self, x) -> Chart:
        return Chart(self.program, self.layout.state(x))

    def _row(self, y: np.ndarray, noise: Scalar = 0.0) -> np.ndarray:
        return np.concatenate([y, [noise], np.zeros(self.row - y.size - 1)])
