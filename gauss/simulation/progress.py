"""How far a simulation is, on a terminal."""

import time

SLOW = 1.0  # a bar appears on runs longer than this [s]


class Progress:
    """Bar that appears on slow runs, if a terminal is there to show it.

    Parameters
    ----------
    total : float
        What there is to do: time to simulate [s], unless something else is counted.
    shown : bool
        Whether there may be a bar.
    counted : str
        What is counted.
    """

    def __init__(self, total: float, shown: bool, counted: str = "s simulated"):
        self.total, self.shown, self.counted, self.bar = total, shown, counted, None
        self.began = time.perf_counter()

    def update(self, done: float):
        """Say how much has been done."""
        waited = time.perf_counter() - self.began
        if self.bar is None and self.shown and waited > SLOW:
            from tqdm import tqdm  # most runs are over before it would be imported

            form = "{l_bar}{bar}| {n:.5g}/{total:.5g} " + self.counted + " [{elapsed}<{remaining}]"
            self.bar = tqdm(total=self.total, unit="s", leave=False, disable=None, bar_format=form)
            self.bar.start_t = time.time() - waited
        if self.bar is not None:
            self.bar.update(done - self.bar.n)

    def close(self):
        """Take the bar away."""
        if self.bar is not None:
            self.bar.close()
