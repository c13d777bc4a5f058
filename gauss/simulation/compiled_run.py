"""A motion by one compiled step loop: integrator and dynamics in machine code, called in batches of steps.

Accelerations are checked every few steps by inverse dynamics in machine code, and at the ends by the certified recursion;
the loop stops at a failed check, and the fallback dynamics of the plan continue from the last confirmed point
(:mod:`gauss.simulation.continued_run`). Adaptive methods: :mod:`gauss.simulation.compiled_adaptive_run`; fixed
steps: :mod:`gauss.simulation.compiled_fixed_run`.
"""

import time
from collections.abc import Callable, Hashable, Sequence
from functools import cached_property
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from gauss.codegen.kernels import ENERGY_RECORD, Control, Loop, LoopStatus
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, relative_error
from gauss.dynamics.inputs import InputForces
from gauss.dynamics.plan import method_key
from gauss.dynamics.point_layout import PointLayout
from gauss.dynamics.programs import program_of
from gauss.dynamics.store import cached_on_disk, is_noted_on_disk, note_on_disk
from gauss.dynamics.traced_system import Program
from gauss.errors import GaussError, SimulationError
from gauss.integrators import ExplicitPair, FixedStep, Point, Rates
from gauss.simulation.motion_records import EnergyRecord, Event, Stats
from gauss.simulation.prescribed import AfterJump, crossed
from gauss.simulation.problem import Problem
from gauss.simulation.progress import Progress
from gauss.simulation.step_limits import BUDGET, smallest_step, steps_per_check
from gauss.simulation.trajectory import Trajectory
from gauss.system import State

recorded_energies = attrgetter(*ENERGY_RECORD)
HELD_SAMPLES = 256  # samples of a control law between two looks at the progress
CHECK_ERRORS = 2  # entries of a check before those of the energies
# rates² · evaluations of a step up to which BUDGET steps take less than about a tenth of a second
BUDGET_WORK = 16 * 16 * 12
# statuses after which the certified engine continues from the last confirmed point: it may solve, or explain, the failure
UNTRUSTED = (LoopStatus.UNCONFIRMED, LoopStatus.OFF_CONSTRAINTS, LoopStatus.TOO_SMALL)


class MethodOnSystem(NamedTuple):
    """What all runs of one method on one system have in common, beside their machine code."""

    layout: PointLayout  # places in a point
    method_state: np.ndarray | None  # initial method state; the accelerations where None
    budget: int  # steps of one call of the loop
    every: int  # steps between two checks of the accelerations
    order: float  # order of the method


