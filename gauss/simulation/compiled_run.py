"""A simulation as one compiled step loop, called in batches of steps."""

import time
from collections.abc import Hashable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from gauss.codegen.kernels import ENERGY_RECORD, Control, Due, Fixed, Loop, LoopStatus
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, relative_error
from gauss.dynamics.laws.switching_functions import Switching, endless
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import method_key
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.integrators import Controlled, ExplicitPair, FixedStep, Point, Rates, Taylor, Tolerance, carried
from gauss.simulation.compiled_steps.explicit_stages import memory
from gauss.simulation.compiled_steps.loop_functions import fixed, single
from gauss.simulation.compiled_steps.taylor_step import remembered
from gauss.simulation.grid import grid_of
from gauss.simulation.prescribed import Crossed, crossed
from gauss.simulation.progress import Progress
from gauss.simulation.python_run import CRAWLING, SHORTEST, SMALLEST_STEP, TRIALS, unsolved
from gauss.simulation.trajectory import EnergyRecord, Event, Stats, Trajectory
from gauss.system import State, System

CHECKING = 48  # evaluations between two checks: a check costs as much as two and a half
CHECKED = 2  # entries of a check before those of the energies
BUDGET = 4096  # steps of one call of the loop: between calls, the bar moves and Ctrl-C is handled
QUICK = 16 * 16 * 12  # rates² · evaluations of a step of which BUDGET take no more than about a tenth of a second
# statuses after which the certified engine continues from the last confirmed point: it may solve, or explain, the failure
UNTRUSTED = (LoopStatus.UNCONFIRMED, LoopStatus.OFF_CONSTRAINTS, LoopStatus.TOO_SMALL)


