"""Motions that are stepped together by a compiled loop: shared among threads, and stopped by Ctrl-C."""

import os
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np

from gauss.codegen.kernels import WORST_RECORD, BatchSpan, FixedStepBatchLoop
from gauss.simulation.compiled_run import CHECKING
from gauss.simulation.trajectory import EnergyRecord

BUDGET = 4096  # steps of vectors of motions between two looks of Python: a few milliseconds
SHARES = 4  # of the work for each thread: one that is held up does not hold up the others


class Batch:
    """Points of many motions; each is a column, and the last is repeated to fill a vector of them.

    Parameters
    ----------
    loop : FixedStepBatchLoop
        What steps them.
    starts : ndarray, shape (n_q + n_v, batch)
        Where they start, at t = 0.
    parameters : ndarray, shape (n, batch), optional
        Parameters of each motion, if the system has any.
    """

    def __init__(self, loop: FixedStepBatchLoop, starts: np.ndarray, parameters: np.ndarray | None = None):
        self.loop, self.size = loop, starts.shape[1]
        filled = self._filled(starts)
        self.columns = filled.shape[1]
        self.points = np.zeros((loop.method.size, self.columns))
        self.points[1 : 1 + len(filled)] = filled
        if parameters is not None:
            self.points[loop.method.size - len(parameters) :] = self._filled(parameters)
        self.worst = np.zeros((len(WORST_RECORD), self.columns))
        loop(
            BatchSpan(columns=self.columns, rows=0, begin=0, end=self.columns), self.points, self.worst, np.zeros((0, 0, 0))
        )

    def _filled(self, columns: np.ndarray) -> np.ndarray:
        return np.pad(columns, ((0, 0), (0, -self.size % self.loop.width)), mode="edge")

    @property
    def error(self) -> np.ndarray:
        """Largest error of the accelerations so far, relative to the largest of them."""
        return self.worst[0, : self.size]

    @property
    def gap(self) -> np.ndarray:
        """Largest gap so far."""
        return self.worst[1, : self.size]

    @property
    def unseen(self) -> np.ndarray:
        """Above 0 where a step may have passed a condition of a law unseen."""
        return self.worst[2, : self.size]

    @property
    def looked(self) -> EnergyRecord:
        """Energies (batch,) so far."""
        return EnergyRecord(*self.worst[3:, : self.size])

    @property
    def reached(self) -> np.ndarray:
        """States (n_q + n_v, batch) so far."""
        return self.points[self.loop.written, : self.size]

    def run(self, steps: int, h: float, keep: int, threads: int) -> np.ndarray:
        """Make these steps; states (batch, k, n_q + n_v) at the start and after every so many steps that are kept."""
        rows = np.empty((self.columns, steps // keep + 1, self.loop.written.stop - self.loop.written.start))
        rows[:, 0] = self.points[self.loop.written].T
        strips = self.columns // self.loop.width
        share = max(1, min(BUDGET // steps, strips // (SHARES * threads))) * self.loop.width
        every, stopped = max(1, round(CHECKING / self.loop.method.evaluations)), Event()

        def work(begin: int):
            end = min(begin + share, self.columns)
            for first in range(0, steps, BUDGET):
                if stopped.is_set():
                    return
                part = {"begin": begin, "end": end, "first": first, "last": min(first + BUDGET, steps)}
                span = BatchSpan(columns=self.columns, rows=rows.shape[1], h=h, keep=keep, every=every, **part)
                self.loop(span, self.points, self.worst, rows)

        shared(work, range(0, self.columns, share), threads, stopped)
        return rows[: self.size]


def shared(work, items, threads: int, stopped: Event):
    """Do the work of all items, by several threads; whatever ends one of them tells the others to stop."""
    if threads == 1:
        for item in items:
            work(item)
        return

    def watched(item):
        try:
            work(item)
        except BaseException:
            stopped.set()
            raise

    with ThreadPoolExecutor(threads) as pool:
        try:
            list(pool.map(watched, items))
        finally:
            stopped.set()


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
