"""Step-size control of explicit pairs near singular configurations, as machine code.

The rule is :func:`gauss.integrators.control.next_factor`. Where the constraint Jacobian is near rank-deficient, rounding
of the accelerations is allowed for, and steps are placed so that no stage lies near that configuration
(:mod:`gauss.simulation.compiled_steps.singularity_avoidance`).
"""

import numpy as np

from gauss import math
from gauss.codegen import Function, Scalar, write
from gauss.codegen.kernels import TRIAL_RESULTS, TRIAL_SETTINGS, CheckedSwitch, RowCode, RowFunction
from gauss.dynamics.error_scale import NEAR_SINGULAR_ROUNDOFF
from gauss.dynamics.traced_system import Program, largest
from gauss.integrators import ExplicitPair, Tolerance, method_state_of, next_factor
from gauss.simulation.compiled_steps.chart_code import ChartCode
from gauss.simulation.compiled_steps.singularity_avoidance import StageNodes
from gauss.system import State

LOG_NOISE_GROWTH = np.log(8.0)  # each rejection multiplies the rounding that is allowed for by eight
REJECTIONS_BEFORE_NOISE = 2.0  # rejections after which the whole estimate of rounding is allowed for
MOST_MOVES = 3.0  # rejections up to which a step is moved away from a singular configuration
NEGLIGIBLE_NOISE = 100.0  # tolerance over the error by rounding, above which rounding is neglected
MOVING_NOISE = 10.0  # tolerance over the error by rounding, below which a step is moved


