"""Motions whose steps are their own, side by side: lanes of vector registers, a queue of starts, threads that share it."""

from dataclasses import dataclass
from threading import Event

import numpy as np

from gauss.codegen import Kernel, write
from gauss.codegen.kernels import (
    ENERGY_RECORD,
    MOTION_RECORD,
    AdaptiveBatchLoop,
    LoopStatus,
    MotionQueue,
    initial_energy_record,
    updated_energy_record,
)
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.dynamics.traced_system import Program
from gauss.integrators import ExplicitPair, Tolerance
from gauss.simulation.batch.fixed_step_batch import SHARES, shared
from gauss.simulation.compiled_run import BUDGET, CHECKED, CHECKING
from gauss.simulation.compiled_steps.loop_functions import adaptive, beginning
from gauss.simulation.python_run import SHORTEST, SMALLEST_STEP
from gauss.simulation.trajectory import EnergyRecord


class Streaming:
    """Machine code of one system and method.

    Parameters
    ----------
    program : Program
        The system; its memory is what rounding takes from compensated sums.
    method : ExplicitPair
        The method.
    shares : ndarray, optional
        Of the tolerance, see :class:`gauss.integrators.Tolerance`.
    """

    def __init__(self, program: Program, method: ExplicitPair, shares=None):
        self.method, self.layout = method, program.layout
        self.states = slice(1, 1 + self.layout.n_q + self.layout.n_v)
        functions = adaptive(program, method, many=True, shares=shares)

        def start(x, rtol, atol, atol_rates):
            state = self.layout.point(x).state
            point, h = beginning(program, method, state, Tolerance(rtol[0], atol[0], atol_rates[0], shares))
            packed = self.layout.pack(point)
            return packed, [h, program.residual(state)], program.energies(packed)

        self.start = Kernel(write(start, self.layout.size, 1, 1, 1, name="start"))
        self.check = Kernel(functions.check)
        self.stream = AdaptiveBatchLoop(functions, self.states)


@dataclass(frozen=True)
class Streamed:
    """What became of motions.

    Parameters
    ----------
    samples : ndarray, shape (batch, k, n_q + n_v)
        States.
    error : ndarray, shape (batch,)
        Largest error of the accelerations, relative to the largest of them; infinite where a motion was given up.
    steps, rejected : ndarray, shape (batch,)
        Steps.
    looked : EnergyRecord
        Energies (batch,).
    """

    samples: np.ndarray
    error: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray
    looked: EnergyRecord


class AdaptiveBatch:
    """Motions before they are made.

    Parameters
    ----------
    code : Streaming
        What steps them.
    starts : ndarray, shape (n_q + n_v, batch)
        Where they start, at t = 0.
    tolerance : Tolerance
        Local error allowed.
    parameters : ndarray, shape (n, batch), optional
        Parameters of each motion, if the system has any.

    Attributes
    ----------
    gap : ndarray, shape (batch,)
        By how much starts are off their constraints.
    """

    def __init__(self, code: Streaming, starts: np.ndarray, tolerance: Tolerance, parameters: np.ndarray | None = None):
        self.code, self.starts, self.tolerance, self.size = code, starts, tolerance, code.layout.size
        points = np.zeros((self.size + 3, starts.shape[1]))
        points[code.states] = starts
        if parameters is not None:
            points[self.size - len(parameters) : self.size] = parameters
        points[self.size :] = np.array([tolerance.rtol, tolerance.atol, tolerance.atol_rates])[:, None]
        self.points, (self.first, self.gap), look = np.split(self._by_lanes(code.start, points), [self.size, self.size + 2])
        self.begun = initial_energy_record(look)

    def _by_lanes(self, kernel: Kernel, columns: np.ndarray) -> np.ndarray:
        """Outputs for columns, none of them by code for one state: it may round otherwise."""
        count = columns.shape[1]
        return kernel(np.pad(columns, ((0, 0), (0, -count % self.code.stream.width)), mode="edge"))[:, :count]

    def run(self, times: np.ndarray, largest: float | None, threads: int, switching: Timetable = NO_TIMES) -> Streamed:
        """Make the motions until the last of the times, with steps no longer than ``largest``, stretch by stretch."""
        end, count = float(times[-1]), self.starts.shape[1]
        begun = int(np.searchsorted(times, 0.0, side="right"))
        grid = np.append(times, np.inf)
        out = np.empty((count, len(times), len(self.starts)))
        out[:, :begun] = self.starts.T[:, None]
        motions = np.zeros((self.size + len(MOTION_RECORD), count))
        record = dict(zip(MOTION_RECORD, motions[self.size :], strict=True))
        motions[: self.size] = self.points
        given = (("h", self.first), ("sample", begun), ("due", grid[begun]), *zip(ENERGY_RECORD, self.begun, strict=True))
        for name, values in given:
            record[name][:] = values
        settings = {
            "largest": end if largest is None else largest,
            "smallest": SMALLEST_STEP * end,
            "rtol": self.tolerance.rtol,
            "atol": self.tolerance.atol,
            "atol_rates": self.tolerance.atol_rates,
            "every": max(1, round(CHECKING / self.code.method.evaluations)),
        }
        for before, after in switching.stops(0.0, end):
            self._stretch(motions, grid, out, settings | {"end": before}, threads)
            if after > before:
                self._cross(motions, record["h"], before, after, SHORTEST * end)
        arrived = motions[0] >= end
        checked = self._by_lanes(self.code.check, motions[: self.size])
        error = np.maximum(record["worst"], checked[0])
        looked = EnergyRecord(
            *updated_energy_record([record[name] for name in ENERGY_RECORD], motions[0], checked[CHECKED:])
        )
        steps, rejected = (record[name].astype(int) for name in ("steps", "rejected"))
        return Streamed(out, np.where(arrived, error, np.inf), steps, rejected, looked)

    def _stretch(self, motions: np.ndarray, grid: np.ndarray, out: np.ndarray, settings: dict, threads: int):
        """Make all motions until the end that is set; all arrays are changed."""
        code, count = self.code, motions.shape[1]
        share = count if threads == 1 else max(code.stream.width, count // (SHARES * threads))
        chunks, stopped = iter(range(0, count, share)), Event()

        def work(_):
            queue, lanes = MotionQueue(columns=count, rows=len(grid) - 1, **settings), code.stream.lanes()
            while queue.status == LoopStatus.PAUSED and not stopped.is_set():
                if queue.following >= queue.last:
                    begin = next(chunks, count)
                    queue.following, queue.last, queue.more = begin, min(begin + share, count), float(begin < count)
                code.stream(queue, lanes, motions, grid, out, BUDGET)

        shared(work, range(threads), threads, stopped)

    def _cross(self, motions: np.ndarray, h: np.ndarray, before: float, after: float, shortest: float):
        """Take motions that have reached a switching time across it, with the rates there; the others end where they are."""
        here, row, size = motions[0] >= before, self.code.layout.row, self.size
        tolerance = [[self.tolerance.rtol], [self.tolerance.atol], [self.tolerance.atol_rates]]
        points = np.concatenate([motions[:size], np.repeat(tolerance, motions.shape[1], axis=1)])
        points[0] = after
        renewed = self._by_lanes(self.code.start, points)
        renewed[row - 3 : row] = motions[row - 3 : row]  # the work done so far
        motions[:size, here] = renewed[:size, here]
        h[:] = np.where(here, np.maximum(renewed[size], shortest), 0.0)
