"""Batch of motions with contacts of many pairs of shapes, or opaque laws: one simulator makes the steps of each, in turn."""

from typing import Any

import numpy as np

from gauss.codegen.kernels import WORST_RECORD
from gauss.dynamics.initial_states import constraint_residual
from gauss.errors import SimulationError
from gauss.simulation.batch.fixed_step_batch import BatchPoints
from gauss.simulation.simulator import Simulator
from gauss.simulation.simulator_state import SimulatorState
from gauss.system import State


class SimulatorsInTurn(BatchPoints):
    """Points of motions, one column each, in the form of :class:`gauss.simulation.batch.fixed_step_batch.FixedStepBatch`.

    Parameters
    ----------
    simulator : Simulator
        A simulator of these motions.
    starts : ndarray, shape (n_q + n_v, batch)
        Initial states, at t = 0.
    """

    def __init__(self, simulator: Simulator, starts: np.ndarray):
        self.simulator, self.size = simulator, starts.shape[1]
        self.states, self.worst = slice(1, 1 + len(starts)), np.zeros((len(WORST_RECORD), self.size))
        self.contacts: list[Any] = []
        self._reasons: dict[int, str] = {}
        points = []
        for k, start in enumerate(starts.T):
            state = State(0.0, *np.split(start, [simulator.system.n_q]))
            self.worst[1, k] = constraint_residual(simulator.system, state) if simulator.system.has_closures else 0.0
            simulator.reset(state)
            begun = simulator.snapshot()
            self.watched = begun.watched
            self.contacts.append(begun.contacts)
            points.append(np.frombuffer(begun.point))
        self.control, self.points = begun.control, np.array(points).T

    def kept(self) -> tuple:
        """What motions continue from."""
        return self.points, self.contacts, self.watched

    def keep(self, points: np.ndarray, contacts: list, watched: tuple):
        """Continue from what another batch of this form kept."""
        self.points[:], self.contacts, self.watched = points, list(contacts), watched

    def found_reasons(self) -> dict[int, str]:
        """Why motions could not continue since the last time, and forget it."""
        found, self._reasons = self._reasons, {}
        return found

    def take(self, chosen: np.ndarray, fresh: "SimulatorsInTurn"):
        """Continue some motions from the points of another batch."""
        self.points[:, chosen] = fresh.points
        for k, contacts in zip(chosen, fresh.contacts, strict=True):
            self.contacts[k] = contacts

    def advance(self, done: int, n: int, h: float, threads: int, control: np.ndarray | None = None):
        """Make n steps of length h [s] after the first ``done``, under inputs (batch, 1, n_u), without samples."""
        for k in np.flatnonzero(np.isfinite(self.reached).all(axis=0)):
            point, simulator = self.points[:, k].copy(), self.simulator
            point[0] = done * h
            state = SimulatorState(point.tobytes(), self.control, 0.0, done, self.contacts[k], watched=self.watched)
            simulator.restore(state)
            try:
                simulator.step(None if control is None else control[k, 0], n)
            except SimulationError as error:
                self.points[1:, k], self._reasons[int(k)] = np.nan, str(error)
                continue
            reached = simulator.snapshot()
            self.points[:, k], self.contacts[k] = np.frombuffer(reached.point), reached.contacts
            self.watched = reached.watched