class StepControl:
    """Step-size controller of an explicit pair for one system.

    Parameters
    ----------
    program : Program
        The system.
    method : ExplicitPair
        The method.
    near_singular : bool
        Whether the constraint Jacobian can become rank-deficient.
    row : int
        Size of an error estimate.
    chart : ChartCode
        Chart of the system, with the factors of the tolerance.
    """

    def __init__(self, program: Program, method: ExplicitPair, near_singular: bool, row: int, chart: ChartCode):
        self.program, self.system, self.layout, self.method = program, program.system, program.layout, method
        self.near_singular, self.row, self.chart, self.shares = near_singular, row, chart, chart.shares
        self.own, self.T = program.pattern.scale.coordinates, program.pattern.scale.time
        self.nodes = StageNodes(np.append(method.pair.c, 1.0), method.pair.extra_c)

    def function(self) -> RowFunction | CheckedSwitch:
        """Function (point, *GIVEN, end of the step, σ at each slope, error estimates) → verdict.

        A verdict is the error over the tolerance, the step-size factor, evaluations and factorisations.
        """
        pair, size = self.method.pair, self.layout.size
        given = (size, *[1] * len(TRIAL_SETTINGS), size, len(pair.c) + 1, *[self.row] * len(pair.errors))
        regular = RowFunction("step_control", sum(given), TRIAL_RESULTS + int(self.near_singular), self._regular)
        if not self.near_singular:
            return regular
        return CheckedSwitch(regular, write(self._singular, *given, name="singular_step_control"), NEGLIGIBLE_NOISE)

    def _regular(self, code: RowCode):
        """Verdict; where the Jacobian can become rank-deficient, also the tolerance over the error by rounding."""
        size, count, pair = self.layout.size, 2 * self.system.n_v, self.method.pair
        reached = size + len(TRIAL_SETTINGS)
        estimates = reached + size + len(pair.c) + 1
        ends = [code.at(code.given, place) for place in (0, reached)]
        sizes = [code.room(count) for _ in ends]
        for end, target in zip(ends, sizes, strict=True):
            self.chart.sizes(code, end, target)
        allowed = self.chart.tolerances(code, code.at(code.given, size + TRIAL_SETTINGS.index("rtol")), sizes)
        found = code.room(estimates + len(pair.errors) + 1)
        code.copy(found, code.given, estimates)
        for k in range(len(pair.errors)):
            estimate = code.at(code.given, estimates + k * self.row)
            code.put(found, estimates + k, code.sum_of_squares(count, estimate, allowed))
        code.put(found, estimates + len(pair.errors), self._fastest(code, ends))
        code.call(self._verdict(len(pair.c) + 1, len(pair.errors)), found, code.found)

    def _fastest(self, code: RowCode, ends: list):
        """Largest rate at the ends of a step, in units of the scene [1/s]."""
        zero, rates = code.motions.constant(0.0), [code.at(end, 1 + self.layout.n_q) for end in ends]
        if not self.near_singular:
            return zero
        larger = write(lambda most, unit, v: [math.maximum(most[0], largest(v * unit))], 1, 1, 2, name="larger")

        def following(k, most):
            unit = code.motions.broadcast(code.constant("inverse_rate_units", 1.0 / self.own, k))
            return code.inline(larger, most, unit, *(code.number(v, k) for v in rates))[0]

        return code.reduced(self.system.n_v, zero, following)

    def _verdict(self, slopes: int, estimates: int) -> Function:
        """Function of the inputs but the estimates, sums of squares of the latter, and the largest rate → verdict."""
        size = self.layout.size

        def verdict(x, h, rtol, atol, atol_rates, refused, last, smallest, reached, sigma, squares, speed):
            tolerance = self._tolerance(rtol, atol, atol_rates)
            error = self.method.error_of_squares(list(squares), 2 * self.system.n_v, h[0])
            if not self.near_singular:
                found = self._seen(x, reached, error, self._factor(x, error), refused, smallest, tolerance)
                return [*found, self.method.evaluations, 0.0]
            spoilt = h[0] * self.T * largest(self._noise(speed[0], sigma))
            found = self._seen(x, reached, error, self._shifted(x, error, sigma), refused, smallest, tolerance)
            return [*found, self.method.evaluations, 0.0, self._allowed(speed[0], tolerance) / spoilt]

        sizes = size, *[1] * len(TRIAL_SETTINGS), size, slopes, estimates, 1
        return write(verdict, *sizes, name="verdict")

    def _singular(self, x, h, rtol, atol, atol_rates, refused, last, smallest, reached, sigma, *estimates):
        """Verdict near a singular configuration.

        Only the part of the estimates along the constraints counts, for the projection removes the rest. A step one of whose
        stages lies near the configuration is first moved; after repeated rejections rounding is allowed for.
        """
        tolerance, ends, n = self._tolerance(rtol, atol, atol_rates), self._ends(x, reached), self.system.n_v
        speed = self._speed(ends)
        along = lambda change: self.program.along([ends[1].t], ends[1].q, change)  # noqa: E731
        projected = [np.concatenate([along(change[:n]), along(change[n : 2 * n])]) for change in estimates]
        noise, share = self._noise(speed, sigma), np.exp(LOG_NOISE_GROWTH * (refused[0] - REJECTIONS_BEFORE_NOISE))
        units = np.concatenate([self.own * self.T, self.own])
        rounding = [share * (np.abs(weights) @ noise) * units for weights in self.method.pair.errors]
        error = self.method.error(self.system, ends, projected, h[0], tolerance, rounding)
        place = self.nodes.place(sigma)
        ends_late = last[0] * (place - self.nodes.middle) > 0.0  # the end of the run cannot be moved
        shift = math.where(ends_late, 1.0, self.nodes.shift(place))
        moves = math.where(shift < 1.0, math.where(refused[0] < MOST_MOVES, 1.0, 0.0), 0.0)
        moves = math.where(MOVING_NOISE * h[0] * self.T * largest(noise) > self._allowed(speed, tolerance), moves, 0.0)
        factor = math.where(moves > 0.0, shift, self._shifted(x, error, sigma))
        error = math.where(moves > 0.0, np.inf, error)
        error, factor = self._seen(x, reached, error, factor, refused, smallest, tolerance)
        return [error, factor, self.method.evaluations, 0.0]

    def _seen(
        self, x, reached, error: Scalar, factor: Scalar, refused, smallest, tolerance: Tolerance
    ) -> tuple[Scalar, Scalar]:
        """Error and factor; a step that may have passed a switching surface of a law undetected is rejected."""
        ends = self.layout.point(x), self.layout.point(reached)
        return self.program.watch.judged(ends, error, factor, refused[0], smallest[0], tolerance)

    def _shifted(self, x, error: Scalar, sigma: np.ndarray) -> Scalar:
        """Step-size factor; after an accepted step such that no stage of the next lies near a singular configuration."""
        factor = self._factor(x, error)
        return factor * math.where(error <= 1.0, self.nodes.shift(self.nodes.ahead(sigma) / factor), 1.0)

    def _factor(self, x, error: Scalar) -> Scalar:
        return next_factor(error, self.method.order, method_state_of(self.layout.point(x))[-1])

    def _tolerance(self, rtol, atol, atol_rates) -> Tolerance:
        return Tolerance(rtol[0], atol[0], atol_rates[0], self.shares)

    def _speed(self, ends: tuple[State, State]) -> Scalar:
        """Largest rate at the ends of a step, in units of the scene [1/s]."""
        return math.maximum(*(largest(state.v * (1.0 / self.own)) for state in ends))

    def _noise(self, speed: Scalar, sigma: np.ndarray) -> np.ndarray:
        """Rounding error ε v² / σ³ of the accelerations of each stage, from the largest rate, and σ there [1/s²]."""
        return NEAR_SINGULAR_ROUNDOFF * speed**2 / sigma**3

    def _allowed(self, speed: Scalar, tolerance: Tolerance) -> Scalar:
        """Tolerance of the largest rate, in units of the scene."""
        return tolerance.atol_rates + tolerance.rtol * self.T * speed

    def _ends(self, x, reached) -> tuple[State, State]:
        return self.layout.state(x), self.layout.state(reached)
