"""Step-size control of explicit pairs near singular configurations, as machine code.

The rule is :func:`gauss.integrators.control.next_factor`. Where the constraint Jacobian is near rank-deficient, rounding
of the accelerations is allowed for, and steps are placed so that no stage lies near that configuration
(:mod:`gauss.simulation.compiled_steps.singularity_avoidance`).
"""

import numpy as np

from gauss import math
from gauss.codegen import Function, Scalar, write
from gauss.codegen.kernels import TRIAL_SETTINGS, CheckedSwitch
from gauss.dynamics.error_scale import NEAR_SINGULAR_ROUNDOFF
from gauss.dynamics.traced_system import Program, largest
from gauss.integrators import ExplicitPair, Tolerance, method_state_of, next_factor
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
    shares : ndarray, optional
        Factors of the tolerance, see :class:`gauss.integrators.Tolerance`.
    """

    def __init__(self, program: Program, method: ExplicitPair, near_singular: bool, row: int, shares=None):
        self.program, self.system, self.layout, self.method = program, program.system, program.layout, method
        self.near_singular, self.row, self.shares = near_singular, row, shares
        self.own, self.T = program.pattern.scale.coordinates, program.pattern.scale.time
        self.nodes = StageNodes(np.append(method.pair.c, 1.0), method.pair.extra_c)

    def function(self) -> Function | CheckedSwitch:
        """Function (point, *GIVEN, end of the step, σ at each slope, error estimates) → verdict.

        A verdict is the error over the tolerance, the step-size factor, evaluations and factorisations.
        """
        pair, size = self.method.pair, self.layout.size
        given = (size, *[1] * len(TRIAL_SETTINGS), size, len(pair.c) + 1, *[self.row] * len(pair.errors))
        regular = write(self._regular, *given, name="step_control")
        if not self.near_singular:
            return regular
        return CheckedSwitch(regular, write(self._singular, *given, name="singular_step_control"), NEGLIGIBLE_NOISE)

    def _regular(self, x, h, rtol, atol, atol_rates, refused, last, smallest, reached, sigma, *estimates):
        """Verdict; where the Jacobian can become rank-deficient, also the tolerance over the error by rounding."""
        tolerance, ends = self._tolerance(rtol, atol, atol_rates), self._ends(x, reached)
        error = self.method.error(self.system, ends, estimates, h[0], tolerance)
        if not self.near_singular:
            return [*self._seen(x, reached, error, self._factor(x, error), refused, smallest), self.method.evaluations, 0.0]
        spoilt, factor = h[0] * self.T * largest(self._noise(ends, sigma)), self._shifted(x, error, sigma)
        verdict = self._seen(x, reached, error, factor, refused, smallest)
        return [*verdict, self.method.evaluations, 0.0, self._allowed(ends, tolerance) / spoilt]

    def _singular(self, x, h, rtol, atol, atol_rates, refused, last, smallest, reached, sigma, *estimates):
        """Verdict near a singular configuration.

        Only the part of the estimates along the constraints counts, for the projection removes the rest. A step one of whose
        stages lies near the configuration is first moved; after repeated rejections rounding is allowed for.
        """
        tolerance, ends, n = self._tolerance(rtol, atol, atol_rates), self._ends(x, reached), self.system.n_v
        along = lambda change: self.program.along([ends[1].t], ends[1].q, change)  # noqa: E731
        estimates = [np.concatenate([along(change[:n]), along(change[n : 2 * n])]) for change in estimates]
        noise, share = self._noise(ends, sigma), np.exp(LOG_NOISE_GROWTH * (refused[0] - REJECTIONS_BEFORE_NOISE))
        units = np.concatenate([self.own * self.T, self.own])
        rounding = [share * (np.abs(weights) @ noise) * units for weights in self.method.pair.errors]
        error = self.method.error(self.system, ends, estimates, h[0], tolerance, rounding)
        place = self.nodes.place(sigma)
        ends_late = last[0] * (place - self.nodes.middle) > 0.0  # the end of the run cannot be moved
        shift = math.where(ends_late, 1.0, self.nodes.shift(place))
        moves = math.where(shift < 1.0, math.where(refused[0] < MOST_MOVES, 1.0, 0.0), 0.0)
        moves = math.where(MOVING_NOISE * h[0] * self.T * largest(noise) > self._allowed(ends, tolerance), moves, 0.0)
        factor = math.where(moves > 0.0, shift, self._shifted(x, error, sigma))
        error, factor = self._seen(x, reached, math.where(moves > 0.0, np.inf, error), factor, refused, smallest)
        return [error, factor, self.method.evaluations, 0.0]

    def _seen(self, x, reached, error: Scalar, factor: Scalar, refused, smallest) -> tuple[Scalar, Scalar]:
        """Error and factor; a step that may have passed a switching surface of a law undetected is rejected."""
        ends = self.layout.point(x), self.layout.point(reached)
        return self.program.watch.judged(ends, error, factor, refused[0], smallest[0])

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

    def _noise(self, ends: tuple[State, State], sigma: np.ndarray) -> np.ndarray:
        """Rounding error ε v² / σ³ of the accelerations of each stage, from σ there [1/s²]."""
        return NEAR_SINGULAR_ROUNDOFF * self._speed(ends) ** 2 / sigma**3

    def _allowed(self, ends: tuple[State, State], tolerance: Tolerance) -> Scalar:
        """Tolerance of the largest rate, in units of the scene."""
        return tolerance.atol_rates + tolerance.rtol * self.T * self._speed(ends)

    def _ends(self, x, reached) -> tuple[State, State]:
        return self.layout.state(x), self.layout.state(reached)
