"""Moreau–Jean time stepping with many contacts, by kernels of pairs of shapes.

A step of bodies that move freely is :mod:`gauss.dynamics.contact.free_body_step`, one of mechanisms
:mod:`gauss.dynamics.contact.mechanism_step`.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from gauss.codegen.kernels import Due
from gauss.dynamics.contact.contact_stepper import stepper_pool
from gauss.dynamics.engines import Engine
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Point, Rates
from gauss.simulation.grid import grid_of, with_samples
from gauss.simulation.moreau.contact_motion import ContactMotion
from gauss.simulation.moreau.contact_warnings import warn_of_laws
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING, accepted_overlap, with_laws
from gauss.simulation.moreau.sleeping_motion import SleepingMotion
from gauss.simulation.moreau.unseen_contacts import warn_of_unseen_contacts
from gauss.simulation.problem import Problem
from gauss.simulation.python_run import PythonRun
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System

CHUNK = 512  # steps between two looks at the progress


class PairKernelEngine(Engine):
    """Record of the steps; there are no accelerations beside those of whole steps.

    Parameters
    ----------
    stepper : FreeBodyStepper or MechanismStepper
        Steps of the system.
    """

    name = "a kernel for each kind of pair of shapes"
    evaluations, rescued = 0, 0

    def __init__(self, stepper):
        self.stepper = stepper

    @property
    def error(self) -> float:
        """Largest relative error of accelerations found by a check."""
        return self.stepper.acceleration_error

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Refuse: contacts make accelerations of single states."""
        raise SimulationError("steps by kernels of pairs of shapes have accelerations over whole steps only.")

    def project(self, system: System, state: State) -> State:
        """State on the loop constraints."""
        return self.stepper.projected(state)

    def check(self, point: Point, last: bool = False):
        """Nothing to check: steps check their accelerations, and the residual of the contact laws is that of each step."""


class PairKernelRun(PythonRun):
    """One motion by kernels of pairs of shapes.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    """

    def __init__(self, problem: Problem):
        self.held, system, self.accepted = problem.held, problem.system, accepted_overlap(problem)
        sleeping, held = problem.sleeping, self.held is not None
        self.pool = stepper_pool(system, held)
        self.stepper = own = self.pool.take()
        self.motion = ContactMotion(system, held, own) if sleeping is None else SleepingMotion(system, sleeping, held, own)
        self.engine = PairKernelEngine(self.stepper)
        super().__init__(system, TIME_STEPPING, self.engine, None, problem.step, problem.end, switching=problem.switching)
        self.h = problem.step or 0.0  # a fixed step is always given

    def collect(self, start: State, samples, progress: bool) -> Trajectory:
        """Trajectory to the end, from a start without penetration; the run ends with it."""
        try:
            self.motion.begin(start)
            self.stepper.refuse_penetration(start, self.accepted)
            found = super().collect(start, samples, progress)
        finally:
            self.pool.give(self.stepper)
        warn_of_laws(self.motion.largest, self.motion.relaxed, self.steps)
        warn_of_unseen_contacts(found)
        return found

    def evaluate(self, state: State) -> Rates:
        """Zeros: contacts make accelerations of single states."""
        return Rates(np.zeros(self.system.n_v), np.zeros(self.powers))

    def _first(self, start: State) -> Point:
        self.stepper.check(start)
        return Point(start, np.zeros(self.powers), self.evaluate(start))

    def fixed(self, method: FixedStep, point: Point, samples) -> Iterator:
        """Points of fixed steps; samples between them are the ends of separate shorter steps."""
        pairs = grid_of(method, point.state.t, self.end, self.h, samples, self.switching)
        jumps = self._jumps(point.state.t)
        for before, after in jumps:
            pairs = pairs[(pairs[:, 0] <= before) | (pairs[:, 0] > after)]
        self.unseen = self.switching.times.unresolved(point.state.t, self.end, self.h)
        holds: dict[int, int] = {}
        if self.held is not None:
            pairs, holds = with_samples(pairs, self.held.times[1:], self.h, samples is None)
            holds[0] = 0
        impacts = {int(np.searchsorted(pairs[:, 0], before, side="right")): after for before, after in jumps}
        ends, stops = _divided(pairs, [*holds, *impacts])
        done = 0
        for place, stop in stops:
            jumped = self._jumped(point, impacts[place]) if place in impacts else None
            if jumped:
                point = jumped
                self.motion.jump(jumped.state, jumped.work)
                yield point, None
            if place in holds:
                self._hold(holds[place])
            while done < stop:
                begin = self.motion.kept()  # a step with samples inside is a part of its own
                for row in self.motion.advance(ends[done:stop]):
                    reached = self._point(row, point)
                    self.unseen += self.switching.share(point, reached)[0] < 1.0 or self.switching.oscillates(point, reached)
                    point, done, self.steps = reached, done + 1, self.steps + 1
                    if point.state.t >= self.end:
                        self.stepper.check(point.state)
                    yield point, lambda t, begin=begin: self.motion.beside(begin, t)

    def _jumps(self, begin: float) -> list[tuple[float, float]]:
        """Times just before and just after possible jumps of prescribed velocities [s]."""
        stops = self.switching.times.stops(begin, self.end)
        return [stop for stop in stops if self.switching.jumps.within(*stop)]

    def _hold(self, k: int):
        """Set the inputs of a sample of the control law, at the present state."""
        assert self.held is not None
        state = self.motion.state
        self.motion.hold(self.held.at(k, state.t, state.q.copy(), state.v.copy()))

    def _point(self, row: np.ndarray, before: Point) -> Point:
        n_q = self.system.n_q
        return Point(State(float(row[0]), row[1 : 1 + n_q].copy(), row[1 + n_q : -3].copy()), row[-3:].copy(), before.rates)

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        motion = self.motion
        self.engine.evaluations = motion.steps
        self.events = sorted([*self.events, *motion.events], key=lambda event: event.t)
        whole = super()._trajectory(kept, samples, began)
        stats = with_laws(whole.stats, self.h, motion.largest, motion.relaxed)
        return replace(whole, stats=stats._replace(sleep=motion.slept()), step=self.step)


def _divided(pairs: np.ndarray, changes: Iterable[int]) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Ends of all steps of a grid [s], and the parts that are made at once.

    A part ends where something changes, such as inputs, before and after a step that has samples inside, and after
    :data:`CHUNK` steps.
    It is given by the number of pairs before it, and the number of steps at its end.
    """
    is_step = pairs[:, 1] != Due.OFF_GRID_SAMPLE
    steps = np.cumsum(is_step)  # at the end of each pair
    goes_inside = np.diff(~is_step, prepend=False, append=False)  # changes between steps and samples inside one
    first, last = np.flatnonzero(goes_inside)[::2], np.minimum(np.flatnonzero(goes_inside)[1::2] + 1, len(pairs))
    cuts = {0, len(pairs), *first.tolist(), *last.tolist(), *changes, *range(0, len(pairs), CHUNK)}
    places = sorted(cuts)
    return pairs[is_step, 0], [(a, int(steps[b - 1])) for a, b in zip(places[:-1], places[1:], strict=True)]
