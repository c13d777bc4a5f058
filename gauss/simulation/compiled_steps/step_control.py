"""Verdict on a step of an explicit pair: its error, and the length of the next one."""

import numpy as np

from gauss import math
from gauss.codegen import Function, Scalar, write
from gauss.codegen.kernels import TRIAL_SETTINGS, CheckedSwitch
from gauss.dynamics.error_scale import NEAR_SINGULAR_ROUNDOFF
from gauss.dynamics.traced_system import Program, largest
from gauss.integrators import ExplicitPair, Tolerance, next_factor
from gauss.simulation.compiled_steps.singularity_avoidance import Nodes
from gauss.system import State

INSISTENCE, PATIENCE = np.log(8.0), 2.0  # each refusal puts eight times as much of an error down to rounding
TRIES = 3.0  # to move a step
QUIET, AUDIBLE = 100.0, 10.0  # times what rounding spoils: tolerances above take no notice, those below move a step
STARTING, FASTEST = 8.0, 2.5  # steps, after which one grows no faster: an estimate may be all but zero by chance


class StepControl:
    """Judge of steps of a system.

    Parameters
    ----------
    program : Program
        The system.
    method : ExplicitPair
        The method.
    fades : bool
        Whether its closing rows can fade.
    row : int
        Numbers of an estimate.
    shares : ndarray, optional
        Of the tolerance, see :class:`gauss.integrators.Tolerance`.
    """

    def __init__(self, program: Program, method: ExplicitPair, fades: bool, row: int, shares=None):
        self.program, self.system, self.layout, self.method = program, program.system, program.layout, method
        self.fades, self.row, self.shares = fades, row, shares
        self.own, self.T = program.pattern.scale.coordinates, program.pattern.scale.time
        self.nodes = Nodes(np.append(method.pair.c, 1.0), method.pair.extra_c)

    def function(self) -> Function | CheckedSwitch:
        """Function (point, *GIVEN, point after, what is left of the rows at each slope, estimates of the error) → verdict.

        A verdict is the error, the factor of the next step, evaluations and factorisations.
        """
        pair, size = self.method.pair, self.layout.size
        given = (size, *[1] * len(TRIAL_SETTINGS), size, len(pair.c) + 1, *[self.row] * len(pair.errors))
        plain = write(self._plain, *given, name="judge")
        return CheckedSwitch(plain, write(self._careful, *given, name="careful_judge"), QUIET) if self.fades else plain

    def _plain(self, x, h, rtol, atol, atol_rates, refused, last, smallest, reached, left, *estimates):
        """Verdict; and where rows can fade, how many times what rounding spoils is allowed."""
        tolerance, ends = self._tolerance(rtol, atol, atol_rates), self._ends(x, reached)
        error = self.method.error(self.system, ends, estimates, h[0], tolerance)
        if not self.fades:
            return [*self._seen(x, reached, error, self._factor(x, error), refused, smallest), self.method.evaluations, 0.0]
        spoilt, factor = h[0] * self.T * largest(self._noise(ends, left)), self._shifted(x, error, left)
        told = self._seen(x, reached, error, factor, refused, smallest)
        return [*told, self.method.evaluations, 0.0, self._allowed(ends, tolerance) / spoilt]

    def _careful(self, x, h, rtol, atol, atol_rates, refused, last, smallest, reached, left, *estimates):
        """Verdict near places where rows fade.

        What of the estimates is off the constraints is no error, for it will be undone. Nor is rounding, when nothing else
        helps; but at first a step is moved if such a place is near one of its stages.
        """
        tolerance, ends, n = self._tolerance(rtol, atol, atol_rates), self._ends(x, reached), self.system.n_v
        along = lambda change: self.program.along([ends[1].t], ends[1].q, change)  # noqa: E731
        estimates = [np.concatenate([along(change[:n]), along(change[n : 2 * n])]) for change in estimates]
        noise, share = self._noise(ends, left), np.exp(INSISTENCE * (refused[0] - PATIENCE))
        units = np.concatenate([self.own * self.T, self.own])
        rounding = [share * (np.abs(weights) @ noise) * units for weights in self.method.pair.errors]
        error = self.method.error(self.system, ends, estimates, h[0], tolerance, rounding)
        place = self.nodes.place(left)
        ends_late = last[0] * (place - self.nodes.middle) > 0.0  # the end of the run is where it is
        shift = math.where(ends_late, 1.0, self.nodes.shift(place))
        moves = math.where(shift < 1.0, math.where(refused[0] < TRIES, 1.0, 0.0), 0.0)
        moves = math.where(AUDIBLE * h[0] * self.T * largest(noise) > self._allowed(ends, tolerance), moves, 0.0)
        factor = math.where(moves > 0.0, shift, self._shifted(x, error, left))
        error, factor = self._seen(x, reached, math.where(moves > 0.0, np.inf, error), factor, refused, smallest)
        return [error, factor, self.method.evaluations, 0.0]

    def _seen(self, x, reached, error: Scalar, factor: Scalar, refused, smallest) -> tuple[Scalar, Scalar]:
        """Error and factor; a step that may have passed a switching surface of a law unseen is made again."""
        ends = self.layout.point(x), self.layout.point(reached)
        return self.program.watch.judged(ends, error, factor, refused[0], smallest[0])

    def _shifted(self, x, error: Scalar, left: np.ndarray) -> Scalar:
        """Length of the next step over that of this one; after an accepted one such that no stage is near fading rows."""
        factor = self._factor(x, error)
        return factor * math.where(error <= 1.0, self.nodes.shift(self.nodes.ahead(left) / factor), 1.0)

    def _factor(self, x, error: Scalar) -> Scalar:
        steps = self.layout.point(x).memory[-1]
        return math.minimum(next_factor(error, self.method.order), math.where(steps < STARTING, np.inf, FASTEST))

    def _tolerance(self, rtol, atol, atol_rates) -> Tolerance:
        return Tolerance(rtol[0], atol[0], atol_rates[0], self.shares)

    def _speed(self, ends: tuple[State, State]) -> Scalar:
        """Largest rate at the ends of a step, in coordinates of the scene [1/s]."""
        return math.maximum(*(largest(state.v * (1.0 / self.own)) for state in ends))

    def _noise(self, ends: tuple[State, State], left: np.ndarray) -> np.ndarray:
        """What rounding contributes to the accelerations of each stage, from what is left of the rows there [1/s²]."""
        return NEAR_SINGULAR_ROUNDOFF * self._speed(ends) ** 2 / left**3

    def _allowed(self, ends: tuple[State, State], tolerance: Tolerance) -> Scalar:
        """Error allowed on the largest rate, in units of the scene."""
        return tolerance.atol_rates + tolerance.rtol * self.T * self._speed(ends)

    def _ends(self, x, reached) -> tuple[State, State]:
        return self.layout.state(x), self.layout.state(reached)
