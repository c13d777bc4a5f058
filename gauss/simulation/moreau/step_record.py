"""Record of a motion in steps of error control: rows, events, statistics."""

import time
from dataclasses import replace

import numpy as np

from gauss.dynamics.contact.gap_laws import removal_time
from gauss.simulation.energy_balance import energy_record
from gauss.simulation.moreau.single_steps import ReachedPoint, SingleSteps
from gauss.simulation.motion_records import Event, Stats
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.undetected_switching import SPARSE_STEP

LOOKS = 6  # steps whose energies are looked at


class StepRecord:
    """What a motion has kept of its steps.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    steps : SingleSteps
        Its steps.

    Attributes
    ----------
    accepted, rejected, unseen : int
        Steps that were accepted, and rejected; those in which a law may have switched unseen.
    """

    def __init__(self, problem: Problem, steps: SingleSteps):
        self.problem, self.steps = problem, steps
        self.accepted = self.rejected = self.unseen = 0
        self.shortest, self.longest = np.inf, 0.0
        self.looked, self.between = list[np.ndarray](), 1  # rows of some steps, for the energy balance

    def begin(self, row: np.ndarray):
        """Begin with the row of the start."""
        samples, start = self.problem.samples, self.problem.start
        self.began, self.events = time.perf_counter(), list[Event]()
        self.rows = [row] if samples is None or samples[:1] == start.t else []
        self.waiting = [] if samples is None else [t for t in samples if t > start.t]

    def due(self, t: float) -> list[float]:
        """Times of samples up to the end of a step, which are no longer waited for; that of the step without samples."""
        if self.problem.samples is None:
            return [t]
        found = [at for at in self.waiting if at <= t]
        self.waiting = self.waiting[len(found) :]
        return found

    def keep(self, begin: ReachedPoint, found: ReachedPoint, rows: list[np.ndarray]):
        """Keep an accepted step, and the rows of its samples."""
        h = float(found.row[0] - begin.row[0])
        self.accepted, self.shortest, self.longest = self.accepted + 1, min(self.shortest, h), max(self.longest, h)
        self.events += found.events
        self.rows += rows
        if self.accepted % self.between == 0:
            self.looked.append(found.row)
        if len(self.looked) > 2 * LOOKS:  # every second one, spread over all steps
            self.looked, self.between = self.looked[1::2], 2 * self.between

    def trajectory(self) -> Trajectory:
        """Motion so far."""
        sparse = self.longest > SPARSE_STEP * (self.problem.end - self.problem.start.t)
        stats = Stats(
            3 * (self.accepted + self.rejected),
            self.accepted,
            self.rejected,
            0,
            time.perf_counter() - self.began,
            self.steps.acceleration_error,
            self._in_words(),
            unseen=self.unseen,
            opaque=", ".join(self.problem.switching.called) if sparse else "",
            law_error=self.steps.law_error,
        )
        step = float(np.sqrt(self.shortest * self.longest)) if self.accepted else None
        found = Trajectory(self.problem.system, *self._parts(self.rows), stats, tuple(self.events), step=step)
        found = replace(found, removal=removal_time(self.problem.system))
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
        steps = f"{self.shortest:.3g} to {self.longest:.3g} s by error control"
        return f"time stepping in steps of {steps}, laws of contact and friction met to {self.steps.law_error:.0e} relative"
