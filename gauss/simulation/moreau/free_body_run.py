"""Moreau–Jean time stepping of free bodies with many contacts; each step is :mod:`gauss.dynamics.contact.free_body_step`."""

from dataclasses import replace

import numpy as np

from gauss.dynamics.contact.free_body_step import free_body_stepper
from gauss.dynamics.engines import Engine
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Point, Rates
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING, in_words
from gauss.simulation.problem import Problem
from gauss.simulation.python_run import PythonRun
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


class FreeBodyEngine(Engine):
    """Record of the steps of free bodies; there are no accelerations beside those of whole steps."""

    name = "free bodies, a kernel for each kind of pair of shapes"
    error = 0.0
    evaluations, rescued = 0, 0

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Refuse: contacts make accelerations of single states."""
        raise SimulationError("free bodies with contacts have accelerations over whole steps only.")

    def project(self, system: System, state: State) -> State:
        """State as it is: nothing closes loops."""
        return state

    def check(self, point: Point, last: bool = False):
        """Nothing to check: the residual of the contact laws is that of each step."""


class FreeBodyRun(PythonRun):
    """One motion of free bodies with contacts.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    """

    def __init__(self, problem: Problem):
        self.engine, system = FreeBodyEngine(), problem.system
        super().__init__(system, TIME_STEPPING, self.engine, None, problem.step, problem.end, switching=problem.switching)
        self.stepper = free_body_stepper(problem.system)
        self.largest, self.relaxed = 0.0, 0
        self.h = problem.step or 0.0  # a fixed step is always given

    def collect(self, start: State, samples, progress: bool) -> Trajectory:
        """Trajectory to the end, from a start without penetration."""
        self.stepper.forget()
        self.stepper.refuse_penetration(start)
        return super().collect(start, samples, progress)

    def _first(self, start: State) -> Point:
        return Point(start, np.zeros(self.powers), Rates(np.zeros(self.system.n_v), np.zeros(self.powers)))

    def _advance(self, method: FixedStep, point: Point, t: float) -> Point:
        return self._stepped(point, t)

    def _stepped(self, point: Point, t: float) -> Point:
        found = self.stepper.step(point.state, t - point.state.t)
        self.engine.evaluations += 1
        self.largest, self.relaxed = max(self.largest, found.error or 0.0), self.relaxed + (found.error is None)
        work = point.work + np.array([0.0, 0.0, (t - point.state.t) * found.dissipated])
        return Point(State(t, found.q, found.v), work, point.rates)

    def _off_grid(self, method: FixedStep, begin: Point, t: float) -> tuple[State, np.ndarray]:
        known = self.stepper.known
        reached = self._stepped(begin, t)
        self.stepper.known = known
        return reached.state, reached.work

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        whole = super()._trajectory(kept, samples, began)
        method = in_words(self.h, self.largest, self.relaxed, whole.stats.method)
        return replace(whole, stats=whole.stats._replace(method=method), step=self.step)
