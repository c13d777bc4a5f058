"""Fixed-step batch on a device: all motions at once, in parts that fit into its memory."""

import numpy as np

from gauss.codegen.gpu.batches import DeviceFixedStepLoop
from gauss.codegen.kernels import BatchSpan
from gauss.errors import DeviceError
from gauss.simulation.batch.fixed_step_batch import FixedStepBatch
from gauss.simulation.step_limits import BUDGET, steps_per_check

SHARE_OF_MEMORY = 0.8  # of the free memory of a device: its driver needs some for the frames of threads


class DeviceFixedStepBatch(FixedStepBatch):
    """Points of a batch of motions; see :class:`FixedStepBatch`."""

    def run(
        self, steps: int, h: float, keep: int, threads: int, control: np.ndarray | None = None, with_work: bool = False
    ) -> np.ndarray:
        """States (batch, k, n_q + n_v) at the start and after every ``keep`` steps; ``threads`` has no meaning.

        Raises
        ------
        DeviceError
            If one motion alone does not fit into the memory of the device.
        """
        loop = self.loop
        assert isinstance(loop, DeviceFixedStepLoop)
        sample = loop.written if with_work else self.states
        rows = np.empty((self.columns, steps // keep + 1, sample.stop - sample.start))
        rows[:, 0] = self.points[sample].T
        changes, inputs = (1, 0) if control is None else control.shape[1:]
        of_one = 8 * (len(self.points) + len(self.worst) + rows[0].size + changes * inputs)
        part = int(SHARE_OF_MEMORY * loop.device.free_bytes() / of_one)
        if not part:
            raise DeviceError(
                f"device {loop.device_name!r}: a motion with its samples needs {of_one / 1e6:.4g} MB, and "
                f"{loop.device.free_bytes() / 1e6:.4g} MB are free. Take fewer samples, by every=."
            )
        sizes = {"rows": rows.shape[1], "row": rows.shape[2]}
        settings = {"h": h, "keep": keep, "every": steps_per_check(loop.evaluations)} | sizes
        for begin in range(0, self.columns, part):
            some = slice(begin, min(begin + part, self.columns))
            count = some.stop - some.start
            arrays = [self.points[:, some], self.worst[:, some], rows[some], *([] if control is None else [control[some]])]
            held = [loop.device.put(array) for array in arrays]
            more = {} if control is None else {"hold": steps // changes, "motions": count, "changes": changes}
            for first in range(0, steps, BUDGET):
                last = min(first + BUDGET, steps)
                span = BatchSpan(columns=count, begin=0, end=count, first=first, last=last, **settings, **more)
                loop.steps(span, held)
            self.points[:, some], self.worst[:, some], rows[some] = (array.numpy() for array in held[:3])
        return rows[: self.size]
