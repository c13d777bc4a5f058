"""Adaptive batch: motions with steps of their own in the lanes of vector registers, refilled from a queue of starts."""

from dataclasses import dataclass
from threading import Event

import numpy as np

from gauss.codegen import Kernel, write
from gauss.codegen.gpu.batches import DeviceAdaptiveLoop, DeviceKernel
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
from gauss.simulation.batch.fixed_step_batch import CHUNKS_PER_THREAD, in_threads
from gauss.simulation.compiled_run import CHECK_ERRORS
from gauss.simulation.compiled_steps.explicit_stages import ExplicitStages
from gauss.simulation.compiled_steps.loop_functions import adaptive
from gauss.simulation.motion_records import EnergyRecord
from gauss.simulation.step_limits import BUDGET, LEAST_RESTART_STEP, SMALLEST_STEP, steps_per_check

# steps of a motion on a device before those that are not at their end are gathered: of 4096 double pendulums, with 230 to
# 1067 steps in 10 s, threads are busy for 95 % of the steps of a warp; with 200 for 84 %, where lanes are refilled for 86 %
DEVICE_BUDGET = 50


class AdaptiveBatchCode:
    """Machine code of one system, with its method state, and one method, on a device or this CPU.

    ``shares``: see :class:`gauss.integrators.Tolerance`.
    """

    loop: AdaptiveBatchLoop | DeviceAdaptiveLoop
    start: Kernel | DeviceKernel
    check: Kernel | DeviceKernel

    def __init__(self, program: Program, method: ExplicitPair, shares=None, device: str | None = None):
        self.evaluations, self.layout = method.evaluations, program.layout
        self.states, written = slice(1, 1 + self.layout.n_q + self.layout.n_v), slice(1, self.layout.row)
        functions = adaptive(program, method, batch=True, shares=shares)

        first = ExplicitStages(program, method, batch=True, shares=shares).first(functions.check)

        def start(x, *tolerance):
            state, size = self.layout.state(x), self.layout.size
            parameters = x[size - len(self.layout.parameters) :]
            given = np.concatenate([[state.t], state.q, state.v, *tolerance, parameters])
            point, checked, h = np.split(x[0].graph.call(first, given), [size, -1])
            return point, h, [program.residual(state)], checked[CHECK_ERRORS:]

        begin = write(start, self.layout.size, 1, 1, 1, name="start")
        if device is None:
            self.start, self.check = Kernel(begin), Kernel(functions.check)
            self.loop = AdaptiveBatchLoop(functions, written)
        else:
            self.start, self.check = DeviceKernel(device, begin), DeviceKernel(device, functions.check)
            self.loop = DeviceAdaptiveLoop(device, functions, written)


@dataclass(frozen=True)
class AdaptiveBatchResult:
    """Trajectories of a batch."""

    samples: np.ndarray  # (batch, k, n_q + n_v + 3) states and work
    error: np.ndarray  # (batch,) largest error of the accelerations, relative to their largest; infinite where one failed
    steps: np.ndarray  # steps, rejected (batch,): accepted and rejected steps
    rejected: np.ndarray
    energies: EnergyRecord  # energies (batch,)