class CompiledRun:
    """One simulation in machine code.

    Parameters
    ----------
    system : System
        The system.
    laws : Laws
        Its loads, all of which are traced.
    start : State
        Consistent initial state.
    end : float
        Final time [s].
    samples : ndarray or None
        Times to return [s]; every step when None.
    drift : Drift
        Constraint stabilisation.
    method : FixedStep, Controlled or Taylor
        Integrator.
    switching : Switching
        Switching times and functions, and jumps of prescribed velocities.
    """

    def __init__(
        self,
        system: System,
        laws: Laws,
        start: State,
        end: float,
        samples,
        drift: Drift,
        method,
        switching: Switching = Switching(),  # noqa: B008 (frozen)
    ):
        self.began = time.perf_counter()
        self.system, self.laws, self.start, self.end, self.samples = system, laws, start, end, samples
        self.switching = switching
        self.events: list[Event] = []
        self.drift, self.certified, self.key = drift, CertifiedEngine("auto", drift.gains), (drift, laws.key)
        self.memory, size = self._remembered(method)
        self.program = self._on_demand((Program, size), lambda: Program(system, laws, drift, size))
        self.layout = self.program.layout
        duration = end - start.t
        self.budget = max(1, int(BUDGET * min(1.0, QUICK / (max(1, system.n_v) ** 2 * method.evaluations))))
        limits = {"smallest": SMALLEST_STEP * duration, "largest": duration}
        self.control = Control(end=end, acceleration_tolerance=ACCELERATION_TOLERANCE, **limits)

    def adaptive(self, method: Controlled | Taylor, tolerance: Tolerance, largest: float | None, progress: bool):
        """Run an adaptive method until the end or a status of :data:`UNTRUSTED`."""
        control = self.control
        shares = tolerance.shares
        loop = self._loop_of((method_key(method), tolerance.key), lambda: single(self.program, method, shares))
        control.every = max(1, round(CHECKING / method.evaluations))
        control.rtol, control.atol, control.atol_rates = tolerance.rtol, tolerance.atol, tolerance.atol_rates
        control.largest = control.largest if largest is None else largest
        control.order = method.order_for(tolerance) if isinstance(method, Taylor) else method.order
        state, allowed = self.start, (tolerance.rtol, tolerance.atol, tolerance.atol_rates)
        begun = loop.evaluate("start", np.concatenate([[state.t], state.q, state.v, allowed]))
        control.h, size = float(begun[-1]), self.layout.size
        self._begin(begun[:size], begun[size:-1])
        grid = np.zeros(1) if self.samples is None else self.samples[self.samples > self.start.t]
        control.samples = 0.0 if self.samples is None else grid.size
        out = np.empty((grid.size if control.samples else self.budget, self.layout.row))
        stops = iter(self.switching.times.stops(self.start.t, self.end)) if self.switching.times else iter([(self.end,) * 2])
        control.end, after = next(stops)
        tried, looked = 0, self.start.t

        def advance():
            nonlocal after, tried, looked
            if self.point[0] >= control.end:
                if after > control.end:
                    self._carry_to(after, allowed)
                control.end, after = next(stops)
            loop(control, self.point, self.confirmed, grid, out, self.budget)
            if self.switching.conditional and control.steps + control.rejected - tried >= TRIALS:
                if control.status == LoopStatus.PAUSED and self.point[0] - looked < CRAWLING * (self.end - self.start.t):
                    raise SimulationError(endless(looked, self.switching.conditional), self.trajectory())
                tried, looked = control.steps + control.rejected, self.point[0]
            if control.status == LoopStatus.DONE and control.end < self.end:
                control.status = LoopStatus.PAUSED

        self._drive(advance, out, progress)

    @property
    def _equations(self) -> SimpleNamespace:
        """Equations of motion, as steps across a switching time take them."""
        return SimpleNamespace(system=self.system, evaluate=self._evaluate)

    def _carry_to(self, t: float, allowed: tuple):
        """Continue just after a switching time, with the rates there."""
        if self._jumped(t) and self.samples is None:
            self.rows.append(self.point[None, : self.layout.row].copy())
        point = carried(self._equations, self.layout.point(self.point), t)
        self.point, state = self.layout.pack(point), point.state
        first = float(self.loop.evaluate("start", np.concatenate([[t], state.q, state.v, allowed]))[-1])
        self.control.h = max(first, SHORTEST * (self.end - self.start.t))

    def _jumped(self, after: float) -> Crossed | None:
        """Impact at a switching time, after which the motion continues; None if no prescribed velocity jumps."""
        if not self.switching.jumps.within(self.point[0], after):
            return None
        point = self.layout.point(self.point)
        found = crossed(self.switching.jumps, point.state, point.work, after)
        if found is not None:
            self.events.append(found.event)
            confirmed = self.confirmed[0] == self.point[0]
            rates = self._evaluate(found.state)
            self.point = self.layout.pack(Point(found.state, found.work, rates, self.memory))
            self.confirmed = self.point.copy() if confirmed else self.confirmed
        return found

    def fixed(self, method: FixedStep, step: float, progress: bool):
        """Run a fixed-step method until the end or a status of :data:`UNTRUSTED`."""
        loop = self._loop_of(method_key(method), lambda: self._fixed(method).compile())
        point = self.layout.pack(Point(self.start, np.zeros(3), self._evaluate(self.start), self.memory))
        self._begin(point, loop.evaluate("check", point))
        self.control.every = max(1, round(CHECKING / method.evaluations))
        pairs = grid_of(method, self.start.t, self.end, step, self.samples, self.switching)
        out = np.empty((self.budget, self.layout.row))
        self.crossings, self.renewed = self._interruptions(pairs, method) if self.switching.times else ({}, ())
        self._drive(lambda: self._advance(pairs, out), out, progress)
        self.control.unseen += self.switching.times.unresolved(self.start.t, self.end, step)

    def _interruptions(self, pairs: np.ndarray, method: FixedStep) -> tuple[dict[int, float], np.ndarray]:
        """Steps before a possible velocity jump, each with the time after it; steps that end at a switching time."""
        stops = [stop for stop in self.switching.times.stops(self.start.t, self.end) if stop[0] < stop[1]]
        place = np.searchsorted(pairs[:, 0], stops, side="right").reshape(-1, 2)
        crossings = {
            int(before): after
            for (before, _), (begin, after) in zip(place, stops, strict=True)
            if self.switching.jumps.within(begin, after)
        }
        return crossings, place[:, 1] if method.remembers else place[:0, 1]

    def _fixed(self, method: FixedStep) -> Fixed:
        """Functions of a fixed-step method."""
        return fixed(self.program, method)

    def _advance(self, pairs: np.ndarray, out: np.ndarray):
        """Run the steps of the grid up to the next interruption."""
        control = self.control
        if int(control.sample) in self.crossings:
            self._pass(pairs, self.crossings.pop(int(control.sample)))
        done = int(control.sample)
        until = min([k for k in (*self.renewed, *self.crossings) if k > done], default=len(pairs))
        part = pairs[done : min(until, done + self.budget)]
        self.loop(control, self.point, self.confirmed, part, out, len(part))
        if int(control.sample) == until and until in self.renewed:  # the memory holds accelerations of before
            point = self.layout.point(self.point)
            rates = self._evaluate(point.state)
            self.point = self.layout.pack(replace(point, rates=rates, memory=rates.acceleration))
        if control.status == LoopStatus.DONE and control.sample < len(pairs):
            control.status = LoopStatus.PAUSED

    def _pass(self, pairs: np.ndarray, after: float):
        """Continue on the grid after a switching time at which prescribed velocities jump."""
        before = self.point[None, : self.layout.row].copy()
        if self._jumped(after) is None:
            return
        row = self.point[None, : self.layout.row].copy()
        while self.control.sample < len(pairs) and pairs[int(self.control.sample), 0] <= after:
            if pairs[int(self.control.sample), 1] != Due.STEP and self.samples is not None:
                self.rows.append(row)
            self.control.sample += 1
        if self.samples is None:
            self.rows += [before, row]

    def _loop_of(self, kind: Hashable, make) -> Loop:
        """Step loop of a kind, cached."""
        self.kind, self.loop = kind, self._on_demand((Loop, kind), make)
        return self.loop

    def _begin(self, point: np.ndarray, checked: np.ndarray):
        """Start from a compiled point if it passes the check or is confirmed, else from a certified one."""
        control, (*_, kinetic, potential, total, magnitude) = self.control, checked.tolist()
        control.kinetic, control.magnitude, control.initial = kinetic, magnitude, total
        control.lowest = control.highest = potential
        right = self._is_enough(checked) or self._certified_error(point) <= ACCELERATION_TOLERANCE
        self.point = point.copy() if right else self._certified_start()
        self.confirmed = self.point.copy()
        begins = self.samples is None or self.samples[0] == self.start.t
        self.rows = [self.point[None, : self.layout.row].copy()] if begins else []

    def _remembered(self, method) -> tuple[np.ndarray | None, int]:
        """Initial memory of a method, accelerations where None, and its size."""
        if isinstance(method, ExplicitPair) and not self.drift.partitioned:
            return np.zeros(memory(self.system)), memory(self.system)
        if isinstance(method, Taylor):
            return np.zeros(remembered(self.system)), remembered(self.system)
        if isinstance(method, FixedStep) and method.carries:
            return np.zeros(method.carries(self.system)), method.carries(self.system)
        return None, self.system.n_v if isinstance(method, FixedStep) and method.remembers else 0

    def _evaluate(self, state: State) -> Rates:
        """Rates by machine code."""
        found, n_v = self.loop.evaluate("rates", np.concatenate([[state.t], state.q, state.v])), self.system.n_v
        return Rates(found[:n_v], found[n_v:])

    def _certified_start(self) -> np.ndarray:
        rates = self.certified.rates(self.system, self.start)
        return self.layout.pack(Point(self.start, np.zeros(3), rates, self.memory))

    def _on_demand(self, what: tuple, make):
        return self.system.dynamics.on_demand((*what, self.key), make)

    def _drive(self, advance, out, progress: bool):
        """Call the loop until it stops, and collect its rows."""
        control = self.control
        bar = Progress(self.end - self.start.t, progress)
        try:
            control.status = LoopStatus.PAUSED
            while control.status == LoopStatus.PAUSED:
                control.rows = 0.0
                advance()
                self._gather(out)
                bar.update(self.point[0] - self.start.t)
            if control.status == LoopStatus.DONE and not self._is_confirmed():
                control.status, self.confirmed = LoopStatus.UNCONFIRMED, self._certified_start()
            if control.status in UNTRUSTED:
                self.rows = [rows[rows[:, 0] <= self.confirmed[0]] for rows in self.rows]
                self.events = [event for event in self.events if event.t <= self.confirmed[0]]
        except KeyboardInterrupt as error:  # stays a KeyboardInterrupt: no handler of errors may swallow it
            self._gather(out)
            error.trajectory = self.trajectory()
            raise
        finally:
            bar.close()

    def _gather(self, out: np.ndarray):
        """Keep the rows that the loop has written."""
        count, self.control.rows = int(self.control.rows), 0.0
        self.rows.append(out[:count].copy())

    def _is_confirmed(self) -> bool:
        """Whether the certified recursion confirms the accelerations at the end.

        It is used for systems with loop, coupling or relation constraints: at both ends of the first run, and later where
        the check fails. Other systems are checked body by body in machine code, at their last point, too.
        """
        if not self.system.has_closures:
            return True
        packed, checked = self.point, (self.control.constraint_residual,)  # the error, by which the loop decides
        if self.system.closes and not self.drift.projects:  # off the constraints, accelerations are not unique
            point = self.layout.point(packed)
            state = project(self.system, point.state)
            packed = self.layout.pack(Point(state, point.work, self._evaluate(state), point.memory))
            checked = self.loop.evaluate("check", packed)
        if self._is_enough(checked):
            return True
        error = self._certified_error(packed)
        self.control.worst = max(self.control.worst, error)
        if error <= ACCELERATION_TOLERANCE:
            self._certified_loops().add(self.kind)
        return error <= ACCELERATION_TOLERANCE

    def _certified_error(self, packed: np.ndarray) -> float:
        """Relative error of the accelerations of a point, by the certified recursion."""
        point = self.layout.point(packed)
        exact = self.certified.rates(self.system, point.state).acceleration
        return relative_error(self.system, point.rates.acceleration, exact, point.state.v)

    def _is_enough(self, checked) -> bool:
        """Whether the check in machine code suffices to confirm accelerations.

        With inconsistent redundant constraints their residual decides, for no change of accelerations removes it.
        """
        known = not self.system.has_closures or self.kind in self._certified_loops()
        return known and all(error <= ACCELERATION_TOLERANCE for error in checked[:CHECKED])

    def _certified_loops(self) -> set[Hashable]:
        """Kinds of step loops that were confirmed at both ends of a run."""
        return self._on_demand((set,), set)

    def trajectory(self) -> Trajectory:
        """Motion so far."""
        control, n_q, n_v = self.control, self.system.n_q, self.system.n_v
        rows = np.concatenate(self.rows) if self.rows else np.zeros((0, self.layout.row))
        q, v, work = rows[:, 1 : 1 + n_q], rows[:, 1 + n_q : 1 + n_q + n_v], rows[:, 1 + n_q + n_v :]
        stats = Stats(
            int(control.evaluations) + self.certified.evaluations,
            int(control.steps),
            int(control.rejected),
            int(control.factorisations),
            time.perf_counter() - self.began,
            max(control.worst, self.certified.error),
            f"compiled recursion and integrator, checked every {int(control.every)} steps by inverse dynamics",
            unseen=int(control.unseen),
        )
        energies = EnergyRecord(*(getattr(control, name) for name in ENERGY_RECORD))
        return Trajectory(self.system, rows[:, 0], q, v, work, stats, tuple(self.events), looked=energies)


