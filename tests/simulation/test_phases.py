"""Phases between events: their machine code moves them as numpy does, is kept, and every run gives the same digits."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gauss
from gauss.dynamics import conditions
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


def _box():
    return gauss.load("box_on_plane_4"), 0.2


def _friction():
    return gauss.load("friction_oscillator"), 1.0


@pytest.mark.parametrize("make", [_stops, _stopped_gears])
def test_machine_code_is_kept_and_moves_phases_as_numpy_does(make, monkeypatch):
    scene, end = make()
    system = gauss.compile_scene(scene)
    with monkeypatch.context() as numpy_alone:
        numpy_alone.setattr(conditions, "MOST_CLOSED_GAPS", -1)
        numpy_alone.setattr(tiering, "LEAST_THRESHOLD", np.inf)
        slow = gauss.simulate(system, end, times=[end], **TIGHT)
    gauss.simulate(system, end, times=[end], **TIGHT)
    monkeypatch.setattr(phase, "build", None)  # nothing is made anew
    fast = gauss.simulate(system, end, times=[end], **TIGHT)
    assert "0 of them compiled" in slow.stats.method
    assert "0 of them compiled" not in fast.stats.method
    assert [event.kind for event in fast.events] == [event.kind for event in slow.events]
    assert fast.q == pytest.approx(slow.q, abs=SAME)
    assert fast.v == pytest.approx(slow.v, abs=SAME)
    assert fast.work == pytest.approx(slow.work, abs=SAME)


@pytest.mark.parametrize("make", [_stops, _stopped_gears, _box, _friction])
@pytest.mark.parametrize("limits", [{}, {"MOST_CLOSED_GAPS": -1, "MOST_CONTACT_OPERATIONS": -1}], ids=["at once", "tiered"])
def test_every_run_gives_the_same_digits(make, limits, monkeypatch):
    """The first motion of a process, later ones, and those of several threads: what was compiled before is not seen."""
    for name, value in limits.items():
        monkeypatch.setattr(conditions, name, value)
    scene, end = make()
    system = gauss.compile_scene(scene)

    def move(_=None):
        motion = gauss.simulate(system, end, **TIGHT)
        return [part.tobytes() for part in (motion.t, motion.q, motion.v, motion.work)], motion.stats.evaluations

    first = move()
    with ThreadPoolExecutor(3) as threads:
        assert all(later == first for later in [move(), *threads.map(move, range(3))])