class AdaptiveBatch:
    """Batch of motions by an adaptive method, from initial states (n_q + n_v, batch) at t = 0.

    ``parameters`` (n, batch): those of each motion, of a parametrised system; ``residual`` (batch,): constraint residuals of
    the initial states, relative to the sizes of the constraints.
    """

    def __init__(
        self, code: AdaptiveBatchCode, starts: np.ndarray, tolerance: Tolerance, parameters: np.ndarray | None = None
    ):
        self.code, self.starts, self.tolerance, self.size = code, starts, tolerance, code.layout.size
        points = np.zeros((self.size + 3, starts.shape[1]))
        points[code.states] = starts
        if parameters is not None:
            points[self.size - len(parameters) : self.size] = parameters
        points[self.size :] = np.array([tolerance.rtol, tolerance.atol, tolerance.atol_rates])[:, None]
        self.points, (self.first, self.residual), look = np.split(
            self._by_lanes(code.start, points), [self.size, self.size + 2]
        )
        self.begun = initial_energy_record(look)

    def _by_lanes(self, kernel: Kernel | DeviceKernel, columns: np.ndarray) -> np.ndarray:
        """Outputs for columns, all of them by vector code: scalar code may round differently."""
        count = columns.shape[1]
        return kernel(np.pad(columns, ((0, 0), (0, -count % self.code.loop.width)), mode="edge"))[:, :count]

    def run(
        self, times: np.ndarray, largest: float | None, threads: int, switching: Timetable = NO_TIMES
    ) -> AdaptiveBatchResult:
        """Trajectories to the last of the times, with steps up to ``largest`` [s], from one switching time to the next.

        An interruption has the samples so far (batch, k, n_q + n_v + 3) as its ``samples``, NaN behind them.
        """
        end, count = switching.last_end(0.0, float(times[-1])), self.starts.shape[1]
        times = np.minimum(times, end)
        begun = int(np.searchsorted(times, 0.0, side="right"))
        grid = np.append(times, np.inf)
        row = self.code.layout.row
        out = np.empty((count, len(times), row - 1))
        out[:, :begun] = self.points[1:row].T[:, None]
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
            "every": steps_per_check(self.code.evaluations),
        }
        for before, after in switching.stops(0.0, end):
            try:
                self._until(motions, grid, out, settings | {"end": before}, threads)
            except KeyboardInterrupt as interruption:
                out[np.arange(len(times)) >= record["sample"][:, None]] = np.nan
                interruption.samples = out  # type: ignore[attr-defined]
                raise
            if after > before:
                self._cross(motions, record["h"], before, after, LEAST_RESTART_STEP * end)
        arrived = motions[0] >= end
        checked = self._by_lanes(self.code.check, motions[: self.size])
        error = np.maximum(record["worst"], checked[0])
        energies = EnergyRecord(
            *updated_energy_record([record[name] for name in ENERGY_RECORD], motions[0], checked[CHECK_ERRORS:])
        )
        steps, rejected = (record[name].astype(int) for name in ("steps", "rejected"))
        return AdaptiveBatchResult(out, np.where(arrived, error, np.inf), steps, rejected, energies)

    def _until(self, motions: np.ndarray, grid: np.ndarray, out: np.ndarray, settings: dict, threads: int):
        """Move all motions to the end in ``settings``; all arrays are changed."""
        loop, count = self.code.loop, motions.shape[1]
        if isinstance(loop, DeviceAdaptiveLoop):
            loop.until(MotionQueue(columns=count, rows=len(grid) - 1, **settings), motions, grid, out, DEVICE_BUDGET)
            return
        share = count if threads == 1 else max(loop.width, count // (CHUNKS_PER_THREAD * threads))
        chunks, stopped = iter(range(0, count, share)), Event()

        def work(_):
            queue, lanes = MotionQueue(columns=count, rows=len(grid) - 1, **settings), loop.lanes()
            try:
                while queue.status == LoopStatus.PAUSED and not stopped.is_set():
                    if queue.following >= queue.last:
                        begin = next(chunks, count)
                        queue.following, queue.last, queue.more = begin, min(begin + share, count), float(begin < count)
                    loop(queue, lanes, motions, grid, out, BUDGET)
            finally:  # motions under way where it is interrupted
                under_way = np.flatnonzero(lanes[-1] >= 0.0)
                motions[:, lanes[-1, under_way].astype(int)] = lanes[:-1, under_way]

        in_threads(work, range(threads), threads, stopped)

    def _cross(self, motions: np.ndarray, h: np.ndarray, before: float, after: float, shortest: float):
        """Continue motions that reached a switching time just after it, with the rates there; the others have failed."""
        here, row, size = motions[0] >= before, self.code.layout.row, self.size
        tolerance = [[self.tolerance.rtol], [self.tolerance.atol], [self.tolerance.atol_rates]]
        points = np.concatenate([motions[:size], np.repeat(tolerance, motions.shape[1], axis=1)])
        points[0] = after
        renewed = self._by_lanes(self.code.start, points)
        renewed[row - 3 : row] = motions[row - 3 : row]  # quadratures of work
        motions[:size, here] = renewed[:size, here]
        h[:] = np.where(here, np.maximum(renewed[size], shortest), 0.0)