def finished(run: CompiledRun, certified) -> Trajectory:
    """Trajectory of a run, continued by ``certified(start, samples)`` where the compiled loop stopped early.

    Raises
    ------
    SimulationError
        If the motion cannot continue; its ``trajectory`` holds the motion so far.
    """
    status, first = LoopStatus(int(run.control.status)), run.trajectory()
    if status == LoopStatus.DONE:
        return first
    if status == LoopStatus.UNSOLVED:
        raise SimulationError(unsolved(run.point[0]), first)
    begin = run.layout.point(run.confirmed)
    samples = None if run.samples is None else run.samples[run.samples > begin.state.t]
    try:
        rest, failure = certified(begin.state, samples), None
    except (SimulationError, KeyboardInterrupt) as error:
        rest, failure = getattr(error, "trajectory", None), error
    if isinstance(failure, KeyboardInterrupt):
        failure.trajectory = first if rest is None else _joined(first, rest, begin.work, run.samples is None)
        raise failure
    if rest is None:
        raise SimulationError(f"t = {begin.state.t:.6g} s: compiled accelerations are not confirmed. {failure}", first)
    whole = _joined(first, rest, begin.work, run.samples is None)
    if failure is not None:
        raise SimulationError(str(failure), whole) from failure
    return whole


def _joined(first: Trajectory, rest: Trajectory, work, repeated: bool) -> Trajectory:
    """Concatenation of two trajectories; the second may repeat the last sample of the first."""
    skip = slice(1 if repeated else 0, None)
    columns = {name: np.concatenate([getattr(first, name), getattr(rest, name)[skip]]) for name in ("t", "q", "v")}
    one, two = first.stats, rest.stats
    method = two.method
    if len(rest):
        method = f"{two.method}, from t = {rest.t[0]:.6g} s on: the compiled recursion is too inaccurate there"
    stats = Stats(
        one.evaluations + two.evaluations,
        one.steps + two.steps,
        one.rejected + two.rejected,
        one.factorisations + two.factorisations,
        one.wall_time + two.wall_time,
        two.worst_error,
        method,
        two.rescued,
        unseen=one.unseen + two.unseen,
        opaque=two.opaque,
        handed_over=float(first.t[-1]) if len(first) else float(rest.t[0]),
    )
    columns["work"] = np.concatenate([first.work, rest.work[skip] + work])
    return Trajectory(first.system, **columns, stats=stats, events=(*first.events, *rest.events))
