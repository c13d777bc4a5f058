"""Moreau–Jean time stepping with error control by step doubling (Hairer, Nørsett, Wanner I, II.4).

A step h and two steps h/2 are made from the same point. Their difference over 2ᵖ − 1 is the local error of the two, where p
is the order of the method; where the contact mode does not change, it is added to the two (Richardson extrapolation), which
raises the order by one. With an impact in a step the positions are off by up to h |Δv|, wherever in the step it is: such
steps become as short as the tolerance asks for, and end within it of the impact. No shape moves farther in a step than a
share of its thickness: none passes through another one unseen.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gauss.dynamics.conditions import smooth_question, smooth_system
from gauss.dynamics.laws.switching_times import COARSE
from gauss.dynamics.rules import Plan
from gauss.errors import GaussError, SimulationError
from gauss.simulation.energy_balance import energy_record
from gauss.simulation.moreau.called_run import CalledMoreauRun
from gauss.simulation.moreau.compiled_run import CompiledMoreauRun
from gauss.simulation.moreau.contact_warnings import warn_of_laws
from gauss.simulation.moreau.single_steps import CompiledSingleSteps, PairKernelSingleSteps, ReachedPoint, SingleSteps
from gauss.simulation.moreau.unseen_contacts import StepLimit
from gauss.simulation.problem import Problem
from gauss.simulation.progress import Progress
from gauss.simulation.trajectory import Event, Stats, Trajectory
from gauss.simulation.undetected_switching import SPARSE_STEP
from gauss.simulation.verify import differences
from gauss.system import State, System

FIRST = 1e-3  # of the scale of times of the scene: first step
SAFETY, SMALLEST_FACTOR, LARGEST_FACTOR = 0.9, 0.1, 4.0  # of the change of the step
LEAST = 1e-9  # of the scale of times: shorter steps are taken whatever their error, for gaps are rounded
MOST_UNMET = 1000  # steps of the least length in a row
LOOKS = 6  # steps whose energies are looked at
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
        self.problem, self.steps, self.rate_of = problem, steps, _rate_of_each_coordinate(system)
        self.closes = bool(smooth_system(system).closes)
        restores = any(one.restitution for one in system.scene.contacts.values())
        self.order = 1 if self.closes or restores else 2  # see MoreauStepper.shares
        self.least, self.limit = LEAST * system.scale.time, StepLimit(system)
        self.accepted = self.rejected = 0
        self.lengths = [np.inf, 0.0]
        self.looked, self.between = list[np.ndarray](), 1  # rows of some steps, for the energy balance

    def collect(self) -> Trajectory:
        """Trajectory to the end.

        Raises
        ------
        SimulationError
            If a step fails, or the tolerance cannot be met; its ``trajectory`` holds the motion so far.
        """
        p, self.began, self.events = self.problem, time.perf_counter(), list[Event]()
        here = self.steps.begun(p.start)
        self.rows = [here.row] if p.samples is None or p.samples[:1] == p.start.t else []
        self.waiting = [] if p.samples is None else [t for t in p.samples if t > p.start.t]
        stops = [p.start.t, *(after for _, after in p.switching.times.stops(p.start.t, p.end))]
        h, bar = FIRST * p.system.scale.time, Progress(p.end - p.start.t, p.progress)
        try:
            for begin, stop in pairwise(stops):
                h, here = self._to(here, begin, stop, h, bar)
        except GaussError as error:
            raise SimulationError(str(error), self._trajectory()) from error
        except KeyboardInterrupt as error:
            error.trajectory = self._trajectory()  # type: ignore[attr-defined]  # documented
            raise
        finally:
            bar.close()
        warn_of_laws(self.steps.law_error, self.steps.relaxed, self.accepted)
        return self._trajectory()

    def _to(self, here: ReachedPoint, t: float, stop: float, h: float, bar: Progress) -> tuple[float, ReachedPoint]:
        """Steps from one stop to the next; the step to go on with, and the point there."""
        longest, unmet = (stop - t) / COARSE, 0
        while t < stop:
            h = min(h, longest)
            end = stop if stop - t < h * (1.0 + TO_END) else t + h
            h = end - t
            found, error = self._doubled(here, end)
            change = SAFETY * max(error, 1e-12) ** (-1.0 / (self.order + 1))
            if error > 1.0 and h > self.least:
                self.rejected, h = self.rejected + 1, max(h * min(max(change, SMALLEST_FACTOR), 0.5), self.least)
                continue
            unmet = unmet + 1 if error > 1.0 else 0
            if unmet > MOST_UNMET:
                raise SimulationError(self._unmet(t))
            self._keep(here, found)
            here, t, h = found, end, h * min(max(change, SMALLEST_FACTOR), LARGEST_FACTOR)
            bar.update(t - self.problem.start.t)
        return h, here

    def _doubled(self, begin: ReachedPoint, t: float) -> tuple[ReachedPoint, float]:
        """Point at a time [s], and its error over the tolerance."""
        half = self.steps.after(begin, 0.5 * (begin.row[0] + t))
        found, whole = self.steps.after(half, t), self.steps.after(begin, t)
        events = half.events + found.events
        error = self._error(begin, whole, found, any(event.kind == "impact" for event in events + whole.events))
        error = max(error, self._unseen(begin, found))
        if not (events or whole.events or self.closes):
            found = self.steps.with_row(found, self._extrapolated(whole.row, found.row))
        return found._replace(events=events), error

    def _error(self, begin: ReachedPoint, whole: ReachedPoint, found: ReachedPoint, impact: bool) -> float:
        """Local error of two steps over the tolerance."""
        n_q, system = 1 + self.problem.system.n_q, self.problem.system
        (q, v), (q_whole, v_whole) = ((x.row[1:n_q], x.row[n_q:-3]) for x in (found, whole))
        allowed = self._allowed(q, v)
        share = 1.0 / (2.0**self.order - 1.0)
        apart = share * np.abs(differences(system, q_whole[None], q[None])[0]) / allowed[self.rate_of]
        if impact:  # a gap without restitution may close with a rate that depends on the step, which the next one stops
            rates = (found.row[0] - begin.row[0]) * np.abs(v - begin.row[n_q:-3]) / allowed[: system.n_v]
        else:
            rates = share * np.abs(v_whole - v) / allowed[system.n_v :]
        every = np.concatenate([apart, rates])
        return float(every.max(initial=0.0)) if np.isfinite(every).all() else np.inf

    def _unseen(self, begin: ReachedPoint, found: ReachedPoint) -> float:
        """Above 1 for steps in which a shape may pass through another one, and as steep as an error."""
        longest = min(self.limit.step(self._state(reached)) for reached in (begin, found))
        return float((found.row[0] - begin.row[0]) / longest) ** (self.order + 1)

    def _state(self, reached: ReachedPoint) -> State:
        n_q = 1 + self.problem.system.n_q
        return State(float(reached.row[0]), reached.row[1:n_q], reached.row[n_q:-3])

    def _allowed(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Tolerance (2 n_v,) of displacements and rates."""
        return self.problem.tolerance.scale(self.problem.system, State(0.0, q, v))

    def _extrapolated(self, whole: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Row with the local error of two steps removed."""
        row = two + (two - whole) / (2.0**self.order - 1.0)
        row[0] = two[0]
        for place in self.problem.system.quaternions.values():
            Q = row[1:][place]
            row[1:][place] = Q / np.linalg.norm(Q)
        return row

    def _keep(self, begin: ReachedPoint, found: ReachedPoint):
        """Keep an accepted step, and the samples within it."""
        h = float(found.row[0] - begin.row[0])
        self.accepted, self.lengths = self.accepted + 1, [min(self.lengths[0], h), max(self.lengths[1], h)]
        self._look(found.row)
        self.events += found.events
        if self.problem.samples is None:
            self.rows.append(found.row)
            return
        while self.waiting and self.waiting[0] <= found.row[0]:
            t = self.waiting.pop(0)
            self.rows.append(found.row if t == found.row[0] else self._doubled(begin, t)[0].row)

    def _look(self, row: np.ndarray):
        """Keep rows spread over the steps, at most twice :data:`LOOKS`."""
        if self.accepted % self.between == 0:
            self.looked.append(row)
        if len(self.looked) > 2 * LOOKS:
            self.looked, self.between = self.looked[1::2], 2 * self.between

    def _trajectory(self) -> Trajectory:
        sparse = self.lengths[1] > SPARSE_STEP * (self.problem.end - self.problem.start.t)
        stats = Stats(
            3 * (self.accepted + self.rejected),
            self.accepted,
            self.rejected,
            0,
            time.perf_counter() - self.began,
            self.steps.acceleration_error,
            self._in_words(),
            opaque=", ".join(self.problem.switching.called) if sparse else "",
        )
        step = float(np.sqrt(self.lengths[0] * self.lengths[1])) if self.accepted else self.least
        found = Trajectory(self.problem.system, *self._parts(self.rows), stats, tuple(self.events), step=step)
        if self.problem.samples is None or not self.looked:
            return found
        t, q, v, work = self._parts(self.looked)
        return replace(found, energies=energy_record(replace(found, t=t, q=q, v=v, work=work)))

    def _parts(self, rows: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Times, coordinates, rates and work of some rows."""
        n_q, n_v = self.problem.system.n_q, self.problem.system.n_v
        every = np.array(rows).reshape(len(rows), 4 + n_q + n_v)
        return every[:, 0], every[:, 1 : 1 + n_q], every[:, 1 + n_q : -3], every[:, -3:]

    def _in_words(self) -> str:
        steps = f"{self.lengths[0]:.3g} to {self.lengths[1]:.3g} s by error control"
        return f"time stepping in steps of {steps}, laws of contact and friction met to {self.steps.law_error:.0e} relative"

    def _unmet(self, t: float) -> str:
        return (
            f"t = {t:.6g} s: {MOST_UNMET} steps of {self.least:.3g} s do not meet rtol {self.problem.tolerance.rtol:g}; "
            "loosen it, or give a fixed step=."
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
        return ControlledMotion(problem, PairKernelSingleSteps(problem.system)).collect()
    make: Callable = CalledMoreauRun if plan.dynamics == "callbacks" else CompiledMoreauRun
    whole = problem._replace(step=problem.end - problem.start.t)  # steps that Python repeats have lengths of their own
    run = make(whole, smooth_question(problem.question).laws)
    return ControlledMotion(problem, CompiledSingleSteps(run)).collect()


def _rate_of_each_coordinate(system: System) -> np.ndarray:
    """Rate (n_q,) that goes with each coordinate; with the four of a quaternion the first of its angular velocity."""
    found = np.empty(system.n_q, dtype=int)
    for joint in system.joints:
        plain = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
        found[joint.q] = joint.v.start + np.minimum(np.arange(joint.pair.n_q), plain)
    return found
