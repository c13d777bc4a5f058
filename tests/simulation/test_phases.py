"""Phases between events: their machine code is made when it pays, is kept, and moves them as numpy does."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.engines import tiering
from gauss.simulation.phases import phase

pytestmark = pytest.mark.slow

TIGHT = {"rtol": 1e-9, "atol": 1e-9, "progress": False}
SAME = 1e-8  # of two motions with that tolerance


def _stops():
    return gauss.load("double_pendulum_stops"), 1.0


def _stopped_gears():
    scene = gauss.load("gear_pair")
    scene.stop(next(iter(scene.joints)), highest=0.4, restitution=0.5)
    return scene, 0.5


@pytest.mark.parametrize("make", [_stops, _stopped_gears])
def test_a_second_motion_is_compiled_from_the_start_and_the_same(make, monkeypatch):
    scene, end = make()
    system = gauss.compile_scene(scene)
    monkeypatch.setattr(tiering, "LEAST_THRESHOLD", np.inf)
    slow = gauss.simulate(system, end, times=[end], **TIGHT)
    monkeypatch.setattr(tiering, "LEAST_THRESHOLD", 0)
    gauss.simulate(system, end, times=[end], **TIGHT)
    monkeypatch.setattr(tiering, "LEAST_THRESHOLD", np.inf)
    monkeypatch.setattr(phase, "build", None)  # nothing is made anew
    fast = gauss.simulate(system, end, times=[end], **TIGHT)
    assert "0 of them compiled" in slow.stats.method
    assert "0 of them compiled" not in fast.stats.method
    assert [event.kind for event in fast.events] == [event.kind for event in slow.events]
    assert fast.q == pytest.approx(slow.q, abs=SAME)
    assert fast.v == pytest.approx(slow.v, abs=SAME)
    assert fast.work == pytest.approx(slow.work, abs=SAME)


def test_each_motion_counts_its_own_evaluations():
    scene, end = _stops()
    system = gauss.compile_scene(scene)
    counts = [gauss.simulate(system, end, times=[end], **TIGHT).stats.evaluations for _ in range(2)]
    assert counts[1] == pytest.approx(counts[0], rel=0.05)  # machine code differs by rounding, and so may its steps
