"""Step loop in Python: trial, projection onto the constraints, check, samples."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from gauss.codegen.kernels import Due
from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.laws.switching_functions import ONWARD, SHORT, Switching, endless, onward
from gauss.errors import GaussError, SimulationError
from gauss.integrators import SLOWEST, Controlled, FixedStep, Integrator, Point, Trial, carried, first_step
from gauss.simulation.grid import grid_of
from gauss.simulation.prescribed import crossed
from gauss.simulation.progress import Progress
from gauss.simulation.trajectory import Event, Stats, Trajectory
from gauss.system import State, System

SMALLEST_STEP = 1e-13  # relative to the duration: below it rounding of time dominates
SHORTEST = 1e-6  # of the duration: least initial step after a switching time; error control reduces it if need be
TRIALS, CRAWLING = 500, 1e-7  # progress per so many trials, relative to the duration, below which a law chatters
CHATTER, SLIDING = 0.25, 1e-3  # sliding mode: crossings of switching surfaces per trial, and progress of TRIALS with those
# Opaque laws: the defect y' − f(t, y) of the dense output is sampled, and compared with the tolerance.
DEFECTS, NEAR = (0.187, 0.431, 0.569, 0.813), 1e-4  # places in a step, and increment of the differences for y', of the step
UNSEEN, HALF = 1e5, 0.5  # largest defect over the tolerance, and the share of the step tried after a larger one
SPARSE = 0.01  # of the duration: longer steps with opaque laws may miss short features
RESOLVED = 1e-6  # of the duration: the defect of shorter steps is not sampled


class Run:
    """One simulation in Python.

    Parameters
    ----------
    system : System
        The system.
    method : Integrator
        Integrator.
    solver : Engine
        Source of accelerations.
    tolerance : Tolerance
        Of an adaptive method.
    step : float or None
        Step of a fixed-step method, largest step of an adaptive one [s].
    end : float
        Final time [s].
    settles : bool
        Whether states are projected onto the constraints after each step.
    switching : Switching
        Switching times and functions, and jumps of prescribed velocities.
    """

    def __init__(
        self,
        system: System,
        method: Integrator,
        solver: Engine,
        tolerance,
        step,
        end,
        settles=True,
        switching: Switching = Switching(),  # noqa: B008 (frozen)
    ):
        self.system, self.method, self.solver = system, method, solver
        self.tolerance, self.step, self.end, self.settles, self.switching = tolerance, step, end, settles, switching
        self.steps = self.rejected = self.factorisations = self.unseen = 0
        self.longest = self.crossings = 0.0
        self.events: list[Event] = []

    powers = 3  # quadratures: work of drives, work of forces on bodies, dissipation in dampers

    def evaluate(self, state: State):
        """Rates of a state."""
        return self.solver.rates(self.system, state)

    def settle(self, state: State) -> State:
        """State after a step, projected onto the constraints."""
        return self.solver.project(self.system, state) if self.settles else state

    def steps_of(self, point: Point, samples) -> Iterator:
        """Accepted points, each with the dense output of its step: t → (state, work)."""
        fixed = isinstance(self.method, FixedStep)
        return self.fixed(self.method, point, samples) if fixed else self.adaptive(self.method, point)

    def adaptive(self, method: Controlled, point: Point) -> Iterator:
        """Accepted points of adaptive steps and of switching times, with dense output."""
        h, duration = first_step(self, point, self.tolerance, method.order), self.end - point.state.t
        for before, after in self.switching.times.stops(point.state.t, self.end):
            for reached, following, dense in self._stretch(method, point, h, before, duration):
                point, h = reached, following
                yield point, dense
            if after > before:
                jumped = self._jumped(point, after)
                point = jumped or self.carried_to(point, after)
                if jumped:
                    yield point, None
                h = max(first_step(self, point, self.tolerance, method.order), SHORTEST * duration)

    def carried_to(self, point: Point, t: float) -> Point:
        """Point just after a switching time, with the rates there."""
        return carried(self, point, t)

    def _jumped(self, point: Point, after: float) -> Point | None:
        """Point after the impact of a jump of prescribed velocities; None without a jump."""
        found = crossed(self.switching.jumps, point.state, point.work, after)
        if found is None:
            return None
        self.events.append(found.event)
        return Point(found.state, found.work, self.evaluate(found.state))

    def _stretch(self, method: Controlled, point: Point, h: float, end: float, duration: float) -> Iterator:
        """Accepted points up to a switching time, each with the next step size and the dense output."""
        largest, tried, looked = duration if self.step is None else self.step, 0, point.state.t
        while point.state.t < end:
            tried += 1
            if tried % TRIALS == 0:
                least = SLIDING if self.crossings > CHATTER * TRIALS else CRAWLING
                if (self.switching.conditional or self.switching.called) and point.state.t - looked < least * duration:
                    raise SimulationError(endless(point.state.t, self.switching.conditional + self.switching.called))
                looked, self.crossings = point.state.t, 0.0
            h = min(h, largest)
            remaining = end - point.state.t
            trial_h = remaining if h >= remaining * (1 - 1e-12) else h
            if not trial_h >= SMALLEST_STEP * duration:  # or NaN
                point, h = self._handed_over(point, method, SimulationError(too_small(point.state.t, self.tolerance.rtol)))
                continue
            try:
                trial = method.attempt(self, point, trial_h, self.tolerance)
                if self.switching.called and trial_h < SHORT * SMALLEST_STEP * duration:
                    trial = replace(trial, error=0.0, factor=ONWARD)  # a step across a discontinuity has no order
                self.factorisations += int(trial.cost.factorisations)
                share = self._resolved(method, point, trial, trial_h, SMALLEST_STEP * duration) if trial.accepted else 1.0
                if share < 1.0:
                    h, self.rejected = trial_h * share, self.rejected + 1
                    continue
                reached = self._settled(trial.point, None if trial_h < remaining else end) if trial.accepted else None
            except DistrustError:
                self.rejected += 1
                continue
            except SimulationError as error:
                self.rejected += 1  # the trial left the region where the equations can be solved
                h = trial_h * SLOWEST
                if h < SMALLEST_STEP * duration:
                    point, h = self._handed_over(point, method, error)
                continue
            h = trial_h * trial.factor
            if reached is None:
                self.rejected += 1
                continue
            self.steps += 1
            begin, point = point, reached
            yield point, h, self._dense(method, begin, trial_h, trial.kept)

    def _resolved(self, method: Controlled, begin: Point, trial: Trial, h: float, smallest: float) -> float:
        """Share of an accepted step that resolves switching functions and opaque laws; 1 if all of it does."""
        shortest = SHORT * smallest / h
        share, crossings = self.switching.share(begin, trial.point) if shortest < 1.0 else (1.0, 0.0)
        self.crossings += crossings
        if share < 1.0:
            return onward(share, shortest)
        if not self.switching.called or h * SMALLEST_STEP <= RESOLVED * smallest:
            return 1.0
        dense = self._dense(method, begin, h, trial.kept)
        allowed = self.tolerance.scale(self.system, trial.point.state)[self.system.n_v :]
        for place in DEFECTS:
            near = [dense(begin.state.t + (place + shift) * h)[0] for shift in (-NEAR, 0.0, NEAR)]
            defect = (near[2].v - near[0].v) / (near[2].t - near[0].t) - self.evaluate(near[1]).acceleration
            if (h * np.abs(defect) > UNSEEN * allowed).any():
                return HALF
        return 1.0

    def _handed_over(self, point: Point, method: Controlled, error: SimulationError) -> tuple[Point, float]:
        """Point and step from which the certified engine continues after a failure; the error if that engine failed.

        It solves some states that machine code does not, as with a singular joint inertia, or explains the failure.
        """
        if not self.solver.hand_over(point.state.t):
            raise error
        point = replace(point, rates=self.evaluate(point.state))
        return point, first_step(self, point, self.tolerance, method.order)

    def _dense(self, method: Controlled, begin: Point, h: float, kept: np.ndarray) -> Callable:
        coefficients = cache(lambda: method.dense(self, begin, h, kept)[0])
        return lambda t: method.interpolate(self, begin, h, coefficients(), t)

    def fixed(self, method: FixedStep, point: Point, samples) -> Iterator:
        """Points of fixed steps; samples between them are the ends of separate shorter steps."""
        self.unseen = self.switching.times.unresolved(point.state.t, self.end, self.step)
        stops = dict(stop for stop in self.switching.times.stops(point.state.t, self.end) if stop[0] < stop[1])
        after, passed = set(stops.values()), point.state.t
        for t, due in grid_of(method, point.state.t, self.end, self.step, samples, self.switching):
            if t <= passed:  # within the switching time of an impact
                continue
            if due != Due.OFF_GRID_SAMPLE:
                begin, point = point, self._advance(method, point, t)
                self.unseen += self.switching.share(begin, point)[0] < 1.0
                if t in after:
                    point = replace(point, rates=self.evaluate(point.state), memory=None)
                self.steps += 1
                yield point, lambda t, begin=begin: self._aside(method, begin, t)
                jumped = self._jumped(point, stops[t]) if t in stops else None
                if jumped:
                    point, passed = jumped, stops[t]
                    yield point, None

    def _aside(self, method: FixedStep, begin: Point, t: float) -> tuple[State, np.ndarray]:
        """State and work of an off-grid sample: a separate shorter step that the motion does not continue from."""
        reached = method.step(self, begin, t - begin.state.t)[0]
        return replace(reached.state, t=t), reached.work

    def _advance(self, method: FixedStep, point: Point, t: float) -> Point:
        """One fixed step, repeated if its accelerations fail the check."""
        for _ in range(2):
            found, cost = method.step(self, point, t - point.state.t)
            self.factorisations += int(cost.factorisations)
            try:
                return self._settled(found, t)
            except DistrustError:
                self.rejected += 1
        return self._settled(found, t)

    def _settled(self, point: Point, t: float | None) -> Point:
        """Checked point of a step after projection, at exactly time t [s] where that is given."""
        state = point.state if t is None else replace(point.state, t=t)
        point = replace(point, state=state)
        settled = self.settle(state)
        if settled is not state:
            point = Point(settled, point.work, self.evaluate(settled))
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
            error.trajectory = self._trajectory(kept, samples, began)
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
                yield self.settle(state), work

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
            opaque=", ".join(self.switching.called) if self.longest > SPARSE * whole else "",
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


def too_small(t: float, rtol: float) -> str:
    """Message when the step size underflows."""
    return (
        f"t = {t:.6g} s: the step size fell below the resolution of time, yet its error exceeds rtol {rtol:g}: "
        "the motion is singular or very stiff here. Loosen the tolerance, or look at the motion so far."
    )


def unsolved(t: float) -> str:
    """Message when the iteration of an implicit step does not converge."""
    return f"t = {t:.6g} s: the equations of an implicit step were not solved; shorten the step."
