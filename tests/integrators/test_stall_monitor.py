"""IDA is stopped where its steps shrink without end, and never for the length of a motion."""

import numpy as np
import pytest

from gauss.integrators.libraries import STALL_WINDOW, _StallMonitor

END = 1.0


def _reached(pace) -> float:
    """Time at which a run is stopped, or the end; ``pace`` is the progress in a window of evaluations, from a time."""
    monitor, t = _StallMonitor(0.0, END), 0.0
    for _ in range(100_000):
        t += pace(t)
        monitor.calls += STALL_WINDOW - 1  # the other evaluations of the window
        if t >= END or monitor.stalls(t):
            break
    return min(t, END)


PACES = {
    "long and even": (lambda t: 1e-4, END),
    "a hundred times slower in the middle": (lambda t: 1e-5 + 1e-12 if 0.4 < t < 0.41 else 1e-3, END),
    "shrinking steps": (lambda t: 0.5 * (0.7 - t), 0.7),
    "from the start": (lambda t: 1e-9, 0.0),
}


@pytest.mark.parametrize("name", PACES)
def test_what_goes_on_is_left_alone_and_what_stalls_is_stopped(name):
    pace, expected = PACES[name]
    np.testing.assert_allclose(_reached(pace), expected, atol=1e-2)
