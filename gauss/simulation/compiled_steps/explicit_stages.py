"""Steps of explicit pairs as machine code; the sums over stages are loops of :mod:`gauss.codegen.kernels.explicit`.

Stages within a step have a small constraint residual, which is harmless but near configurations with rank-deficient
constraint Jacobian, as a flat parallelogram: there, accelerations are off by the residual over the square of the smallest
pivot. Stages with a small pivot are therefore projected onto the constraints before they are evaluated; motions on the
constraints are the same.

Constraints that are redundant on the constraint manifold only, as those of an overconstrained spatial loop, are independent
off it and contradict each other by the residual. Systems with such constraints have all their stages projected.
"""

from functools import cache

import numpy as np

from gauss import math
from gauss.codegen import INTEGER, Function, NativeFunction, write
from gauss.codegen.kernels import CheckedSwitch, ExplicitTrial, Interpolation, RowCode, RowFunction, stride
from gauss.dynamics.traced_system import Program
from gauss.integrators import ExplicitPair, first_length, trial_length
from gauss.simulation.compiled_steps.chart_code import ChartCode
from gauss.simulation.compiled_steps.projected_stages import SMALL_PIVOT
from gauss.simulation.compiled_steps.step_control import StepControl


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
        self.program, self.layout, self.method, self.shares = program, program.layout, method, shares
        self.n_q, self.n_v, self.n_y = self.layout.n_q, self.layout.n_v, self.layout.n_y
        self.row = self.n_y + 1 if batch else stride(self.n_y + 1)
        self.chart = ChartCode(program, shares)
        self.near_singular = program.may_lose_rank
        self.sigma = self.layout.size - len(self.layout.parameters) - 2  # its place in a point; then the number of steps

    def functions(self) -> tuple[ExplicitTrial, Interpolation]:
        """Trial step, and dense output."""
        size, row, pair = self.layout.size, self.row, self.method.pair
        start, slope = RowFunction("begin", size, 2 * row, self._start), self._slope_function(size, row)
        finish = RowFunction("finish", size + 1 + row, size + row, self._finish)
        control = StepControl(self.program, self.method, self.near_singular, row, self.chart).function()
        trial = ExplicitTrial(pair.A, pair.b, pair.c, pair.errors, size, row, self.n_y, start, slope, finish, control)
        return trial, Interpolation(pair.extra_A, pair.extra_c, pair.polynomial, size, row, start, slope)

    def sample(self) -> RowFunction:
        """Function (point, h, coefficients of dense output, t) → state and work at t."""
        coefficients = len(self.method.pair.polynomial) * self.row
        return RowFunction("sample", self.layout.size + 1 + coefficients + 1, self.layout.row, self._sample)

    def projection(self) -> RowFunction | None:
        """Function of a point → (projected point, position residual); None where nothing is projected."""
        size = self.layout.size
        return RowFunction("project", size, size + 1, self._project) if self.program.projects else None

    def first(self, check: Function | NativeFunction) -> RowFunction:
        """Function (t, q, v, rtol, atol, atol_rates, parameters) → (point, its check, first step)."""
        layout, emit = self.layout, lambda code: self._first(code, check)
        return RowFunction("start", layout.row + len(layout.parameters), layout.size + len(check.outputs) + 1, emit)

    def _slope_function(self, size: int, row: int):
        """Function (point, t, y) → y', with projection where a pivot of the constraints is small."""
        projected = RowFunction("projected_slope", size + 1 + row, row, self._projected_slope)
        if self.program.has_redundant_rows:
            return projected
        slope = RowFunction("slope", size + 1 + row, row + int(self.near_singular), self._slope)
        return CheckedSwitch(slope, projected, SMALL_PIVOT) if self.near_singular else slope

    def _rates(self, code: RowCode, state, x, found):
        """Write the rates of a state; returns its least pivot and σ, 1 if they are not monitored."""
        if not self.near_singular:
            self.chart.evaluate(code, self.program.rates, state, x, found)
            return [code.motions.constant(1.0)] * 2
        monitored = code.room(len(self.program.monitored_rates.outputs))
        self.chart.evaluate(code, self.program.monitored_rates, state, x, monitored)
        code.copy(found, monitored, self.n_v + 3)
        smallest, weakness = (code.number(monitored, self.n_v + 3 + k) for k in range(2))
        return smallest, *code.inline(_sigma(), weakness)

    def _start(self, code: RowCode):
        (n_q, n_v), (x, y) = (self.n_q, self.n_v), (code.given, code.found)
        for k in code.each(n_v):
            code.put(y, k, code.motions.constant(0.0))
        code.copy(code.at(y, n_v), code.at(x, 1 + n_q), n_v + 3)
        slope = code.at(y, self.row)
        code.copy(slope, code.at(x, 1 + n_q), n_v)
        code.copy(code.at(slope, n_v), code.at(x, self.layout.row), n_v + 3)
        self._end_row(code, y, code.motions.constant(1.0))
        self._end_row(code, slope, *code.inline(_known_sigma(), code.number(x, self.sigma)))

    def _first(self, code: RowCode, check: Function | NativeFunction):
        """Initial point, its check and the first step, by the formulas of :func:`gauss.integrators.first_step`."""
        layout, (n_q, n_v), b, x, size = self.layout, (self.n_q, self.n_v), code.b, code.found, self.layout.size
        code.copy(x, code.given, 1 + n_q + n_v)
        for k in code.each(size - layout.row + 3):
            code.put(x, b.add(k, INTEGER(layout.row - 3)), code.motions.constant(0.0))
        code.copy(code.at(x, self.sigma + 2), code.at(code.given, layout.row), len(layout.parameters))
        rates, v, state = code.at(x, layout.row), code.at(x, 1 + n_q), self.chart.state_room(code)
        code.copy(state, code.given, 1 + n_q + n_v)
        found = code.room(len(self.program.rates.outputs))
        self.chart.evaluate(code, self.program.rates, state, x, found)
        code.copy(rates, found, n_v + 3)
        code.call(check, x, code.at(x, size))
        sizes, slope, y, change = (code.room(2 * n_v) for _ in range(4))
        self.chart.sizes(code, x, sizes)
        allowed = self.chart.tolerances(code, code.at(code.given, layout.row - 3), [sizes])
        code.copy(slope, v, n_v)
        code.copy(code.at(slope, n_v), rates, n_v)
        squares = [code.sum_of_squares(2 * n_v, part, allowed) for part in (sizes, slope)]
        system, order = self.program.pattern, self.method.order
        (h,) = code.inline(write(lambda one, two: [trial_length(system, one[0], two[0])], 1, 1), *squares)
        for k in code.each(n_v):
            code.put(y, k, b.fmul(h, code.number(slope, k)))
            i = b.add(k, INTEGER(n_v))
            code.put(y, i, code.motions.fused("fma", h, code.number(slope, i), code.number(v, k)))
        later = code.room(len(self.program.rates.outputs))
        self.chart.state(code, x, b.fadd(code.number(x, 0), h), y, state)
        self.chart.evaluate(code, self.program.rates, state, x, later)
        self.chart.rate(code, y, code.at(y, n_v), change)
        code.copy(code.at(change, n_v), later, n_v)
        for k in code.each(2 * n_v):
            code.put(change, k, b.fsub(code.number(change, k), code.number(slope, k)))
        squared = code.sum_of_squares(2 * n_v, change, allowed)
        length = write(lambda h, one, two: [first_length(system, order, h[0], one[0], two[0])], 1, 1, 1)
        code.put(x, size + len(check.outputs), *code.inline(length, h, squares[1], squared))

    def _end_row(self, code: RowCode, row, sigma):
        """Write σ behind y or y', and the padding."""
        for k in range(self.n_y, self.row):
            code.put(row, k, sigma if k == self.n_y else code.motions.constant(0.0))

    def _slope(self, code: RowCode):
        x, y, found, state = code.given, code.at(code.given, self.layout.size + 1), code.found, self.chart.state_room(code)
        v = code.at(y, self.n_v)
        code.put(state, 0, code.number(x, self.layout.size))
        self.chart.retract_at_rate(code, code.at(x, 1), y, v, code.at(state, 1), found)
        code.copy(code.at(state, 1 + self.n_q), v, self.n_v)
        smallest, sigma = self._rates(code, state, x, code.at(found, self.n_v))
        self._end_row(code, found, sigma)
        if self.near_singular:
            code.put(found, self.row, smallest)

    def _projected_slope(self, code: RowCode):
        x, y, found, state = code.given, code.at(code.given, self.layout.size + 1), code.found, self.chart.state_room(code)
        self.chart.state(code, x, code.number(x, self.layout.size), y, state)
        projected = self._projected(code, state, x)
        v, rates = code.at(projected, self.n_q), code.at(projected, self.n_q + self.n_v)
        self.chart.rate(code, y, v, found)
        code.copy(code.at(found, self.n_v), rates, self.n_v + 3)
        self._end_row(code, found, *code.inline(_sigma(), code.number(rates, self.n_v + 3)))

    def _project(self, code: RowCode):
        layout, (n_q, n_v), x, found = self.layout, (self.n_q, self.n_v), code.given, code.found
        state = self.chart.state_room(code)
        code.copy(state, x, 1 + n_q + n_v)
        projected = self._projected(code, state, x)
        code.copy(found, x, layout.size)
        code.copy(code.at(found, 1), projected, n_q + n_v)
        code.copy(code.at(found, layout.row), code.at(projected, n_q + n_v), n_v + 3)
        code.put(found, layout.size, code.number(projected, n_q + 2 * n_v + 4))

    def _projected(self, code: RowCode, state, x):
        """Array of a state on the constraints, its rates, the singularity and the residual."""
        projected = code.room(len(self.program.projected_rates.outputs))
        self.chart.evaluate(code, self.program.projected_rates, state, x, projected)
        return projected

    def _finish(self, code: RowCode):
        """Point after a change of y, by compensated sums as :func:`gauss.integrators.step.advance`, and y' there."""
        layout, (n_q, n_v, n_y), b, x, found = self.layout, (self.n_q, self.n_v, self.n_y), code.b, code.given, code.found
        h, change, lost = code.number(x, layout.size), code.at(x, layout.size + 1), layout.row + n_v + 3
        y, slope, moving = code.room(n_y), code.at(found, layout.size), 1 + n_q  # place of (v, work)
        for k in code.each(n_y):
            code.put(y, k, b.fadd(code.number(change, k), code.number(x, b.add(k, INTEGER(lost)))))
        kept, due = code.room(n_v), b.fadd(h, code.number(x, lost + n_y))
        code.put(found, 0, b.fadd(code.number(x, 0), due))
        self.chart.retract(code, code.at(x, 1), y, code.at(found, 1))
        self.chart.follow(code, found)
        rate = code.room(n_v)  # that to which the step without compensation leads
        for k in code.each(n_v + 3):
            place = b.add(k, INTEGER(moving))
            code.put(found, place, b.fadd(code.number(x, place), code.number(y, b.add(k, INTEGER(n_v)))))
        for k in code.each(n_v):
            now = code.number(x, b.add(k, INTEGER(moving)))
            code.put(rate, k, b.fadd(now, code.number(change, b.add(k, INTEGER(n_v)))))
        state = self.chart.state_room(code)
        code.copy(state, found, 1 + n_q + n_v)
        _, sigma = self._rates(code, state, x, code.at(found, layout.row))
        self.chart.rate(code, change, rate, slope)
        code.copy(code.at(slope, n_v), code.at(found, layout.row), n_v + 3)
        self._end_row(code, slope, sigma)
        self.chart.displacement(code, code.at(x, 1), code.at(found, 1), y, kept)
        for k in code.each(n_v):
            code.put(found, b.add(k, INTEGER(lost)), b.fsub(code.number(y, k), code.number(kept, k)))
        for k in code.each(n_v + 3):
            i, place = b.add(k, INTEGER(n_v)), b.add(k, INTEGER(moving))
            moved = b.fsub(code.number(found, place), code.number(x, place))
            code.put(found, b.add(i, INTEGER(lost)), b.fsub(code.number(y, i), moved))
        code.put(found, lost + n_y, b.fsub(due, b.fsub(code.number(found, 0), code.number(x, 0))))
        code.put(found, self.sigma, sigma)
        code.put(found, self.sigma + 1, b.fadd(code.number(x, self.sigma + 1), code.motions.constant(1.0)))
        code.copy(code.at(found, self.sigma + 2), code.at(x, self.sigma + 2), len(layout.parameters))

    def _sample(self, code: RowCode):
        layout, (n_q, n_v), b, x = self.layout, (self.n_q, self.n_v), code.b, code.given
        coefficients, count = code.at(x, layout.size + 1), len(self.method.pair.polynomial)
        t = code.number(x, layout.size + 1 + count * self.row)
        relative = b.fdiv(b.fsub(t, code.number(x, 0)), code.number(x, layout.size))
        y, polynomial = code.room(self.n_y), _polynomial(self.method)
        for i in code.each(self.n_y):
            given = [code.number(coefficients, b.add(i, INTEGER(k * self.row))) for k in range(count)]
            code.put(y, i, *code.inline(polynomial, *given, relative))
        for k in code.each(n_v + 3):
            i = b.add(k, INTEGER(n_v))
            code.put(y, i, b.fadd(code.number(y, i), code.number(x, b.add(k, INTEGER(1 + n_q)))))
        state, found = self.chart.state_room(code), code.found
        self.chart.state(code, x, t, y, state)
        code.copy(found, state, 1 + n_q + n_v)
        self.chart.follow(code, found)
        if self.program.projects:
            code.copy(code.at(found, 1), self._projected(code, state, x), n_q + n_v)
        code.copy(code.at(found, 1 + n_q + n_v), code.at(y, 2 * n_v), 3)


@cache
def _sigma() -> Function:
    return write(lambda weakness: 1.0 / np.sqrt(weakness), 1, name="sigma")


@cache
def _known_sigma() -> Function:
    return write(lambda sigma: [math.where(sigma[0] > 0.0, sigma[0], 1.0)], 1, name="known_sigma")


def _polynomial(method: ExplicitPair) -> Function:
    """Function (coefficients of dense output of one entry of y, relative time) → its change."""
    count = len(method.pair.polynomial)
    return write(lambda given, x: method.change(given.reshape(count, 1), x[0]), count, 1, name="polynomial")
