"""Moreau–Jean time stepping with error control by step doubling (Hairer, Nørsett, Wanner I, II.4).

A step h and two steps h/2 are made from the same point. Their difference over 2ᵖ − 1 is the local error of the two, where p
is the order of the method; where no gap is closed, it is added to the two (Richardson extrapolation), which raises the
order by one; closed gaps would open or penetrate by it. With an impact in a step the positions are off by up to h |Δv|,
wherever in the step it is: such steps become as short as the tolerance asks for, and end within it of the impact. No shape
moves farther in a step than a share of its thickness: none passes through another one unseen. Penetration is removed in a
time of the scene, however short the steps (:mod:`gauss.dynamics.contact.gap_laws`): within a step, the speed of removal
would depend on the step.
"""

from itertools import pairwise

import numpy as np

from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.contact.gap_laws import removal_time
from gauss.dynamics.laws.switching_functions import TRIES
from gauss.dynamics.laws.switching_times import COARSE
from gauss.dynamics.rules import Plan
from gauss.errors import GaussError, SimulationError
from gauss.integrators import Point, Rates
from gauss.simulation.drivers import moreau_run
from gauss.simulation.moreau.contact_warnings import warn_of_laws
from gauss.simulation.moreau.single_steps import CompiledSingleSteps, PairKernelSingleSteps, ReachedPoint, SingleSteps
from gauss.simulation.moreau.step_errors import FAILED, LocalError, RateJumps, StepErrors
from gauss.simulation.moreau.step_record import StepRecord
from gauss.simulation.moreau.unseen_contacts import step_limit
from gauss.simulation.problem import Problem
from gauss.simulation.progress import Progress
from gauss.simulation.trajectory import Trajectory

FIRST = 1e-3  # of the scale of times of the scene: first step
SAFETY, SMALLEST_FACTOR, LARGEST_FACTOR = 0.9, 0.1, 4.0  # of the change of the step
LEAST = 1e-9  # of the scale of times: shorter steps are not tried, for gaps are rounded
ROUNDED = 1.01  # of the least length: the difference of two times is rounded
HIDING = 8.0  # what counts as the error of a step in which a law may have switched unseen
TO_END = 1e-9  # of a step: a remainder up to the next stop that is added to it


