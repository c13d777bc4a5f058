"""A simulation while it runs: steps are tried, settled on the constraints, confirmed, and sampled."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gauss.errors import GaussError, SimulationError
from gauss.integrators import SLOWEST, Dense, Point, Tolerance, Trial, attempt, first_step
from gauss.simulation.consistent import project
from gauss.simulation.progress import Progress
from gauss.simulation.solver import Solver
from gauss.simulation.traced import DistrustError, Traced
from gauss.simulation.trajectory import Stats, Trajectory
from gauss.system import State, System

SMALLEST_STEP = 1e-13  # relative to the duration: below it time no longer advances reliably


class Run:
    """One simulation while it runs.

    Parameters
    ----------
    system : System
        What moves.
    solver : Solver or Traced
        Where its accelerations come from.
    tolerance : Tolerance
        Of an adaptive method.
    step : float or None
        Step of a fixed-step method, largest step of an adaptive one [s].
    end : float
        When to stop [s].
    """

    def __init__(self, system: System, solver: Solver | Traced, tolerance: Tolerance, step, end: float):
        self.system, self.solver, self.tolerance, self.step, self.end = system, solver, tolerance, step, end
        self.steps = self.rejected = 0

    powers = 3  # integrated beside the motion: of drives, of forces on bodies, lost in dampers

    def evaluate(self, state: State):
        """Rates of a state."""
        return self.solver.rates(self.system, state)

    def settle(self, state: State) -> State:
        """State after a step, brought back to everything that must hold."""
        return project(self.system, state)

    def adaptive(self, point: Point) -> Iterator:
        """Accepted steps: (point reached, the trial that led there)."""
        duration = self.end - point.state.t
        largest = duration if self.step is None else self.step
        h = first_step(self.system, self.evaluate, point, self.tolerance)
        while point.state.t < self.end:
            h = min(h, largest)
            remaining = self.end - point.state.t
            trial_h = remaining if h >= remaining * (1 - 1e-12) else h
            if trial_h < SMALLEST_STEP * duration:
                raise SimulationError(too_small(point.state.t, self.tolerance.rtol))
            try:
                trial = attempt(self.system, self.evaluate, point, trial_h, self.tolerance)
                reached = self._settled(trial.point, None if trial_h < remaining else self.end) if trial.accepted else None
            except DistrustError:
                self.rejected += 1
                continue
            except SimulationError:
                if trial_h * SLOWEST < SMALLEST_STEP * duration:
                    raise
                self.rejected += 1  # a step that leads where nothing can be solved is too long
                h = trial_h * SLOWEST
                continue
            h = trial_h * trial.factor
            if reached is None:
                self.rejected += 1
                continue
            point = reached
            yield point, trial

    def fixed(self, method, point: Point, samples) -> Iterator:
        """Steps of fixed length, cut short where a sample or the end is due."""
        begin, due = point.state.t, [t for t in ([] if samples is None else samples) if t > point.state.t] + [self.end]
        count = 0
        while point.state.t < self.end:
            count += 1
            grid = begin + count * self.step
            while due and due[0] <= grid * (1 + 1e-15):
                target = due.pop(0)
                if target > point.state.t:
                    point = self._advance(method, point, target)
                    yield point, None
            if grid < self.end and grid > point.state.t:
                point = self._advance(method, point, grid)
                yield point, None

    def _advance(self, method, point: Point, t: float) -> Point:
        """One fixed step; made again when its accelerations turn out not to be trusted."""
        h = t - point.state.t
        try:
            return self._settled(method(self.system, self.evaluate, point, h), t)
        except DistrustError:
            self.rejected += 1
            return self._settled(method(self.system, self.evaluate, point, h), t)

    def _settled(self, point: Point, t: float | None) -> Point:
        """Point reached by a step, on the constraints again, at exactly the time that was meant."""
        state = point.state if t is None else replace(point.state, t=t)
        point = replace(point, state=state)
        settled = self.settle(state)
        if settled is not state:
            point = Point(settled, point.work, self.evaluate(settled))
        self.solver.confirm(point, last=state.t >= self.end)
        self.steps += 1
        return point

    def collect(self, method, start: State, samples, progress: bool) -> Trajectory:
        """Run to the end and gather the samples."""
        began = time.perf_counter()
        kept: list[tuple[State, np.ndarray]] = [(start, np.zeros(self.powers))]
        waiting = None if samples is None else [t for t in samples if t > start.t]
        bar = Progress(self.end - start.t, progress)
        try:
            first = Point(start, np.zeros(self.powers), self.evaluate(start))
            for point, trial in method(first):
                bar.update(point.state.t - start.t)
                if waiting is None:
                    kept.append((point.state, point.work))
                else:
                    due = [t for t in waiting if t <= point.state.t]
                    waiting = waiting[len(due) :]
                    kept.extend(self._samples(due, point, trial))
        except (GaussError, KeyboardInterrupt) as error:
            reason = "interrupted" if isinstance(error, KeyboardInterrupt) else str(error)
            raise SimulationError(reason, self._trajectory(kept, samples, began)) from error
        finally:
            bar.close()
        return self._trajectory(kept, samples, began)

    def _samples(self, due, point: Point, trial: Trial | None):
        """Samples inside the step that led to a point: its end itself, or dense output."""
        dense = Dense.of(trial.chart, trial.start, trial.h, trial.K) if any(t != point.state.t for t in due) else None
        for t in due:
            if t == point.state.t:
                yield point.state, point.work
            else:
                state, work = dense(t)
                yield self.settle(state), work

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        if samples is not None and not (samples.size and samples[0] == kept[0][0].t):
            kept = kept[1:]
        states = [state for state, _ in kept]
        stats = Stats(
            self.solver.evaluations,
            self.steps,
            self.rejected,
            time.perf_counter() - began,
            self.solver.worst_error,
            self.solver.method,
        )
        return Trajectory(
            self.system,
            np.array([state.t for state in states]),
            np.array([state.q for state in states]).reshape(len(states), self.system.n_q),
            np.array([state.v for state in states]).reshape(len(states), self.system.n_v),
            np.array([work for _, work in kept]).reshape(len(states), self.powers),
            stats,
        )


def too_small(t: float, rtol: float) -> str:
    """Message when time no longer advances."""
    return (
        f"t = {t:.6g} s: the step fell below what can be added to the time, yet misses rtol {rtol:g}: "
        "the motion is singular or very stiff here. Loosen the tolerance, or look at the motion so far."
    )
