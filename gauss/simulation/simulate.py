"""The loop: from a start, step by step, to a trajectory."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from gauss.errors import GaussError, SimulationError, known
from gauss.integrators import FIXED, SLOWEST, Dense, Point, Tolerance, Trial, attempt, first_step
from gauss.scene import Scene
from gauss.simulation.compile import compile_scene
from gauss.simulation.dynamics import project
from gauss.simulation.solver import Solver
from gauss.simulation.traced import DistrustError, Traced, forward_kernel
from gauss.simulation.trajectory import Stats, Trajectory
from gauss.system import State, System, obstacles

INTEGRATORS = ("dop853", *FIXED)
SMALLEST_STEP = 1e-13  # relative to the duration: below it time no longer advances reliably
SLOW = 1.0  # a progress bar appears on runs longer than this [s]


def simulate(
    scene: Scene | System,
    duration: float,
    *,
    integrator: str = "dop853",
    step: float | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    backend: str = "auto",
    state: State | None = None,
    times=None,
    progress: bool = True,
) -> Trajectory:
    """Simulate a motion.

    Parameters
    ----------
    scene : Scene or System
        What moves.
    duration : float
        How long [s].
    integrator : str
        "dop853": order 8, step chosen by ``rtol`` and ``atol``; "rk4" and "semi_implicit_euler": fixed ``step``.
    step : float, optional
        Step of a fixed-step method, largest step of an adaptive one [s].
    rtol, atol : float
        Local error of coordinates and rates: atol (rad, m, rad/s, m/s) + rtol · size.
    backend : str
        How accelerations are solved; see :func:`gauss.solve`. "auto": open chains and trees by compiled code that is
        confirmed by the certified recursion at every accepted step; else the recursion, certified at every evaluation.
    state : State, optional
        Start; the scene's own when not given. It is made consistent.
    times : array_like, optional
        Samples to return [s], counted from the start; every accepted step when not given.
    progress : bool
        Show a bar on runs of more than a second, if a terminal is there to show it.

    Returns
    -------
    Trajectory
        Samples, work of the loads, and what it cost.

    Raises
    ------
    SimulationError
        If the motion cannot go on; its ``trajectory`` holds what there is.
    """
    system = scene if isinstance(scene, System) else compile_scene(scene)
    _check(duration, integrator, step, rtol, atol)
    start = system.initial_state() if state is None else system.initial_state(state.q, state.v, state.t)
    samples = _samples(times, start.t, duration)
    run = _Run(system, _evaluator(system, backend), Tolerance(rtol, atol), step, start.t + duration)
    method = run.adaptive if integrator == "dop853" else lambda point: run.fixed(FIXED[integrator], point, samples)
    return run.collect(method, start, samples, progress)


def _evaluator(system: System, backend: str) -> Solver | Traced:
    """Compiled accelerations where "auto" may use them, else a backend whose every answer is certified."""
    if backend == "auto" and system.dynamics is not None and not obstacles(system):
        return Traced(system, system.dynamics.kernel("forward", lambda: forward_kernel(system)))
    return Solver(backend)


class _Run:
    """One simulation while it runs."""

    def __init__(self, system: System, solver: Solver | Traced, tolerance: Tolerance, step, end: float):
        self.system, self.solver, self.tolerance, self.step, self.end = system, solver, tolerance, step, end
        self.steps = self.rejected = 0

    def evaluate(self, state: State):
        return self.solver.rates(self.system, state)

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
                raise SimulationError(
                    f"t = {point.state.t:.6g} s: the step fell to {trial_h:.1e} s yet misses rtol {self.tolerance.rtol:g}: "
                    "the motion is singular or very stiff here. Loosen the tolerance, or look at the motion so far."
                )
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
            h = trial.next_step()
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
        if self.system.has_closures:
            state = project(self.system, state)
            point = Point(state, point.work, self.evaluate(state))
        self.solver.confirm(point)
        self.steps += 1
        return point

    def collect(self, method, start: State, samples, progress: bool) -> Trajectory:
        """Run to the end and gather the samples."""
        began = time.perf_counter()
        kept: list[tuple[State, np.ndarray]] = [(start, np.zeros(3))]
        waiting = None if samples is None else [t for t in samples if t > start.t]
        bar = tqdm(
            total=self.end - start.t,
            unit="s",
            disable=None if progress else True,
            delay=SLOW,
            leave=False,
            bar_format="{l_bar}{bar}| {n:.3g}/{total:.3g} s simulated [{elapsed}<{remaining}]",
        )
        try:
            first = Point(start, np.zeros(3), self.evaluate(start))
            for point, trial in method(first):
                bar.update(point.state.t - start.t - bar.n)
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
        dense = Dense(trial) if any(t != point.state.t for t in due) else None
        for t in due:
            if t == point.state.t:
                yield point.state, point.work
            else:
                state, work = dense(t)
                yield project(self.system, state), work

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
            np.array([work for _, work in kept]).reshape(len(states), 3),
            stats,
        )


def _check(duration, integrator, step, rtol, atol):
    if integrator not in INTEGRATORS:
        raise SimulationError(f"no integrator {integrator!r}. {known(integrator, INTEGRATORS)}")
    numbers = {"duration": duration, "rtol": rtol, "atol": atol} | ({} if step is None else {"step": step})
    for name, value in numbers.items():
        if not np.isfinite(value) or value <= 0:
            raise SimulationError(f"{name}: expected a positive number, got {value!r}.")
    if integrator in FIXED and step is None:
        raise SimulationError(f"integrator {integrator!r} has a fixed step: give step= [s], for instance step=1e-3.")


def _samples(times, start: float, duration: float):
    if times is None:
        return None
    samples = start + np.asarray(times, dtype=float)
    end = start + duration
    inside = samples.ndim == 1 and samples.size and (np.diff(samples) > 0).all()
    if not inside or samples[0] < start or samples[-1] > end * (1 + 1e-12):
        raise SimulationError(f"times: expected increasing times between 0 and the duration {duration} s.")
    return np.minimum(samples, end)
