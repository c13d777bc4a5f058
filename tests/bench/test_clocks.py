"""Clocks of the comparison: cold and warm calls, limits of time."""

import time
from functools import partial

import pytest

from gauss.bench.clocks import FEWEST, ROUNDS, WALL_PER_CPU, timed
from gauss.bench.levels import LIMIT
from gauss.bench.worker import Worker

pytestmark = pytest.mark.slow


def computed(seconds: float):
    """Nothing, after so much CPU time [s]."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_clocks_run_a_cold_call_and_some_warm_ones():
    calls = []
    found, seconds = timed(lambda: calls.append(None), LIMIT)
    assert len(calls) == len(found) == len(seconds) == 1 + ROUNDS
    found, seconds = timed(lambda: computed(0.02), 0.01)
    assert len(seconds) == 1  # late already
    found, seconds = timed(lambda: computed(0.02), 0.01, compiles=True)
    assert len(seconds) == 2
    assert len(timed(lambda: computed(0.06), LIMIT)[1]) > FEWEST
    waits = timed(lambda: time.sleep(0.02), LIMIT)[1][0]
    assert 0.02 / WALL_PER_CPU <= waits < 0.02  # less than work, but not free


def test_a_call_that_takes_too_much_time_ends_with_its_process():
    """No setting of a library is needed, and the next call is answered by a new process."""
    with Worker() as worker:
        late = worker.call(timed, partial(computed, 10.0), 0.1, timeout=60.0)
        assert (late.outcome, late.value) == ("timed out", None) and "CPU time" in late.reason
        late = worker.call(timed, partial(time.sleep, 60.0), 0.02, timeout=60.0)
        assert (late.outcome, late.value) == ("timed out", None) and "wall time" in late.reason
        assert worker.call(timed, partial(computed, 0.01), 0.1, timeout=60.0).outcome == "answered"
