"""A motion by a compiled loop of adaptive steps, which end at the switching times of the laws."""

import ctypes
from collections.abc import Iterator
from operator import is_
from types import SimpleNamespace
from typing import cast

import numpy as np

from gauss.codegen.kernels import Loop, LoopStatus, address
from gauss.dynamics.laws.switching import endless
from gauss.dynamics.laws.switching_times import APART, NO_TIMES, Timetable
from gauss.dynamics.point_layout import PointLayout
from gauss.errors import SimulationError
from gauss.integrators import Controlled, Taylor, Tolerance, crossed_time
from gauss.simulation.compiled_run import HELD_SAMPLES, CompiledRun
from gauss.simulation.compiled_steps.loop_functions import single
from gauss.simulation.step_limits import (
    CHATTERING_PROGRESS,
    LEAST_RESTART_STEP,
    PROGRESS_TRIALS,
    SLIDING_CROSSINGS,
    lasting,
)

SLIDING_PROGRESS = 1e-5  # relative to the duration, per PROGRESS_TRIALS, below which a sliding motion is refused
SLIDING_STEPS = 64  # over which crossings of switching surfaces are counted


class FirstSteps:
    """Machine code of the packed point of a state, its check, and its first step, on arrays of its own.

    Parameters
    ----------
    loop : Loop
        Machine code of the steps.
    layout : PointLayout
        Places in a point.
    tolerance : Tolerance
        Local error of the steps.
    """

    def __init__(self, loop: Loop, layout: PointLayout, tolerance: Tolerance):
        self.loop, (taken, returned) = loop, loop.arities["start"]
        self.given, self.found = np.empty(taken), np.empty(returned)
        q_end, v_end = 1 + layout.n_q, 1 + layout.n_q + layout.n_v
        self.q, self.v, self.inputs = self.given[1:q_end], self.given[q_end:v_end], self.given[v_end + 3 :]
        self.given[v_end : v_end + 3] = tolerance.rtol, tolerance.atol, tolerance.atol_rates
        self.addresses = address(self.given), address(self.found)

    def __call__(self, t: float, q: np.ndarray, v: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs, which the next call overwrites."""
        self.given[0], self.q[:], self.v[:], self.inputs[:] = t, q, v, inputs
        self.loop.function("start").call(*self.addresses)
        return self.found


class CompiledAdaptiveRun(CompiledRun):
    """One motion by an adaptive method in machine code."""

    _start: FirstSteps | None = None
    _bound: tuple = (None,) * 4  # arrays whose addresses are known
    _addresses: tuple = ()

    def prepared(self) -> Loop:
        """Machine code of the steps; the control record has the settings of the method."""
        control, tolerance = self.control, self.problem.tolerance
        method = cast("Controlled | Taylor", self.problem.method)
        loop = self._loop_of((self.method_key, tolerance.key), lambda: single(self.program, method, tolerance.shares))
        control.every = self.common.every
        control.rtol, control.atol, control.atol_rates = tolerance.rtol, tolerance.atol, tolerance.atol_rates
        control.largest = control.largest if self.problem.step is None else self.problem.step
        control.order = method.order_for(tolerance) if isinstance(method, Taylor) else self.common.order
        return loop

    def run(self):
        """Run until the end, or a status of :data:`gauss.simulation.compiled_run.UNTRUSTED`.

        Raises
        ------
        SimulationError
            If a law chatters; its ``trajectory`` holds the motion so far.
        """
        self.prepared()
        control, size = self.control, self.layout.size
        if self.held is not None:
            self.inputs = self.held.at(0, self.start.t, self.start.q.copy(), self.start.v.copy())
        begun = self._started(self.start.t, self.start.q, self.start.v)
        control.h = lasting(float(begun[-1]), control.smallest)
        self._begin(begun[:size], begun[size:-1])
        grid = np.zeros(1) if self.samples is None else self.samples[self.samples > self.start.t]
        control.samples = 0.0 if self.samples is None else grid.size
        out = np.empty((grid.size if control.samples else 2 * self.budget, self.layout.row))
        stops = self._stops()
        control.end, self.after = next(stops)
        self.trials, self.measured_from, self.next_sample = 0.0, self.start.t, 1

        def advance():
            begun = control.steps
            for _ in range(HELD_SAMPLES if self.held is not None and not self.switching_laws else 1):
                if self.point[0] >= control.end:
                    if self.after > control.end:
                        self._cross(self.after)
                    if self.held is not None:
                        self._renew()
                    control.end, self.after = next(stops)
                self._steps(grid, out)
                self._refuse_chatter(grid, out)
                if control.status != LoopStatus.DONE or control.end >= self.end:
                    return
                control.status = LoopStatus.PAUSED
                if max(control.rows, control.steps - begun) > self.budget:
                    return

        self._drive(advance, out)

    def _stops(self) -> Iterator[tuple[float, float]]:
        """Ends of steps at switching times and samples of a control law, each with the start of the next step."""
        times = self.switching.times
        if self.held is not None:
            times = times.join(Timetable(NO_TIMES.switches, self.held.times[1:]))
        return iter([(self.end,) * 2] if times is NO_TIMES else times.stops(self.start.t, self.end))

    def _steps(self, grid: np.ndarray, out: np.ndarray):
        """Make the steps of one budget."""
        arrays = self.point, self.confirmed, grid, out
        if not all(map(is_, arrays, self._bound)):
            self._bound, self._addresses = arrays, tuple(map(address, arrays))
        self.loop.entry.call(ctypes.byref(self.control), *self._addresses, self.budget)

    @property
    def switching_laws(self) -> tuple[str, ...]:
        """Names of the loads that steps are shortened for."""
        return self.switching.conditional

    def _refuse_chatter(self, grid: np.ndarray, out: np.ndarray):
        """Raise a SimulationError where conditions of laws on the state allow almost no progress."""
        control, t = self.control, self.point[0]
        trials = control.steps + control.rejected - self.trials
        if not self.switching_laws or trials < PROGRESS_TRIALS:
            return
        if control.status == LoopStatus.PAUSED:
            progress = (t - self.measured_from) / (self.end - self.start.t) * PROGRESS_TRIALS / trials
            if progress < CHATTERING_PROGRESS or (progress < SLIDING_PROGRESS and self._slides(grid, out)):
                raise SimulationError(endless(self.measured_from, self.switching_laws), self.trajectory())
        self.trials, self.measured_from = control.steps + control.rejected, t

    def _slides(self, grid: np.ndarray, out: np.ndarray) -> bool:
        """Whether the next steps cross switching surfaces again and again."""
        control, crossings = self.control, 0.0
        for _ in range(SLIDING_STEPS if self.switching.conditional else 0):
            self._gather(out)
            begin = self.layout.point(self.point.copy())
            self.loop(control, self.point, self.confirmed, grid, out, 1)
            if control.status != LoopStatus.PAUSED:
                return False
            crossings += self.switching.share(begin, self.layout.point(self.point))[1]
        return crossings > SLIDING_CROSSINGS * SLIDING_STEPS

    def _started(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Packed point of a state, its check, and its first step, by machine code; overwritten by the next call."""
        if self._start is None:
            self._start = FirstSteps(self.loop, self.layout, self.problem.tolerance)
        return self._start(t, q, v, self.inputs)

    def _renew(self):
        """Set the inputs of a sample of the control law that begins at the present point, and the rates under them."""
        k = self.next_sample
        assert self.held is not None  # asked for motions with held inputs only
        if k == len(self.held.times) or self.held.times[k] - self.point[0] > 4.0 * APART * abs(self.end):
            return
        self._hold(k)
        self.next_sample += 1
        layout, point = self.layout, self.point
        begin, end = 1 + layout.n_q, layout.row + layout.n_v + 3
        begun = self._started(float(point[0]), point[1:begin], point[begin : begin + layout.n_v])
        point[layout.row : end] = begun[layout.row : end]  # the rates
        self.control.h = max(float(begun[-1]), self.control.h)

    def _cross(self, t: float):
        """Continue just after a switching time, with the rates there."""
        if self._jumped(t) and self.samples is None:
            self.rows.append(self._row())
        equations = SimpleNamespace(system=self.system, evaluate=self.evaluated)
        point = crossed_time(equations, self.layout.point(self.point), t)
        self.point, state = self._pack(point), point.state
        self.control.h = max(float(self._started(t, state.q, state.v)[-1]), LEAST_RESTART_STEP * (self.end - self.start.t))
