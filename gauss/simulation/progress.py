"""Progress bar of slow simulations, on a terminal."""

import time
from typing import Any

SLOW = 1.0  # a bar appears on runs longer than this [s]


class Progress:
    """Progress bar that appears on slow runs, in a terminal, where it may.

    The total is a duration [s], unless something else is counted; the run began at a time of :func:`time.perf_counter`, now
    when not given.
    """

    def __init__(self, total: float, shown: bool, counted: str = "s simulated", began: float | None = None):
        self.total, self.shown, self.counted = total, shown, counted
        self.bar: Any = None  # of tqdm
        self.began = time.perf_counter() if began is None else began

    def update(self, done: float):
        """Set the progress."""
        waited = time.perf_counter() - self.began
        if self.bar is None and self.shown and waited > SLOW:
            from tqdm import tqdm  # a slow import, for slow runs only

            form = "{l_bar}{bar}| {n:.5g}/{total:.5g} " + self.counted + " [{elapsed}<{remaining}]"
            self.bar = tqdm(total=self.total, unit="s", leave=False, disable=None, bar_format=form)
            self.bar.start_t = time.time() - waited
        if self.bar is not None:
            self.bar.update(done - self.bar.n)

    def close(self):
        """Remove the bar."""
        if self.bar is not None:
            self.bar.close()
