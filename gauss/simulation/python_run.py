"""Step loop in Python: trial step, projection onto the constraints, check of the accelerations, samples."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np

from gauss.codegen.kernels import LAST_STEP_SHARE, Due
from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.laws.kink_error import kink_error, kink_factor
from gauss.dynamics.laws.switching import Switching, endless
from gauss.dynamics.laws.switching_functions import ONWARD, SHORT, onward
from gauss.errors import GaussError, SimulationError
from gauss.integrators import (
    SMALLEST_FACTOR,
    Controlled,
    FixedStep,
    Integrator,
    Point,
    Rates,
    Tolerance,
    TrialStep,
    crossed_time,
    first_step,
)
from gauss.simulation.grid import grid_of
from gauss.simulation.motion_records import Event, Stats
from gauss.simulation.prescribed import crossed
from gauss.simulation.progress import Progress
from gauss.simulation.step_limits import (
    CHATTERING_PROGRESS,
    LEAST_RESTART_STEP,
    PROGRESS_TRIALS,
    SLIDING_CROSSINGS,
    SMALLEST_STEP,
    lasting,
    smallest_step,
    too_small,
)
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.undetected_switching import (
    REJECTED_SHARE,
    RESOLVED_STEP,
    SHIFTS,
    SPARSE_STEP,
    Sample,
    defect_is_large,
    defect_times,
)
from gauss.system import State, System

SLIDING_PROGRESS = 1e-3  # relative to the duration, per PROGRESS_TRIALS, below which a sliding motion is refused


class PythonRun:
    """One motion, stepped in Python with the accelerations of an engine.

    ``step`` [s] is that of a fixed-step method, the largest one of an adaptive method. ``projects``: whether states are
    projected onto the constraints after each step.
    """

    def __init__(
        self,
        system: System,
        method: Integrator,
        solver: Engine,
        tolerance: Tolerance | None,
        step: float | None,
        end: float,
        projects: bool = True,
        switching: Switching = Switching(),  # noqa: B008 (frozen)
    ):
        self.system, self.method, self.solver = system, method, solver
        self.tolerance = cast(Tolerance, tolerance)  # unused by a fixed-step method
        self.step, self.end, self.projects, self.switching = step, end, projects, switching
        self.steps = self.rejected = self.factorisations = self.unseen = 0
        self.longest = self.crossings = 0.0
        self.events: list[Event] = []

    powers = 3  # quadratures: work of drives, work of forces on bodies, dissipation in dampers

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        return self.solver.rates(self.system, state)

    def project(self, state: State) -> State:
        """State after a step, projected onto the constraints."""
        return self.solver.project(self.system, state) if self.projects else state

    def steps_of(self, point: Point, samples) -> Iterator:
        """Accepted points, each with the dense output of its step: t → (state, work)."""
        if isinstance(self.method, FixedStep):
            return self.fixed(self.method, point, samples)
        return self.adaptive(cast(Controlled, self.method), point)

    def adaptive(self, method: Controlled, point: Point) -> Iterator:
        """Accepted points of adaptive steps and of switching times, with dense output."""
        duration = self.end - point.state.t
        h = lasting(self._first_step(method, point), smallest_step(duration, self.end))
        for before, after in self.switching.times.stops(point.state.t, self.end):
            for reached, following, dense in self._until(method, point, h, before, duration):
                point, h = reached, following
                yield point, dense
            if after > before:
                jumped = self._jumped(point, after)
                point = jumped or self.crossed_to(point, after)
                if jumped:
                    yield point, None
                h = max(self._first_step(method, point), LEAST_RESTART_STEP * duration)

    def _first_step(self, method: Controlled, point: Point) -> float:
        return cast(float, first_step(self, point, self.tolerance, method.order))

    def crossed_to(self, point: Point, t: float) -> Point:
        """Point just after a switching time, with the rates there."""
        return crossed_time(self, point, t)

    def _jumped(self, point: Point, after: float) -> Point | None:
        """Point after the impact of a jump of prescribed velocities; None without a jump."""
        found = crossed(self.switching.jumps, point.state, point.work, after)
        if found is None:
            return None
        self.events.append(found.event)
        return Point(found.state, found.work, self.evaluate(found.state))

    def _until(self, method: Controlled, point: Point, h: float, end: float, duration: float) -> Iterator:
        """Accepted points up to a switching time, each with the next step size and the dense output."""
        largest, smallest = duration if self.step is None else self.step, smallest_step(duration, self.end)
        trials, measured_from = 0, point.state.t
        while point.state.t < end:
            trials += 1
            if trials % PROGRESS_TRIALS == 0:
                self._refuse_chatter(point.state.t, (point.state.t - measured_from) / duration)
                measured_from = point.state.t
            h = min(h, largest)
            remaining = end - point.state.t
            tried = remaining if h >= remaining * LAST_STEP_SHARE else h
            if not tried >= smallest:  # or NaN
                laws = self.switching.conditional + self.switching.called
                error = SimulationError(too_small(point.state.t, self.tolerance.rtol, laws))
                point, h = self._handed_over(point, method, error)
                continue
            try:
                reached, h, kept = self._trial(method, point, tried, smallest, None if tried < remaining else end)
            except DistrustError:
                self.rejected += 1
                continue
            except SimulationError as error:
                self.rejected += 1  # the trial left the region where the equations can be solved
                h = tried * SMALLEST_FACTOR
                if h < smallest:
                    point, h = self._handed_over(point, method, error)
                continue
            if reached is None:
                self.rejected += 1
                continue
            self.steps += 1
            begin, point = point, reached
            yield point, h, self._dense(method, begin, tried, kept)

    def _refuse_chatter(self, t: float, progress: float):
        """Raise a SimulationError where laws allow almost no progress, relative to the duration."""
        least = SLIDING_PROGRESS if self.crossings > SLIDING_CROSSINGS * PROGRESS_TRIALS else CHATTERING_PROGRESS
        laws = self.switching.conditional + self.switching.called
        if laws and progress < least:
            raise SimulationError(endless(t, laws))
        self.crossings = 0.0

    def _trial(
        self, method: Controlled, point: Point, h: float, smallest: float, end: float | None
    ) -> tuple[Point | None, float, np.ndarray]:
        """End of a step, None where it is rejected; the next step [s]; slopes for dense output."""
        trial = method.attempt(self, point, h, self.tolerance, float(self.steps))
        if self.switching.called and h < SHORT * smallest:
            trial = replace(trial, error=0.0, factor=ONWARD)  # a step across a discontinuity has no order
        self.factorisations += int(trial.cost.factorisations)
        if not trial.accepted:
            return None, h * trial.factor, trial.kept
        share = self._resolved_share(method, point, trial, h, smallest)
        if share < 1.0:
            return None, h * share, trial.kept
        return self._projected(trial.point, end), h * trial.factor, trial.kept

    def _resolved_share(self, method: Controlled, begin: Point, trial: TrialStep, h: float, smallest: float) -> float:
        """Share of an accepted step that resolves switching functions and opaque laws; 1 if all of it does."""
        shortest = SHORT * smallest / h
        share, crossings, place = self.switching.share(begin, trial.point) if shortest < 1.0 else (1.0, 0.0, 1.0)
        self.crossings += crossings
        if share == 1.0 and place < 1.0:
            error = kink_error(begin, trial.point, self.tolerance)
            share = cast(float, kink_factor(error, place)) if error > 1.0 else 1.0
        if share < 1.0:
            return cast(float, onward(share, shortest))
        if not self.switching.called or h * SMALLEST_STEP <= RESOLVED_STEP * smallest:
            return 1.0
        allowed = self.tolerance.scale(self.system, trial.point.state)[self.system.n_v :]
        dense = self._dense(method, begin, h, trial.kept)
        return REJECTED_SHARE if defect_is_large(self._defect_samples(dense, begin.state.t, h), h, allowed) else 1.0

    def _defect_samples(self, dense: Callable, begin: float, h: float) -> Iterator[Sample]:
        """Dense output and accelerations at the places of a step at which its defect is sampled."""
        for times in defect_times(begin, h).reshape(-1, len(SHIFTS)).tolist():
            states = [dense(t)[0] for t in times]
            yield times, [state.v for state in states], self.evaluate(states[1]).acceleration

    def _handed_over(self, point: Point, method: Controlled, error: SimulationError) -> tuple[Point, float]:
        """Point and step from which the certified engine continues after a failure; the error if that engine failed.

        It solves some states that machine code does not, as with a singular joint inertia, or explains the failure.
        """
        if not self.solver.hand_over(point.state.t):
            raise error
        point = replace(point, rates=self.evaluate(point.state))
        return point, self._first_step(method, point)

    def _dense(self, method: Controlled, begin: Point, h: float, kept: np.ndarray) -> Callable:
        coefficients = cache(lambda: method.dense(self, begin, h, kept)[0])
        return lambda t: method.interpolate(self, begin, h, coefficients(), t)

    def fixed(self, method: FixedStep, point: Point, samples) -> Iterator:
        """Points of fixed steps; samples between them are the ends of separate shorter steps."""
        step = cast(float, self.step)
        self.unseen = self.switching.times.unresolved(point.state.t, self.end, step)
        stops = dict(stop for stop in self.switching.times.stops(point.state.t, self.end) if stop[0] < stop[1])
        after, passed = set(stops.values()), point.state.t
        for t, due in grid_of(method, point.state.t, self.end, step, samples, self.switching):
            if t <= passed:  # within the switching time of an impact
                continue
            if due != Due.OFF_GRID_SAMPLE:
                begin, point = point, self._advance(method, point, t)
                self.unseen += self.switching.share(begin, point)[0] < 1.0 or self._misses_peaks(begin, point)
                if t in after:
                    point = replace(point, rates=self.evaluate(point.state), method_state=None)
                self.steps += 1
                yield point, lambda t, begin=begin: self._off_grid(method, begin, t)
                jumped = self._jumped(point, stops[t]) if t in stops else None
                if jumped:
                    point, passed = jumped, stops[t]
                    yield point, None

    def _misses_peaks(self, begin: Point, end: Point) -> bool:
        """Whether a fixed step does not resolve a smooth peak of a law."""
        peaks = self.switching.peaks
        return peaks is not None and peaks.misses(lambda state: self.evaluate(state).acceleration, begin, end)

    def _off_grid(self, method: FixedStep, begin: Point, t: float) -> tuple[State, np.ndarray]:
        """State and work of an off-grid sample: a separate shorter step that the motion does not continue from."""
        reached = method.step(self, begin, t - begin.state.t)[0]
        return replace(reached.state, t=t), reached.work

    def _advance(self, method: FixedStep, point: Point, t: float) -> Point:
        """One fixed step, repeated if its accelerations fail the check."""
        for _ in range(2):
            found, cost = method.step(self, point, t - point.state.t)
            self.factorisations += int(cost.factorisations)
            try:
                return self._projected(found, t)
            except DistrustError:
                self.rejected += 1
        return self._projected(found, t)

    def _projected(self, point: Point, t: float | None) -> Point:
        """Checked point of a step after projection, at exactly time t [s] where that is given."""
        state = point.state if t is None else replace(point.state, t=t)
        point = replace(point, state=state)
        projected = self.project(state)
        if projected is not state:
            point = Point(projected, point.work, self.evaluate(projected))
        self.solver.check(point, last=state.t >= self.end)
        return point

    def collect(self, start: State, samples, progress: bool) -> Trajectory:
        """Trajectory to the end, at the samples or at every step."""
        began = time.perf_counter()
        kept: list[tuple[State, np.ndarray]] = [(start, np.zeros(self.powers))]
        waiting = None if samples is None else [t for t in samples if t > start.t]
        bar = Progress(self.end - start.t, progress)
        try:
            first = self._first(start)
            reached = start.t
            for point, inside in self.steps_of(first, samples):
                bar.update(point.state.t - start.t)
                reached, self.longest = point.state.t, max(self.longest, point.state.t - reached)
                if waiting is None:
                    kept.append((point.state, point.work))
                else:
                    due = [t for t in waiting if t <= point.state.t]
                    waiting = waiting[len(due) :]
                    kept.extend(self._samples(due, point, inside))
        except GaussError as error:
            raise SimulationError(str(error), self._trajectory(kept, samples, began)) from error
        except KeyboardInterrupt as error:  # stays a KeyboardInterrupt: no handler of errors may swallow it
            error.trajectory = self._trajectory(kept, samples, began)  # type: ignore[attr-defined]  # documented
            raise
        finally:
            bar.close()
        return self._trajectory(kept, samples, began)

    def _first(self, start: State) -> Point:
        """Initial point; its accelerations are computed again if they fail the check."""
        for _ in range(2):
            first = Point(start, np.zeros(self.powers), self.evaluate(start))
            try:
                self.solver.check(first)
                break
            except DistrustError:
                self.rejected += 1
        return first

    def _samples(self, due, point: Point, inside: Callable):
        """Samples within a step and at its end."""
        for t in due:
            if t == point.state.t:
                yield point.state, point.work
            else:
                state, work = inside(t)
                yield self.project(state), work

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        whole = self.end - kept[0][0].t
        if samples is not None and not (samples.size and samples[0] == kept[0][0].t):
            kept = kept[1:]
        states = [state for state, _ in kept]
        stats = Stats(
            self.solver.evaluations,
            self.steps,
            self.rejected,
            self.factorisations,
            time.perf_counter() - began,
            self.solver.error,
            self.solver.name,
            self.solver.rescued,
            unseen=self.unseen,
            opaque=", ".join(self.switching.called) if self.longest > SPARSE_STEP * whole else "",
            handed_over=self.solver.handed_over,
        )
        return Trajectory(
            self.system,
            np.array([state.t for state in states]),
            np.array([state.q for state in states]).reshape(len(states), self.system.n_q),
            np.array([state.v for state in states]).reshape(len(states), self.system.n_v),
            np.array([work for _, work in kept]).reshape(len(states), self.powers),
            stats,
            tuple(self.events),
        )
