"""Moreau–Jean time stepping with many contacts, by kernels of pairs of shapes.

A step of bodies that move freely is :mod:`gauss.dynamics.contact.free_body_step`, one of mechanisms
:mod:`gauss.dynamics.contact.mechanism_step`.
"""

from dataclasses import replace

import numpy as np

from gauss.dynamics.contact.contact_stepper import contact_stepper
from gauss.dynamics.engines import Engine
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Point, Rates
from gauss.simulation.moreau.contact_warnings import ParadoxWarnings, warn_of_laws
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING, in_words
from gauss.simulation.problem import Problem
from gauss.simulation.python_run import PythonRun
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


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
        self.stepper, system = contact_stepper(problem.system), problem.system
        self.engine = PairKernelEngine(self.stepper)
        super().__init__(system, TIME_STEPPING, self.engine, None, problem.step, problem.end, switching=problem.switching)
        self.largest, self.relaxed, self.paradoxes = 0.0, 0, ParadoxWarnings()
        self.h = problem.step or 0.0  # a fixed step is always given

    def collect(self, start: State, samples, progress: bool) -> Trajectory:
        """Trajectory to the end, from a start without penetration."""
        self.stepper.forget()
        self.stepper.refuse_penetration(start)
        found = super().collect(start, samples, progress)
        warn_of_laws(self.largest, self.relaxed, self.steps)
        return found

    def _first(self, start: State) -> Point:
        self.stepper.check(start)
        return Point(start, np.zeros(self.powers), Rates(np.zeros(self.system.n_v), np.zeros(self.powers)))

    def _advance(self, method: FixedStep, point: Point, t: float) -> Point:
        reached = self._stepped(point, t)
        if t >= self.end:
            self.stepper.check(reached.state)
        return reached

    def _stepped(self, point: Point, t: float) -> Point:
        h = t - point.state.t
        found = self.stepper.step(point.state, h)
        self.engine.evaluations += 1
        self.largest, self.relaxed = max(self.largest, found.error or 0.0), self.relaxed + (found.error is None)
        self.paradoxes.warn(found.paradoxes, point.state.t)
        state = self.stepper.projected(State(t, found.q, found.v))
        return Point(state, point.work + h * found.power, point.rates)

    def _off_grid(self, method: FixedStep, begin: Point, t: float) -> tuple[State, np.ndarray]:
        known = self.stepper.known
        reached = self._stepped(begin, t)
        self.stepper.known = known
        return reached.state, reached.work

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        whole = super()._trajectory(kept, samples, began)
        method = in_words(self.h, self.largest, self.relaxed, whole.stats.method)
        return replace(whole, stats=whole.stats._replace(method=method), step=self.step)
