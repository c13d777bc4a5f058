"""Who simulates is told when the energy balance is off, and a good motion is left alone."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import BalanceWarning
from gauss.simulation.energy import LOOKS, watch_balance

LONG = 10.0  # [s] that a simulation may have taken, so that looking at energies is cheap beside it


def test_simulate_tells_that_energy_is_off(monkeypatch):
    """The warning points at the line of who called; looking is always cheap here, whatever the machine does besides."""
    monkeypatch.setattr("gauss.simulation.energy.SHARE", 1e9)
    scene = gauss.load("double_pendulum")
    with pytest.warns(BalanceWarning, match="smaller step") as said:
        gauss.simulate(scene, 2.0, integrator="semi_implicit_euler", step=5e-3)
    assert said[0].filename == __file__


@pytest.fixture(scope="module")
def swinging():
    return gauss.compile_scene(gauss.load("double_pendulum"))


def test_what_is_off_is_told_where_that_is_cheap(swinging):
    motion = _quietly(swinging, integrator="semi_implicit_euler", step=5e-3)
    with pytest.warns(BalanceWarning):
        watch_balance(motion, LONG)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        watch_balance(motion, 0.0)


def test_a_good_motion_is_left_alone_even_if_a_few_samples_miss_its_largest_energy(swinging):
    motion = _quietly(swinging, rtol=1e-10, atol=1e-12)
    rest = _quietly(swinging, times=np.linspace(0.0, 1e-6, LOOKS))  # it has hardly moved: energies of rounding
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        watch_balance(motion, LONG)
        watch_balance(rest, LONG)


def _quietly(system, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BalanceWarning)
        return gauss.simulate(system, 2.0, **options)
