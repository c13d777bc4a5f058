"""Fixed-step batch: motions side by side in vector registers, by a compiled loop, in several threads; or on devices."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from threading import Event

import numpy as np

from gauss.codegen.gpu.batches import DeviceFixedStepLoop
from gauss.codegen.kernels import WORST_RECORD, BatchSpan, FixedStepBatchLoop
from gauss.simulation.motion_records import EnergyRecord
from gauss.simulation.step_limits import BUDGET, steps_per_check

NEVER = 2**52  # steps: beyond the end of any motion
CHUNKS_PER_THREAD = 4  # of the motions: a delayed thread does not delay the others


class BatchPoints:
    """Points of motions, one column each, of which the first ``size`` count, and their worst checks so far."""

    points: np.ndarray  # (m, columns)
    worst: np.ndarray  # (k, columns), as of WORST_RECORD
    states: slice  # of a point: coordinates and rates
    size: int

    @property
    def error(self) -> np.ndarray:
        """Largest error of the accelerations so far, relative to the largest of them."""
        return self.worst[0, : self.size]

    @property
    def residual(self) -> np.ndarray:
        """Largest constraint residual so far, relative to the sizes of the constraints."""
        return self.worst[1, : self.size]

    @property
    def unseen(self) -> np.ndarray:
        """Above 0 where a step may have passed a condition of a law undetected."""
        return self.worst[2, : self.size]

    @property
    def unsolved(self) -> np.ndarray:
        """Above 0 where the equations of a step were not solved."""
        return self.worst[3, : self.size]

    @property
    def reached(self) -> np.ndarray:
        """States (n_q + n_v, batch) so far, NaN of motions that cannot continue."""
        return self.points[self.states, : self.size]


class FixedStepBatch(BatchPoints):
    """Points of a batch of motions, one column each; the last one is repeated to fill a vector register.

    Initial states are (n_q + n_v, batch), at t = 0; ``parameters`` (n, batch) those of each motion, of a parametrised
    system.
    """

    def __init__(
        self, loop: FixedStepBatchLoop | DeviceFixedStepLoop, starts: np.ndarray, parameters: np.ndarray | None = None
    ):
        self.loop, self.size = loop, starts.shape[1]
        filled = self._filled(starts)
        self.columns = filled.shape[1]
        self.points = np.zeros((loop.size, self.columns))
        self.states = slice(1, 1 + len(starts))
        self.points[self.states] = filled
        if parameters is not None:
            self.points[loop.size - len(parameters) :] = self._filled(parameters)
        self.worst = np.zeros((len(WORST_RECORD), self.columns))
        none = np.zeros((0, 0, 0))
        span = BatchSpan(columns=self.columns, rows=0, begin=0, end=self.columns)
        loop(span, self.points, self.worst, none, *([none] if loop.inputs else []))

    def _filled(self, columns: np.ndarray) -> np.ndarray:
        return np.pad(columns, ((0, 0), (0, -self.size % self.loop.width)), mode="edge")

    @property
    def energies(self) -> EnergyRecord:
        """Energies (batch,) so far."""
        return EnergyRecord(*self.worst[WORST_RECORD.index("kinetic") :, : self.size])

    def kept(self) -> tuple:
        """What motions continue from."""
        return (self.points,)

    def keep(self, points: np.ndarray):
        """Continue from what another batch of this form kept."""
        self.points[:] = points

    def found_reasons(self) -> dict[int, str]:
        """Nothing: numbers of motions that diverge are not finite."""
        return {}

    def take(self, chosen: np.ndarray, fresh: "FixedStepBatch"):
        """Continue some motions from the points of another batch."""
        self.points[:, chosen] = fresh.points[:, : fresh.size]

    def advance(self, done: int, n: int, h: float, threads: int, control: np.ndarray | None = None):
        """Make n steps of length h [s] after the first ``done``, under inputs (batch, 1, n_u), without samples.

        An interruption leaves some motions behind; a single step is completed first.
        """
        given = [] if control is None else [control]
        held = {} if control is None else {"hold": NEVER, "motions": len(control), "changes": 1}
        strips = self.columns // self.loop.width
        share = -(-strips // (CHUNKS_PER_THREAD * threads) if threads > 1 else -strips) * self.loop.width
        every, none, stopped = steps_per_check(self.loop.evaluations), np.zeros((0, 0, 0)), Event()
        parts, last = range(0, self.columns, share), done + n

        def work(begin: int):
            for first in range(done, last, BUDGET):
                if stopped.is_set():
                    return
                part = {"begin": begin, "end": min(begin + share, self.columns), "first": first}
                part |= {"last": min(first + BUDGET, last)}
                span = BatchSpan(columns=self.columns, rows=0, h=h, keep=NEVER, every=every, **held, **part)
                self.loop(span, self.points, self.worst, none, *given)

        try:
            in_threads(work, parts, threads, stopped)
        except BaseException:
            stopped.clear()
            for begin in parts if n == 1 else ():
                if self.points[0, begin] < (done + 0.5) * h:
                    work(begin)
            raise

    def run(
        self, steps: int, h: float, keep: int, threads: int, control: np.ndarray | None = None, with_work: bool = False
    ) -> np.ndarray:
        """States (batch, k, n_q + n_v) at the start and after every ``keep`` steps of length h [s].

        On request the work of drives, of forces on bodies and of dampers (3,) follows a state.

        Rows of ``control`` (batch, rows, n_u) are held for equally many steps. An interruption has the samples so far as its
        ``samples``, NaN behind them.
        """
        given, held = [], {}
        if control is not None:
            given, (motions, changes, _) = [control], control.shape
            held = {"hold": steps // changes, "motions": motions, "changes": changes}
        sample = self.loop.written if with_work else self.states
        rows = np.empty((self.columns, steps // keep + 1, sample.stop - sample.start))
        rows[:, 0] = self.points[sample].T
        strips = self.columns // self.loop.width
        share = max(1, min(BUDGET // steps, strips // (CHUNKS_PER_THREAD * threads))) * self.loop.width
        every, stopped, made = steps_per_check(self.loop.evaluations), Event(), np.zeros(self.columns, dtype=int)

        def work(begin: int):
            end = min(begin + share, self.columns)
            for first in range(0, steps, BUDGET):
                if stopped.is_set():
                    return
                part = {"begin": begin, "end": end, "first": first, "last": min(first + BUDGET, steps)}
                sizes = {"columns": self.columns, "rows": rows.shape[1], "row": rows.shape[2]}
                span = BatchSpan(h=h, keep=keep, every=every, **sizes, **held, **part)
                self.loop(span, self.points, self.worst, rows, *given)
                made[begin:end] = part["last"]

        try:
            in_threads(work, range(0, self.columns, share), threads, stopped)
        except KeyboardInterrupt as error:
            rows[np.arange(rows.shape[1]) > made[:, None] // keep] = np.nan
            error.samples = rows[: self.size]  # type: ignore[attr-defined]
            raise
        return rows[: self.size]


class DeviceFixedStepBatch(FixedStepBatch):
    """Points of a batch of motions on devices: all at once, in parts that fit into their memory."""

    def run(
        self, steps: int, h: float, keep: int, threads: int, control: np.ndarray | None = None, with_work: bool = False
    ) -> np.ndarray:
        """States (batch, k, n_q + n_v) at the start and after every ``keep`` steps; ``threads`` has no meaning.

        DeviceError if one motion alone does not fit into the memory of the device.
        """
        loop = self.loop
        assert isinstance(loop, DeviceFixedStepLoop)
        sample = loop.written if with_work else self.states
        rows = np.empty((self.columns, steps // keep + 1, sample.stop - sample.start))
        rows[:, 0] = self.points[sample].T
        settings = {"h": h, "keep": keep, "every": steps_per_check(loop.evaluations), "columns": self.columns}
        settings |= {"rows": rows.shape[1], "row": rows.shape[2], "begin": 0, "end": self.columns}
        if control is not None:
            settings |= {"hold": steps // control.shape[1], "motions": len(control), "changes": control.shape[1]}
        spans = [
            BatchSpan(first=first, last=min(first + BUDGET, steps), **settings) for first in range(0, steps, BUDGET)
        ]  # a program is no longer than the driver allows on a GPU with a display
        loop.move(spans, self.points, self.worst, rows, *([] if control is None else [control]))
        return rows[: self.size]


def in_threads(work: Callable, items: Iterable, threads: int, stopped: Event):
    """Call ``work`` on all items, in several threads; an exception in one of them stops the others."""
    if threads == 1:
        for item in items:
            work(item)
        return

    def watched(item, run):
        try:
            run(work, item)
        except BaseException:
            stopped.set()
            raise

    with ThreadPoolExecutor(threads) as pool:
        try:
            every = list(items)
            list(pool.map(watched, every, [copy_context().run for _ in every]))  # the threads belong to the run
        finally:
            stopped.set()


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
