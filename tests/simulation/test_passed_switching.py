"""Stepping objects, whose steps do not end where laws of time switch, say so at any time of a motion, however long it is."""

import warnings

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import SimulationError, SwitchingWarning
from gauss.integrators import METHODS, FixedStep
from tests.support.switching import bell, slider

STEP = 0.01
ROUNDING = 1e-11  # of a rate, relative to a step at full force: of some hundred steps
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


FIXED = [name for name, method in METHODS.items() if isinstance(method, FixedStep) and method.order > 1]


@pytest.mark.slow
@pytest.mark.parametrize("place", ["end", "inside"])
@pytest.mark.parametrize("name", FIXED)
def test_a_jump_is_warned_of_where_it_costs_accuracy(name, place):
    """The right rate after a force of one newton is the time since it began."""
    begin = 0.33 if place == "end" else 0.3337
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        stepped = gauss.Simulator(slider(lambda t: gm.where(t < begin, 0.0, 1.0)), STEP, name)
        stepped.step(n=120)
    error = abs(stepped.coordinates[1].item() - (stepped.t - begin)) / STEP
    assert [one.category for one in heard] == [SwitchingWarning] * (error > ROUNDING)
    assert METHODS[name].evaluates_end == (error > ROUNDING) or place == "inside"


ROWS = STEP * np.arange(40)
TABLES = {  # and a method whose steps, which end at its rows, are not of order 1
    "lines": (lambda t: gm.interp(t, ROWS, np.sin(9.0 * ROWS)), "rk4"),
    "held values": (lambda t: sum(gm.where(t < row, 0.0, np.sin(row)) for row in ROWS), "gauss4"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_tables_whose_rows_are_ends_of_steps_are_not_warned_of(name):
    law, method = TABLES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gauss.Simulator(slider(law), STEP, method).step(n=40)


def opaque(t):
    return 1.0 if float(t) > 0.3337 else 0.0


ONCE = {  # and steps between two starts
    "traced": (lambda: slider(lambda t: gm.floor(0.7 * t)), 12_000),
    "opaque": (lambda: slider(opaque, breaks=[0.3337]), 40),
    "many jumps": (lambda: slider(lambda t: gm.floor(7.0 * t)), 12_000),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", ONCE)
@pytest.mark.parametrize("make", [gauss.Simulator, lambda *given: gauss.SimulatorBatch(*given, 2)])
def test_a_jump_is_warned_of_once_however_often_a_motion_begins_anew(make, law):
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        scene, steps = ONCE[law]
        stepped = make(scene(), STEP)
        for _ in range(3):
            stepped.step(n=steps)
            stepped.reset()
    assert [one.category for one in heard] == [SwitchingWarning]


def test_steps_of_order_one_are_not_warned_of_jumps_that_they_resolve():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gauss.Simulator(slider(lambda t: gm.where(t < 0.3337, 0.0, 1.0)), STEP, "semi_implicit_euler").step(n=120)
