"""Motors whose torque acts for a while, late or shortly: none is stepped over, and Ctrl-C keeps the motion so far."""

import math
import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, SwitchingWarning

LIGHT = 1e-12  # of the crank: mass and inertia of the other links
RELATIVE = 1e-8  # a hundred times rtol
END = 20.0  # s
FEW_CALLS = 1000  # of a motor: some 300 samples that show whether it remembers calls, and the steps of a smooth motion


def wheel() -> gauss.Linkage:
    """Four-bar linkage in which nothing but the crank has a mass, about its pivot: θ̈ = torque / 0.1 kg m²."""
    linkage = gauss.Linkage("wheel")
    linkage.link("crank", 1.0, 0.1)
    linkage.link("coupler", LIGHT, LIGHT, (0.5, 0.0))
    linkage.link("rocker", LIGHT, LIGHT)
    linkage.revolute("A", "ground", "crank")
    linkage.revolute("B", "crank", "coupler", at=(0.3, 0.0))
    linkage.revolute("C", "rocker", "coupler", at=(0.9, 0.0), child_at=(1.0, 0.0))
    linkage.revolute("D", "ground", "rocker", at=(1.0, 0.0))
    linkage.drive("A", speed=8.0)
    return linkage


# Laws of the motor, its settings, and the speed of the crank at the end.
LAWS = {
    "pulse": (lambda t, angle, speed: 10.0 if 8.0 < t < 8.01 else 0.0, {}, 1.0),
    "bell": (lambda t, angle, speed: math.exp(-(((t - 8.0) / 0.03) ** 2)), {}, 0.3 * math.sqrt(math.pi)),
    "late": (lambda t, angle, speed: 1.0 if t > 15.0 else 0.0, {}, 50.0),
    "at the end": (lambda t, angle, speed: 1.0 if t > END - 1e-2 else 0.0, {}, 0.1),
    "known pulse": (lambda t, angle, speed: 1e4 if 8.0 < t < 8.00001 else 0.0, {"breaks": [8.0, 8.00001]}, 1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("samples", [np.array([END]), np.linspace(0.0, END, 101)])
def test_no_torque_is_stepped_over(name, samples):
    law, options, expected = LAWS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SwitchingWarning)
        found = wheel().run(END, law, times=samples, **options)
    np.testing.assert_array_equal(found.t, samples)
    assert abs(found.speed[-1] - expected) <= RELATIVE * expected


@pytest.mark.slow
def test_a_motor_that_is_called_seldom_is_warned_of_on_every_call():
    for _ in range(2):
        with pytest.warns(SwitchingWarning, match="the law of the motor .* few points"):
            wheel().run(END, lambda t, angle, speed: 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wheel().run(END, lambda t, angle, speed: 0.0, step=0.01)


def test_a_motor_without_time_is_not_sampled_over_the_motion():
    calls = []

    def motor(t, angle, speed):
        calls.append(speed)
        return 1.0

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SwitchingWarning)
        wheel().run(1.0, motor, times=[1.0])
    assert len(calls) <= FEW_CALLS


def test_an_interrupted_run_is_kept():
    def motor(t, angle, speed):
        if t > 1.0 and speed > 5.0:  # not where the law is sampled, at rest
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(KeyboardInterrupt) as caught:
        wheel().run(END, motor, step=0.1)
    found = caught.value.trajectory
    assert 0.5 < found.t[-1] <= 1.1
    np.testing.assert_allclose(found.speed, 10.0 * found.t, atol=RELATIVE)


def test_a_step_that_is_none_is_refused():
    with pytest.raises(SimulationError, match="step: expected a positive number"):
        wheel().run(END, lambda t, angle, speed: 1.0, step=0.0)
