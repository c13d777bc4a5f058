"""Fixed-step batch on devices: all motions at once, in parts that fit into their memory."""

import numpy as np

from gauss.codegen.gpu.batches import DeviceFixedStepLoop
from gauss.codegen.kernels import BatchSpan
from gauss.simulation.batch.fixed_step_batch import FixedStepBatch
from gauss.simulation.step_limits import BUDGET, steps_per_check


class DeviceFixedStepBatch(FixedStepBatch):
    """Points of a batch of motions; see :class:`FixedStepBatch`."""

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
