"""Motions by a compiled loop that calls opaque laws: the forces of these laws are asked of Python at every evaluation.

Between evaluations nothing is known of an opaque law. Adaptive steps are therefore tried one at a time, and the defect of
their dense output is sampled as in :mod:`gauss.simulation.python_run`: a large one shows that a law switches in the step.
"""

import ctypes
from collections.abc import Callable, Hashable
from dataclasses import replace

import numpy as np

from gauss.codegen.kernels import LAST_STEP_SHARE, Control, Loop, LoopStatus
from gauss.codegen.tiers import EntryPoint
from gauss.dynamics.laws.switching_functions import ONWARD, SHORT
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.load_receiver import LoadReceiver
from gauss.errors import GaussError, SimulationError
from gauss.integrators import Rates
from gauss.simulation.compiled_adaptive_run import CompiledAdaptiveRun
from gauss.simulation.compiled_fixed_run import CompiledFixedRun
from gauss.simulation.compiled_run import CompiledRun
from gauss.simulation.problem import Problem
from gauss.simulation.step_limits import PROGRESS_TRIALS, SMALLEST_STEP
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.undetected_switching import (
    REJECTED_SHARE,
    RESOLVED_STEP,
    SHIFTS,
    SPARSE_STEP,
    defect_is_large,
    defect_times,
)
from gauss.system import State

UNLIMITED = 1e150  # tolerances of a step that is accepted whatever its error
OWN = "samples", "sample", "rows", "rtol", "atol", "atol_rates"  # settings of a single step that are not those of the motion
NEVER = np.array([np.inf])  # samples of a step that has none [s]


class CalledRun(CompiledRun):
    """One motion in machine code that calls opaque laws; the dynamics of its plan give the functions of the system."""

    def __init__(self, problem: Problem, dynamics: str = "callbacks"):
        super().__init__(problem, dynamics)
        self._receive()

    def _receive(self):
        """Make the object that machine code calls."""
        called = self.problem.laws.called
        self.key = (*self.key, tuple(bound.load.name for bound in called))  # a law traced before has other machine code
        self.receiver, self.longest = LoadReceiver(LoadForces(self.system, called)), 0.0

    def evaluated(self, state: State) -> Rates:
        """Rates by machine code."""
        with self.receiver:
            return super().evaluated(state)

    def _loop_of(self, kind: Hashable, make) -> Loop:
        self.loop = super()._loop_of(kind, make).calling
        return self.loop

    def _called(self, run: Callable[[], None]):
        """Run until the end, or a status of :data:`gauss.simulation.compiled_run.UNTRUSTED`.

        SimulationError if a law raises, returns no finite numbers, or chatters; its ``trajectory`` holds the motion so far.
        """
        try:
            with self.receiver:
                run()
        except SimulationError:
            raise
        except GaussError as error:
            raise SimulationError(str(error), self.trajectory()) from error

    def trajectory(self) -> Trajectory:
        """Motion so far, up to a law that raised."""
        if not self.rows and (self.samples is None or self.samples[:1] == self.start.t):
            self.rows = [np.concatenate([[self.start.t], self.start.q, self.start.v, np.zeros(3)])[None]]
        self.rows = [rows[np.isfinite(rows).all(axis=1)] for rows in self.rows]
        found, names = super().trajectory(), ", ".join(self.problem.laws.reasons)
        sparse = self.longest > SPARSE_STEP * (self.end - self.start.t)
        method = f"{found.stats.method}; called in every evaluation, which costs time: {names}"
        opaque = ", ".join(self.switching.called) if sparse else ""
        return replace(found, stats=found.stats._replace(method=method, opaque=opaque))


class CalledFixedRun(CalledRun, CompiledFixedRun):
    """One motion by a fixed-step method in machine code that calls opaque laws."""

    def arrays(self, point: np.ndarray, confirmed: np.ndarray, grid: np.ndarray, out: np.ndarray) -> tuple:
        """Arguments of the steps, before their number; the first two are kept for a law that raises."""
        self.reached = point, confirmed
        return super().arrays(point, confirmed, grid, out)

    def prepared_steps(self) -> "CalledSteps":
        """Machine code of the steps, within which it calls the laws."""
        return CalledSteps(self, super().prepared_steps())

    def run(self):
        """Run until the end."""
        self.longest = self.step
        self._called(super().run)


class CalledSteps:
    """Steps of a run in machine code, whose ``arrays`` they change; a law that raises leaves the state as it was before."""

    def __init__(self, run: CalledFixedRun, entry: EntryPoint):
        self.run, self.entry = run, entry

    def call(self, *given):
        """Make steps; SimulationError if a law raises, or returns no finite numbers."""
        control, before = self.run.control, [array.copy() for array in self.run.reached]
        record = bytes(control)
        try:
            with self.run.receiver:
                self.entry.call(*given)
        except BaseException as error:
            for array, old in zip(self.run.reached, before, strict=True):
                array[:] = old
            ctypes.memmove(ctypes.byref(control), record, len(record))
            if isinstance(error, GaussError) and not isinstance(error, SimulationError):
                raise SimulationError(str(error)) from error
            raise