class ControlledMotion:
    """One motion in steps that error control chooses.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    steps : SingleSteps
        Its steps.
    """

    def __init__(self, problem: Problem, steps: SingleSteps):
        system = problem.system
        self.problem, self.steps, self.errors = problem, steps, StepErrors(system, problem.tolerance, steps)
        self.closes = bool(smooth_system(system).closes)
        self.least, self.limit = LEAST * system.scale.time, step_limit(system)
        self.record = StepRecord(problem, steps)

    def collect(self) -> Trajectory:
        """Trajectory to the end.

        Raises
        ------
        SimulationError
            If a step fails, or the tolerance cannot be met; its ``trajectory`` holds the motion so far.
        """
        p, here = self.problem, self.steps.begun(self.problem.start)
        self.record.begin(here.row)
        stops = [p.start.t, *(after for _, after in p.switching.times.stops(p.start.t, p.end))]
        h, bar = FIRST * p.system.scale.time, Progress(p.end - p.start.t, p.progress)
        try:
            for begin, stop in pairwise(stops):
                h, here = self._to(here, begin, stop, h, bar)
        except GaussError as error:
            raise SimulationError(str(error), self.record.trajectory()) from error
        except KeyboardInterrupt as error:
            error.trajectory = self.record.trajectory()  # type: ignore[attr-defined]  # documented
            raise
        finally:
            bar.close()
        warn_of_laws(self.steps.law_error, self.steps.relaxed, self.record.accepted)
        return self.record.trajectory()

    def _to(self, here: ReachedPoint, t: float, stop: float, h: float, bar: Progress) -> tuple[float, ReachedPoint]:
        """Steps from one stop to the next; the step to go on with, and the point there."""
        coarse, refused = (stop - t) / COARSE, 0
        jumps = RateJumps()
        longest = self.limit.step(self.errors.state(here))
        while t < stop:
            h = min(h, coarse, longest)
            end = stop if stop - t < h * (1.0 + TO_END) else t + h
            h = end - t
            found, local, hides = self._tried(here, end)
            error = local.largest(jumps.shown(h, local) or h <= ROUNDED * self.least)
            error = max(error, HIDING) if hides and refused < TRIES else error
            limit = self.limit.step(self.errors.state(found)) if error <= 1.0 else np.inf
            error = max(error, (h / limit) ** (self.errors.order + 1))  # as steep as an error
            change = SAFETY * max(error, 1e-12) ** (-1.0 / (self.errors.order + 1))
            if error > 1.0 and h > ROUNDED * self.least:
                self.record.rejected, refused = self.record.rejected + 1, refused + 1
                h = max(h * min(max(change, SMALLEST_FACTOR), 0.5), self.least)
                continue
            if error > 1.0:
                raise SimulationError(self._unmet(t))
            samples = self.record.due(end)
            self.record.keep(here, found, [found.row if at == end else self._doubled(here, at)[0].row for at in samples])
            self.record.unseen, refused, jumps = self.record.unseen + hides, 0, RateJumps()
            longest, here, t, h = limit, found, end, h * min(max(change, SMALLEST_FACTOR), LARGEST_FACTOR)
            bar.update(t - self.problem.start.t)
        return h, here

    def _tried(self, here: ReachedPoint, end: float) -> tuple[ReachedPoint, LocalError, bool]:
        """Point at a time [s], its error, and whether laws may have switched unseen; a step that fails may be too long."""
        try:
            found, error = self._doubled(here, end)
            hides, switched = self._switched(here, found)
            error = error._replace(displacement=max(error.displacement, switched))
        except GaussError:
            if end - here.row[0] <= ROUNDED * self.least:
                raise
            return here, FAILED, False
        return found, error, hides

    def _doubled(self, begin: ReachedPoint, t: float) -> tuple[ReachedPoint, LocalError]:
        """Point at a time [s], and its error over the tolerance."""
        half = self.steps.after(begin, 0.5 * (begin.row[0] + t))
        found, whole = self.steps.after(half, t), self.steps.after(begin, t)
        events = half.events + found.events
        error = self.errors.of(begin, half, found, whole)
        smooth = not (events or whole.events or half.closed or found.closed or whole.closed)
        if smooth and not self.closes:
            found = self.steps.with_row(found, self._extrapolated(whole.row, found.row))
        return found._replace(events=events), error

    def _switched(self, begin: ReachedPoint, found: ReachedPoint) -> tuple[bool, float]:
        """Whether laws of the state may have switched in a step and back; the error of a jump of them, wherever it is."""
        system, h, states = self.problem.system, found.row[0] - begin.row[0], [self.errors.state(x) for x in (begin, found)]
        mean = Rates((states[1].v - states[0].v) / h, np.zeros(3))
        share, _, place = self.problem.switching.share(*(Point(state, np.zeros(3), mean) for state in states))
        error = 0.0
        if place < 1.0:
            before, after = (smooth_system(system).accelerations(state) for state in states)
            error = float((h * np.abs(after - before) / self.errors.allowed(states[1])[system.n_v :]).max())
        return share < 1.0, error

    def _extrapolated(self, whole: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Row with the local error of two steps removed."""
        row = two + (two - whole) / (2.0**self.errors.order - 1.0)
        row[0] = two[0]
        for place in self.problem.system.quaternions.values():
            Q = row[1:][place]
            row[1:][place] = Q / np.linalg.norm(Q)
        return row

    def _unmet(self, t: float) -> str:
        return (
            f"t = {t:.6g} s: a step of {self.least:.3g} s does not meet rtol {self.problem.tolerance.rtol:g}, for instance "
            "because of impacts that follow each other ever faster; give a fixed step=."
        )


def controlled_motion(problem: Problem, plan: Plan) -> Trajectory:
    """Motion of a problem without a step.

    Raises
    ------
    SimulationError
        If the steps are not in machine code, inputs are held, or a prescribed velocity may jump; if the motion fails.
    """
    if plan.dynamics == "certified":
        why = "; ".join(map(str, plan.rejected)) or "another backend is chosen"
        raise SimulationError(f"error control of time stepping needs machine code: {why}. Give a fixed step=.")
    if problem.held is not None or problem.switching.jumps:
        what = "a control law" if problem.held is not None else "a prescribed velocity that jumps"
        raise SimulationError(f"error control of time stepping does not take {what}; give a fixed step=.")
    if plan.dynamics == "pair kernels":
        return ControlledMotion(problem, PairKernelSingleSteps(problem)).collect()
    whole = problem._replace(step=problem.end - problem.start.t)  # steps that Python repeats have lengths of their own
    run = moreau_run(whole, removal_time(problem.system))
    return ControlledMotion(problem, CompiledSingleSteps(run)).collect()
