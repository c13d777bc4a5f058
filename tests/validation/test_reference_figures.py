"""Figures of the reference files beside their tables of angles: rates, ends, invariants, periods, work over a cycle."""

import numpy as np
import pytest

import gauss
from gauss.linkages.dynamics import reduced_inertia
from tests.support import linkages, mechanisms

SPEEDS = 2e-10  # rad/s: tables by DOP853 with a tolerance of 1e-13
PUBLISHED = 1e-5  # rad/s, of rates of 1000: the crank's angle is published to 1.4e-9
ROUNDING = 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name, n, until", [("double-pendulum", 2, 3.0), ("chain-10", 10, 0.25)])
def test_rates_of_hanging_rods(name, n, until):
    """Until the last link of the chain whips, where every digit is lost."""
    data = mechanisms.reference(name)
    scene, table = mechanisms.rods(n), data["table"]
    for joint, angle in zip(scene.joints, mechanisms.start_angles(data["initial_conditions"]["angles"]), strict=True):
        scene.start(joint, angle)
    t = np.array([time for time in table["t"] if time <= until])
    motion = gauss.simulate(scene, t[-1], times=t, rtol=1e-13, atol=1e-13)
    assert np.abs(np.cumsum(motion.v, axis=1) - table["speeds"][: t.size]).max() <= SPEEDS


@pytest.mark.slow
def test_rates_of_the_squeezer_where_they_are_published():
    data = mechanisms.reference("andrews-squeezer")
    motion = gauss.simulate(gauss.load("andrews_squeezer"), data["duration"], times=[data["duration"]])
    rates = np.column_stack([motion.rate(joint) for joint in ("O", "P", "B", "G", "A5", "H", "A7")])
    assert np.abs(rates[0] - data["published_end"]["v"]).max() <= PUBLISHED


def test_pendulum_returns_with_its_rates_after_a_period():
    data = mechanisms.reference("pendulum")
    table, period = data["table"], data["period_s"]
    angle, speed = np.array(table["angle_from_vertical"]), np.array(table["speed"])
    scene = gauss.Scene("pendulum", gravity=(0, 0, -9.81))
    scene.body("bob", mass=1.0, com=(0, 0, -1.0))
    scene.revolute("A", "ground", "bob", axis=(0, 1, 0))
    scene.start("A", angle[0])
    motion = gauss.simulate(scene, table["t"][-1], times=table["t"], rtol=1e-13, atol=1e-13)
    assert np.abs(motion.rate("A") - speed).max() <= 1e-11
    again = gauss.simulate(scene, period, times=[period], rtol=1e-13, atol=1e-13)
    assert (again.coordinate("A")[0], again.rate("A")[0]) == pytest.approx((angle[0], 0.0), abs=ROUNDING)


def test_free_body_keeps_energy_and_momentum():
    data = mechanisms.reference("free-rigid-body")
    J, invariants = np.array(data["parameters"]["J"]), data["invariants"]
    scene = gauss.Scene("body", gravity=(0, 0, 0))
    scene.body("body", 1.0, J)
    scene.free("F", "ground", "body")
    scene.start("F", rate=(0, 0, 0, *data["initial_conditions"]["omega"]))
    motion = gauss.simulate(scene, data["table"]["t"][-1], rtol=1e-13, atol=1e-13)
    assert gauss.energy(motion).kinetic == pytest.approx(invariants["energy"], rel=ROUNDING)
    momentum = np.linalg.norm(motion.v[:, 3:] * J, axis=1)
    assert momentum == pytest.approx(invariants["momentum"], rel=ROUNDING)


@pytest.mark.parametrize("name", linkages.SHIPPED)
def test_work_over_a_cycle(name):
    """Constant loads do no work over a cycle."""
    data = mechanisms.reference(linkages.SHIPPED[name][0])["cycle"]
    work = gauss.load_linkage(name).work()
    assert work[-1] == pytest.approx(data["work"], abs=ROUNDING * np.abs(work).max())


def test_dead_points_of_the_slider():
    dead = mechanisms.reference("linkage-slider-crank")["resisting"]["dead_points"]
    found = gauss.load_linkage("slider_crank").dead_centres("D")
    assert np.sort(np.cos(found)) == pytest.approx(np.sort(np.cos(dead)), abs=ROUNDING)  # angles of half a turn, either way
    assert np.abs(np.sin(found)).max() <= ROUNDING


def test_slope_of_the_reduced_inertia():
    """½ dJ_e/dθ, by central differences of J_e, whose error is the square of the step."""
    table, step = mechanisms.reference("linkage-extra")["forward_dynamics"]["table"], 1e-5
    chain, angle = gauss.load_linkage("four_bar").chain, np.array(table["crank_angle"])
    slope = (reduced_inertia(chain, angle + step) - reduced_inertia(chain, angle - step)) / (4 * step)
    assert slope == pytest.approx(np.array(table["reduced_inertia_half_slope"]), abs=1e-8)