class CalledAdaptiveRun(CalledRun, CompiledAdaptiveRun):
    """One motion by an adaptive method in machine code that calls opaque laws."""

    def run(self):
        """Run until the end."""
        self._called(super().run)

    @property
    def switching_laws(self) -> tuple[str, ...]:
        """Names of the loads that steps are shortened for."""
        return self.switching.conditional + self.switching.called

    def _steps(self, grid: np.ndarray, out: np.ndarray):
        if not self.switching.called:  # opaque laws of time, whose jumps are known
            super()._steps(grid, out)
            return
        trials = 0
        self.control.status = LoopStatus.PAUSED
        while self.control.status == LoopStatus.PAUSED and trials < min(PROGRESS_TRIALS, self.budget):
            self._try(grid, out)
            trials += 1

    def _try(self, grid: np.ndarray, out: np.ndarray):
        """Try one step; it is rejected where its defect is large."""
        control, t = self.control, float(self.point[0])
        h, remaining = min(control.h, control.largest), control.end - t
        tried = remaining if h >= remaining * LAST_STEP_SHARE else h
        across = control.smallest <= tried < SHORT * control.smallest  # a step across a discontinuity has no order
        looks = not across and tried * SMALLEST_STEP > RESOLVED_STEP * control.smallest
        later = grid[int(control.sample) :] if control.samples else grid[:0]
        due = later[: np.searchsorted(later, t + tried, side="right")]
        before = bytes(control), self.point.copy(), self.confirmed.copy()
        times = np.concatenate([due, defect_times(t, tried)]) if looks else due
        rows = self._attempted(times, across)
        if rows is None:
            return
        if looks and self._is_unresolved(tried, times[due.size :], rows[due.size :]):
            self._reject(*before, tried)
            return
        if across:
            control.h = tried * ONWARD
        self.longest = max(self.longest, tried)
        passed = rows[: np.searchsorted(due, self.point[0], side="right")]
        control.sample += len(passed)
        passed = passed if control.samples else self._row()
        out[int(control.rows) : int(control.rows) + len(passed)] = passed
        control.rows += len(passed)

    def _attempted(self, times: np.ndarray, across: bool) -> np.ndarray | None:
        """Rows of an accepted step at some times, in any order; None if it is rejected."""
        control, kept, order = self.control, Control.from_buffer_copy(self.control), np.argsort(times, kind="stable")
        grid = times[order] if times.size else NEVER  # without samples the loop would write the end of the step
        rows, ordered = np.empty((times.size, self.layout.row)), np.empty((grid.size, self.layout.row))
        control.samples, control.sample, control.rows = grid.size, 0.0, 0.0
        if across:
            control.rtol, control.atol, control.atol_rates = UNLIMITED, UNLIMITED, UNLIMITED
        try:
            self.loop(control, self.point, self.confirmed, grid, ordered, 1)
        finally:
            for name in OWN:
                setattr(control, name, getattr(kept, name))
        rows[order] = ordered[: times.size]
        return rows if control.steps > kept.steps else None

    def _is_unresolved(self, h: float, times: np.ndarray, rows: np.ndarray) -> bool:
        """Whether the defect of the dense output shows that a law switches within a step."""
        n_q, n_v = 1 + self.layout.n_q, self.layout.n_v
        reached = State(float(self.point[0]), self.point[1:n_q], self.point[n_q : n_q + n_v])
        allowed = self.problem.tolerance.scale(self.system, reached)[n_v:]
        count = len(SHIFTS)
        self.control.evaluations += len(rows) // count
        asked, places = rows[:, : n_q + n_v], range(0, len(rows), count)
        rates, listed = asked[:, n_q:], times.tolist()
        samples = ((listed[k : k + count], rates[k : k + count], self._accelerations(asked[k + count // 2])) for k in places)
        return defect_is_large(samples, h, allowed)

    def _accelerations(self, numbers: np.ndarray) -> np.ndarray:
        """Accelerations (n_v,) of a time, coordinates and rates (n,), by machine code."""
        return self.loop.evaluate("rates", np.concatenate([numbers, self.inputs]))[: self.layout.n_v]

    def _reject(self, control: bytes, point: np.ndarray, confirmed: np.ndarray, h: float):
        """Return to the begin of a step, of which a share is tried next."""
        evaluations, rejected = self.control.evaluations, self.control.rejected
        ctypes.memmove(ctypes.byref(self.control), control, len(control))
        self.control.evaluations, self.control.rejected = evaluations, rejected + 1.0
        self.control.h, self.control.status = REJECTED_SHARE * h, LoopStatus.PAUSED
        self.point[:], self.confirmed[:] = point, confirmed
