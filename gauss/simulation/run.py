"""A simulation while it runs: steps are tried, settled on the constraints, confirmed, and sampled."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.switching import ONWARD, SHORT, Switching, endless, onward
from gauss.errors import GaussError, SimulationError
from gauss.integrators import SLOWEST, Controlled, FixedStep, Integrator, Point, Trial, carried, first_step
from gauss.kernels import Due
from gauss.simulation.grid import grid
from gauss.simulation.prescribed import crossed
from gauss.simulation.progress import Progress
from gauss.simulation.trajectory import Event, Stats, Trajectory
from gauss.system import State, System

SMALLEST_STEP = 1e-13  # relative to the duration: below it time no longer advances reliably
SHORTEST = 1e-6  # of the motion: a first step after a switching time is no shorter, for the error tells if that is too long
TRIALS, CRAWLING = 500, 1e-7  # so many trials that lead no further than this share of the motion lead nowhere
CHATTER, SLIDING = 0.25, 1e-3  # crossings of switching surfaces per trial, and what those trials lead to: a sliding mode
# Opaque laws: dense output y is sampled, and y' − f(t, y) must not change the rates by far more than the error allowed.
DEFECTS, NEAR = (0.187, 0.431, 0.569, 0.813), 1e-4  # where in a step, and how far from there y' is found by differences
UNSEEN, HALF = 1e5, 0.5  # times the error allowed; of the step that is tried then
SPARSE = 0.01  # of the motion: steps with opaque laws that are longer may miss short events
RESOLVED = 1e-6  # of the motion: in shorter steps nothing is looked for


class Run:
    """One simulation while it runs.

    Parameters
    ----------
    system : System
        What moves.
    method : Integrator
        How it is stepped.
    solver : Engine
        Where its accelerations come from.
    tolerance : Tolerance
        Of an adaptive method.
    step : float or None
        Step of a fixed-step method, largest step of an adaptive one [s].
    end : float
        When to stop [s].
    settles : bool
        Whether states are brought back to the constraints after each step.
    switching : Switching
        What steps heed so that nothing acts between two looks.
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

    powers = 3  # integrated beside the motion: of drives, of forces on bodies, lost in dampers

    def evaluate(self, state: State):
        """Rates of a state."""
        return self.solver.rates(self.system, state)

    def settle(self, state: State) -> State:
        """State after a step, brought back to everything that must hold."""
        return self.solver.project(self.system, state) if self.settles else state

    def steps_of(self, point: Point, samples) -> Iterator:
        """Points reached, and with each a function of a time on the way there → (state, work)."""
        fixed = isinstance(self.method, FixedStep)
        return self.fixed(self.method, point, samples) if fixed else self.adaptive(self.method, point)

    def adaptive(self, method: Controlled, point: Point) -> Iterator:
        """Points reached by steps that the method chooses, and at switching times; between them it has dense output."""
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
        """Point across a switching time, with the rates there."""
        return carried(self, point, t)

    def _jumped(self, point: Point, after: float) -> Point | None:
        """Point after an impact of prescribed motions just before it; None if nothing prescribed jumps."""
        found = crossed(self.switching.jumps, point.state, point.work, after)
        if found is None:
            return None
        self.events.append(found.event)
        return Point(found.state, found.work, self.evaluate(found.state))

    def _stretch(self, method: Controlled, point: Point, h: float, end: float, duration: float) -> Iterator:
        """Points reached until a time, what the next step may be, and dense output on the way there."""
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
            if not trial_h >= SMALLEST_STEP * duration:  # nor is it no number
                point, h = self._handed_over(point, method, SimulationError(too_small(point.state.t, self.tolerance.rtol)))
                continue
            try:
                trial = method.attempt(self, point, trial_h, self.tolerance)
                if self.switching.called and trial_h < SHORT * SMALLEST_STEP * duration:
                    trial = replace(trial, error=0.0, factor=ONWARD)  # across a jump of a law, no step is short enough
                self.factorisations += int(trial.cost.factorisations)
                seen = self._seen(method, point, trial, trial_h, SMALLEST_STEP * duration) if trial.accepted else 1.0
                if seen < 1.0:
                    h, self.rejected = trial_h * seen, self.rejected + 1
                    continue
                reached = self._settled(trial.point, None if trial_h < remaining else end) if trial.accepted else None
            except DistrustError:
                self.rejected += 1
                continue
            except SimulationError as error:
                self.rejected += 1  # a step that leads where nothing can be solved is too long
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

    def _seen(self, method: Controlled, begin: Point, trial: Trial, h: float, smallest: float) -> float:
        """Share of an accepted step that shows all that acts in it: 1, or how long the step is to be."""
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
        """Point and step with which the certified recursion goes on where machine code does not; the error if it is at work.

        It may solve what the machine code cannot, as where a tree moves no inertia by itself, or say why not.
        """
        if not self.solver.hand_over(point.state.t):
            raise error
        point = replace(point, rates=self.evaluate(point.state))
        return point, first_step(self, point, self.tolerance, method.order)

    def _dense(self, method: Controlled, begin: Point, h: float, kept: np.ndarray) -> Callable:
        coefficients = cache(lambda: method.dense(self, begin, h, kept)[0])
        return lambda t: method.interpolate(self, begin, h, coefficients(), t)

    def fixed(self, method: FixedStep, point: Point, samples) -> Iterator:
        """Points reached by steps of fixed length; between them, shorter steps aside lead."""
        self.unseen = self.switching.times.unresolved(point.state.t, self.end, self.step)
        stops = dict(stop for stop in self.switching.times.stops(point.state.t, self.end) if stop[0] < stop[1])
        after, passed = set(stops.values()), point.state.t
        for t, due in grid(point.state.t, self.end, self.step, samples, self.switching.times):
            if t <= passed:  # it is at a switching time, which an impact has passed
                continue
            if due != Due.ASIDE:
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
        """State and work after a step to a time from which the motion does not go on."""
        reached = method.step(self, begin, t - begin.state.t)[0]
        return replace(reached.state, t=t), reached.work

    def _advance(self, method: FixedStep, point: Point, t: float) -> Point:
        """One fixed step; made again when its accelerations turn out not to be trusted."""
        for _ in range(2):
            found, cost = method.step(self, point, t - point.state.t)
            self.factorisations += int(cost.factorisations)
            try:
                return self._settled(found, t)
            except DistrustError:
                self.rejected += 1
        return self._settled(found, t)

    def _settled(self, point: Point, t: float | None) -> Point:
        """Point reached by a step, on the constraints again, at exactly the time that was meant."""
        state = point.state if t is None else replace(point.state, t=t)
        point = replace(point, state=state)
        settled = self.settle(state)
        if settled is not state:
            point = Point(settled, point.work, self.evaluate(settled))
        self.solver.check(point, last=state.t >= self.end)
        return point

    def collect(self, start: State, samples, progress: bool) -> Trajectory:
        """Run to the end and gather the samples; every step when there are none."""
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
        except KeyboardInterrupt as error:  # no error of ours: who catches those must not swallow it
            error.trajectory = self._trajectory(kept, samples, began)
            raise
        finally:
            bar.close()
        return self._trajectory(kept, samples, began)

    def _first(self, start: State) -> Point:
        """Point from which the steps go; made again when its accelerations turn out not to be trusted."""
        for _ in range(2):
            first = Point(start, np.zeros(self.powers), self.evaluate(start))
            try:
                self.solver.check(first)
                break
            except DistrustError:
                self.rejected += 1
        return first

    def _samples(self, due, point: Point, inside: Callable):
        """Samples on the way to a point, and there."""
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
    """Message when time no longer advances."""
    return (
        f"t = {t:.6g} s: the step fell below what can be added to the time, yet misses rtol {rtol:g}: "
        "the motion is singular or very stiff here. Loosen the tolerance, or look at the motion so far."
    )


def unsolved(t: float) -> str:
    """Message when the equations of an implicit step were not solved."""
    return f"t = {t:.6g} s: the equations of an implicit step were not solved; shorten the step."
