"""Stepping objects, whose steps do not end where laws of time switch, say so at any time of a motion, however long it is."""

import warnings

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import SimulationError, SwitchingWarning
from tests.support.switching import bell, slider

STEP = 0.01
LATE = 150.003  # s: beyond ten thousand steps, and at no end of one
STEPS = 15_200


def one(scene):
    stepped = gauss.Simulator(scene, STEP)
    stepped.step(n=STEPS)


def one_by_one(scene):
    stepped = gauss.Simulator(scene, STEP)
    for _ in range(STEPS):
        stepped.step()


def many(scene):
    stepped = gauss.SimulatorBatch(scene, STEP, 2)
    for _ in range(4):
        stepped.step(n=STEPS // 4)


def begun_late(scene):
    stepped = gauss.Simulator(scene, STEP)
    stepped.reset(gauss.State(LATE - 1.0, np.zeros(1), np.zeros(1)))
    stepped.step(n=200)


SWITCHING = {
    "short pulse": lambda t: 1000.0 if LATE <= t < LATE + 1e-4 else 0.0,
    "jump": lambda t: 0.0 if t < LATE else 1.0,
    "jump at the end of a step": lambda t: gm.where(t < 150.0, 0.0, 1.0),
    "long pulse": lambda t: 1.0 if LATE <= t < LATE + 1.0 else 0.0,
    "narrow peak": bell(1e-4, LATE),
}
SMOOTH = {
    "sine": gm.sin,
    "constant": lambda t: 1.0 + 0.0 * t,
    "ramp": lambda t: 0.1 * t,
    "bend": lambda t: max(t - LATE, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", SWITCHING)
@pytest.mark.parametrize("motion", [one, one_by_one, many, begun_late])
def test_switching_is_warned_of_however_late_it_is(motion, law):
    with pytest.warns(SwitchingWarning, match=r"'slider': steps of 0.01 s"):
        motion(slider(SWITCHING[law]))


@pytest.mark.slow
@pytest.mark.parametrize("law", SMOOTH)
@pytest.mark.parametrize("motion", [one, many, begun_late])
def test_continuous_laws_are_not_warned_of(motion, law):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motion(slider(SMOOTH[law]))


def led(speed) -> gauss.Scene:
    scene = gauss.Scene("led", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    scene.drive("x", speed=speed)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("motion", [one, many])
def test_a_late_jump_of_a_prescribed_speed_is_refused_before_it(motion):
    with pytest.raises(SimulationError, match=r"prescribed velocities of 'led' jump at t = 150.003 s"):
        motion(led(lambda t: gm.where(t < LATE, 0.0, 0.5)))


def test_steps_before_a_late_jump_are_made():
    stepped = gauss.Simulator(led(lambda t: gm.where(t < LATE, 0.2, 0.5)), STEP)
    stepped.step(n=5000)
    before = stepped.state
    with pytest.raises(SimulationError):
        stepped.step(n=10_000)
    assert stepped.t == before.t
    assert stepped.coordinates[0] == before.q
    stepped.step(n=4000)
    assert stepped.coordinates[0] == pytest.approx(0.2 * 90.0, rel=1e-12)  # rounding of 9000 steps


def test_a_narrow_peak_of_a_prescribed_speed_is_warned_of():
    with pytest.warns(SwitchingWarning, match="pass over a feature"):
        gauss.Simulator(led(bell(1e-3, 3.0)), STEP)