class CompiledRun:
    """One motion in machine code.

    Parameters
    ----------
    problem : Problem
        Initial value problem whose loads are all traced.
    dynamics : str
        Of its plan, from which the functions of the system come.
    """

    def __init__(self, problem: Problem, dynamics: str = "compiled"):
        self.began = time.perf_counter()
        self.problem, self.system, self.start, self.end = problem, problem.system, problem.start, problem.end
        self.samples, self.switching, self.drift = problem.samples, problem.switching, problem.drift
        self.events: list[Event] = []
        self.rows: list[np.ndarray] = []
        self.held = problem.held
        self.dynamics, self.method_key = dynamics, method_key(problem.method)
        self.key: tuple[Hashable, ...] = (dynamics, self.drift, problem.laws.key, self.held is not None)
        self.common: MethodOnSystem = self._on_demand((MethodOnSystem, self.method_key), self._on_system)
        self.layout, self.method_state, self.budget, *_ = self.common
        self.inputs = np.zeros(len(self.layout.parameters))
        self.input_forces = InputForces(self.system) if self.held else None
        duration = self.end - self.start.t
        limits = {"smallest": smallest_step(duration, self.end), "largest": duration}
        self.control = Control(end=self.end, acceleration_tolerance=ACCELERATION_TOLERANCE, **limits)

    @cached_property
    def certified(self) -> CertifiedEngine:
        """Engine that confirms accelerations; most runs need none."""
        return CertifiedEngine("auto", self.drift.gains)

    @cached_property
    def program(self) -> Program:
        """Functions of the system; machine code that is read from disk needs none."""
        kind, layout, laws = program_of(self.dynamics), self.layout, self.problem.laws
        make = lambda: kind(self.system, laws, self.drift, layout.memory, inputs=self.held is not None)  # noqa: E731
        return self._on_demand((Program, layout.memory), make)

    @property
    def checks_bodies(self) -> bool:
        """Whether accelerations are checked body by body, which joints that close loops do not allow."""
        return not self.system.has_closures and program_of(self.dynamics).checks_bodies

    def run(self):
        """Run until the end, or a status of :data:`UNTRUSTED`."""
        raise NotImplementedError

    def _on_system(self) -> MethodOnSystem:
        """What depends on the method and the system alone."""
        system, method = self.system, self.problem.method
        method_state, size = self._initial_method_state()
        layout = PointLayout(system.n_q, system.n_v, size, () if self.held is None else tuple(system.scene.inputs))
        budget = max(1, int(BUDGET * min(1.0, BUDGET_WORK / (max(1, system.n_v) ** 2 * method.evaluations))))
        return MethodOnSystem(layout, method_state, budget, steps_per_check(method.evaluations), method.order)

    def _initial_method_state(self) -> tuple[np.ndarray | None, int]:
        """Initial method state, the accelerations where None, and its size."""
        method = self.problem.method
        size_of = getattr(method, "state_size", None)
        if size_of is None or (isinstance(method, ExplicitPair) and self.drift.partitioned):
            return None, self.system.n_v if isinstance(method, FixedStep) and method.starts_from_accelerations else 0
        size = size_of(self.system)
        return np.zeros(size), size

    def _loop_of(self, kind: Hashable, make: Callable[[], Loop]) -> Loop:
        """Step loop of a kind, cached."""
        self.kind, self.loop = kind, cached_on_disk(self.system, (Loop, kind, self.key), make, *self._beside())
        return self.loop

    def _beside(self) -> tuple:
        """Further content that the step loop depends on."""
        return ()

    def _on_demand(self, what: tuple, make: Callable):
        return self.system.mechanics.on_demand((*what, self.key), make)

    def _begin(self, point: np.ndarray, checked: np.ndarray):
        """Start from a compiled point if it passes the check or is confirmed, else from a certified one."""
        control, (*_, kinetic, potential, total, magnitude) = self.control, checked.tolist()
        control.kinetic, control.magnitude, control.initial = kinetic, magnitude, total
        control.lowest = control.highest = potential
        right = self._is_enough(checked) or self._certified_error(point) <= ACCELERATION_TOLERANCE
        self.point = point.copy() if right else self._certified_start()
        self.confirmed = self.point.copy()
        begins = self.samples is None or self.samples[0] == self.start.t
        self.rows = [self._row()] if begins else []

    def _row(self) -> np.ndarray:
        """Present time, state and work as one row of the trajectory."""
        return self.point[None, : self.layout.row].copy()

    def evaluated(self, state: State) -> Rates:
        """Rates by machine code."""
        found = self.loop.evaluate("rates", np.concatenate([[state.t], state.q, state.v, self.inputs]))
        n_v = self.system.n_v
        return Rates(found[:n_v], found[n_v : n_v + 3])

    def _pack(self, point: Point) -> np.ndarray:
        """Vector of a point with the present inputs."""
        return self.layout.pack(point, self.inputs)

    def _hold(self, k: int):
        """Set the inputs of the sample k of the control law, at the present point."""
        assert self.held is not None
        point, n_q, n_v = self.point, 1 + self.layout.n_q, self.layout.n_v
        self.inputs = self.held.at(k, point.item(0), point[1:n_q].copy(), point[n_q : n_q + n_v].copy())
        point[-len(self.inputs) :] = self.inputs

    def _certified_rates(self, state: State, inputs: np.ndarray) -> Rates:
        """Rates by the certified recursion; the power of the inputs is counted."""
        if self.input_forces is None:
            return self.certified.rates(self.system, state)
        load = self.input_forces.forces(inputs, state)
        found = self.certified.rates(self.system, state, load)
        return found._replace(power=found.power + np.array([load @ state.v, 0.0, 0.0]))

    def _certified_start(self) -> np.ndarray:
        rates = self._certified_rates(self.start, self.inputs)
        return self._pack(Point(self.start, np.zeros(3), rates, self.method_state))

    def _jumped(self, after: float) -> AfterJump | None:
        """Impact at a switching time, after which the motion continues; None if no prescribed velocity jumps."""
        if not self.switching.jumps.within(self.point[0], after):
            return None
        point = self.layout.point(self.point)
        found = crossed(self.switching.jumps, point.state, point.work, after)
        if found is not None:
            self.events.append(found.event)
            confirmed = self.confirmed[0] == self.point[0]
            rates = self.evaluated(found.state)
            self.point = self._pack(Point(found.state, found.work, rates, self.method_state))
            self.confirmed = self.point.copy() if confirmed else self.confirmed
        return found

    def _drive(self, advance: Callable[[], None], out: np.ndarray):
        """Call the loop until it stops, and collect its rows."""
        control, bar, began = self.control, None, time.perf_counter()
        try:
            control.status = LoopStatus.PAUSED
            while control.status == LoopStatus.PAUSED:
                control.rows = 0.0
                advance()
                self._gather(out)
                if control.status == LoopStatus.PAUSED:  # longer motions than most
                    bar = bar or Progress(self.end - self.start.t, self.problem.progress, began=began)
                    bar.update(self.point[0] - self.start.t)
            if control.status == LoopStatus.DONE and not self._is_confirmed():
                control.status, self.confirmed = LoopStatus.UNCONFIRMED, self._certified_start()
            if control.status in UNTRUSTED:
                self._forget_unconfirmed()
        except KeyboardInterrupt as error:  # stays a KeyboardInterrupt: no handler of errors may swallow it
            self._gather(out)
            error.trajectory = self.trajectory()  # type: ignore[attr-defined]  # documented: Ctrl-C keeps the motion so far
            raise
        except GaussError as error:  # of a law
            found = getattr(error, "trajectory", None)
            if found is None:
                self._gather(out)
                found = self.trajectory()
            raise SimulationError(str(error), found) from error
        finally:
            if bar is not None:
                bar.close()

    def _forget_unconfirmed(self):
        """Keep the samples and events up to the last confirmed point."""
        self.rows = [rows[rows[:, 0] <= self.confirmed[0]] for rows in self.rows]
        self.events = [event for event in self.events if event.t <= self.confirmed[0]]

    def _gather(self, out: np.ndarray):
        """Keep the rows that the loop has written."""
        count, self.control.rows = int(self.control.rows), 0.0
        self.rows.append(out[:count].copy())

    def _is_confirmed(self) -> bool:
        """Whether the certified recursion confirms the accelerations at the end.

        It is used for large trees and systems with loop, coupling or relation constraints: at both ends of the first run of
        this machine code, which is noted on disk, and later where the check fails. Other systems are checked body by body in
        machine code, at their last point, too.
        """
        if self.checks_bodies:
            return True
        packed = self.point
        checked: Sequence | np.ndarray = (self.control.constraint_residual,)  # the error by which the loop decides
        if not self.drift.projects and self.system.closes:  # off the constraints, accelerations are not unique
            point = self.layout.point(packed)
            state = project(self.system, point.state)
            packed = self._pack(Point(state, point.work, self.evaluated(state), point.method_state))
            checked = self.loop.evaluate("check", packed)
        if self._is_enough(checked):
            return True
        error = self._certified_error(packed)
        self.control.worst = max(self.control.worst, error)
        if error <= ACCELERATION_TOLERANCE:
            self._certified_loops()[self.kind] = True
            note_on_disk(self.system, (CompiledRun, self.kind, self.key), *self._beside())
        return error <= ACCELERATION_TOLERANCE

    def _certified_error(self, packed: np.ndarray) -> float:
        """Relative error of the accelerations of a point, by the certified recursion."""
        point = self.layout.point(packed)
        inputs = packed[self.layout.size - self.inputs.size :]
        exact = self._certified_rates(point.state, inputs).acceleration
        return relative_error(self.system, point.rates.acceleration, exact, point.state.v)

    def _is_enough(self, checked) -> bool:
        """Whether the check in machine code suffices to confirm accelerations.

        With inconsistent redundant constraints their residual decides, for no change of accelerations removes it.
        """
        known = self.checks_bodies or self._is_certified()
        return known and all(error <= ACCELERATION_TOLERANCE for error in checked[:CHECK_ERRORS])

    def _is_certified(self) -> bool:
        """Whether this kind of step loop was confirmed at both ends of a run, of this process or another one."""
        found = self._certified_loops()
        if self.kind not in found:
            found[self.kind] = is_noted_on_disk(self.system, (CompiledRun, self.kind, self.key), *self._beside())
        return found[self.kind]

    def _certified_loops(self) -> dict[Hashable, bool]:
        """Whether kinds of step loops were confirmed."""
        return self._on_demand((dict,), dict)

    def finished(self, fallback: Callable[[State, np.ndarray | None], Trajectory]) -> Trajectory:
        """Trajectory, continued by ``fallback(start, samples)`` where the loop has stopped early.

        Raises
        ------
        SimulationError
            If the motion cannot continue; its ``trajectory`` holds the motion so far.
        """
        if self.control.status == LoopStatus.DONE:
            return self.trajectory()
        from gauss.simulation.continued_run import continued

        return continued(self, fallback)

    def trajectory(self) -> Trajectory:
        """Motion so far."""
        control, n_q, n_v, engine = self.control, self.layout.n_q, self.layout.n_v, vars(self).get("certified")
        asked, worst = (0, 0.0) if engine is None else (engine.evaluations, engine.error)
        rows = np.concatenate(self.rows) if self.rows else np.zeros((0, self.layout.row))
        q, v, work = rows[:, 1 : 1 + n_q], rows[:, 1 + n_q : 1 + n_q + n_v], rows[:, 1 + n_q + n_v :]
        stats = Stats(
            int(control.evaluations) + asked,
            int(control.steps),
            int(control.rejected),
            int(control.factorisations),
            time.perf_counter() - self.began,
            max(control.worst, worst),
            f"compiled recursion and integrator, checked every {int(control.every)} steps by inverse dynamics",
            unseen=int(control.unseen),
        )
        energies = EnergyRecord(*recorded_energies(control))
        return Trajectory(self.system, rows[:, 0], q, v, work, stats, tuple(self.events), energies=energies)
