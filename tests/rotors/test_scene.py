"""Rotor networks inside Gauss scenes: both routes move alike, alone and where a gear train drives a linkage."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.contact.mode_selection import mode_selector
from gauss.errors import SceneError
from gauss.rotors import Dry, Kloss, Linear, Network, TorqueFunction, Viscous, simulate, snapshot, to_scene
from gauss.rotors.contract import reduce
from gauss.system.passes import trains
from tests.support.reductions import stages
from tests.support.rotor_networks import random_network

FORMS = 1e-11  # accelerations of the two routes, over the largest
MOTIONS = 1e-8  # integrated at 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("moves", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_accelerations_are_those_of_the_network(seed, moves):
    """Ideal and lossy gears, slips, springs in trees and loops; at rest losses and dry friction hold some of them."""
    network = random_network(seed, resting=not moves)
    system = gauss.compile_scene(to_scene(network, axis=(0.0, 0.6, 0.8)))
    rng = np.random.default_rng(seed)
    reduced = reduce(network)
    turned, speeds = (reduced.K * rng.uniform(-1, 1, reduced.n_groups)[reduced.group] * size for size in (1.0, 80.0 * moves))
    expected = snapshot(network, 0.2, reduced.angle + turned, speeds)
    order = [list(network.shafts).index(name) for name in system.coordinates]
    state = system.state(turned[order], speeds[order], t=0.2)
    found = mode_selector(system).choose(state, np.zeros(0, dtype=int), "auto")
    size = max(np.abs(expected.accelerations).max(), 1.0)
    assert np.abs(found.solution.qdd - expected.accelerations[order]).max() <= FORMS * size
    if moves:  # at rest the torques of what is stuck are open
        for b, name in enumerate(network.links):
            if name in found.forces:
                assert found.forces[name] == pytest.approx(expected.torques[b], rel=1e-9, abs=FORMS * size)


@pytest.mark.slow
def test_motions_are_those_of_the_network():
    """Slips and losses included; torques that begin and end are stepped over by the scene."""
    network = Network("two")
    network.shaft("fan", 0.8, angle=0.3)
    network.shaft("motor", 0.1, speed=90.0)
    network.shaft("belt", 0.2)
    network.gear("gear", "belt", "motor", -1.5)
    network.friction_drive("drive", "fan", "belt", 1.2, (60.0, 1.8, 0.03), efficiency=0.96)
    network.torque("motor", Kloss(40.0, 0.15, 157.0))
    network.torque("fan", Viscous(0.05))
    times = np.linspace(0.0, 2.0, 21)
    ours = simulate(network, 2.0, times=times, rtol=1e-12, atol=1e-12)
    theirs = gauss.simulate(to_scene(network), 2.0, times=times, rtol=1e-11, atol=1e-11, progress=False)
    for name in network.shafts:
        assert theirs.rate(name) == pytest.approx(ours.speed(name), rel=MOTIONS, abs=1e-6)
        assert 0.3 * (name == "fan") + theirs.coordinate(name) == pytest.approx(ours.angle(name), rel=MOTIONS, abs=1e-6)


@pytest.mark.slow
def test_a_dry_load_stalls_and_starts_again_in_the_scene():
    """The load is above the traction, but is helped from time to time."""
    network = Network("swing")
    network.shaft("out", 0.8, speed=3.0)
    network.shaft("in", 0.4, speed=35.0)
    network.friction_drive("link", "out", "in", 1.5, (40.0, 1.6, 0.04))
    network.torque("out", Dry(45.0))
    network.torque("out", TorqueFunction(lambda t, angle, speed: -15.0 * gauss.math.cos(6.0 * t)))
    network.torque("in", Linear(1.5, 100.0))
    times = np.linspace(0.0, 0.7, 8)
    ours = simulate(network, 0.7, times=times, rtol=1e-11, atol=1e-11)
    assert {"stall", "start"} <= {event.kind for event in ours.events}
    theirs = gauss.simulate(to_scene(network), 0.7, times=times, rtol=1e-10, atol=1e-10, progress=False)
    for name in network.shafts:
        assert theirs.rate(name) == pytest.approx(ours.speed(name), abs=MOTIONS * 100.0)


def _geared_motor() -> Network:
    network = Network("geared motor")
    network.shaft("motor", 0.004)
    network.shaft("layshaft", 0.02)
    network.shaft("crank shaft", 0.3)
    network.gear("first stage", "layshaft", "motor", 3.0)
    network.gear("second stage", "crank shaft", "layshaft", -4.0)
    network.torque("motor", Kloss(25.0, 0.2, -157.0))
    network.torque("motor", Viscous(0.002), role="loss")
    return network


J_RED = 0.3 + 4.0**2 * 0.02 + 12.0**2 * 0.004  # of the train at the crank shaft: Σ J i² (III.58 at η = 1)


def _motor_at_the_crank(t, angle, speed):
    return -12.0 * (Kloss(25.0, 0.2, -157.0)(t, -12.0 * angle, -12.0 * speed) + 0.002 * 12.0 * speed)


@pytest.mark.slow
def test_a_gear_train_drives_a_four_bar():
    """Motor and train as rotors in the scene of a four-bar; the same by Assur groups with the train reduced to the crank."""
    linkage = gauss.load_linkage("four_bar")
    scene = to_scene(_geared_motor(), linkage.to_scene(torque=0.0), on={"crank shaft": "A"}, at={"motor": (0, 0.3, 0.1)})
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    rates = dict(zip(system.coordinates, state.v, strict=True))
    crank_speed = linkage.drives[0].speed
    assert rates["motor"] == pytest.approx(-12.0 * crank_speed) and rates["layshaft"] == pytest.approx(-4.0 * crank_speed)
    times = np.linspace(0.0, 1.5, 31)
    found = gauss.simulate(system, 1.5, times=times, rtol=1e-11, atol=1e-11, progress=False)
    run = linkage.run(1.5, _motor_at_the_crank, speed=crank_speed, added_inertia=J_RED, times=times, rtol=1e-11, atol=1e-11)
    assert np.ptp(run.speed) > 1.0  # the four-bar is felt
    assert found.rate("A") == pytest.approx(run.speed, rel=MOTIONS)
    assert found.rate("motor") == pytest.approx(-12.0 * run.speed, rel=MOTIONS)
    comparison = gauss.crosscheck(system, [found.state(k) for k in range(0, 31, 6)])
    assert comparison.passed, str(comparison)
    energy = gauss.energy(found)
    assert np.abs(energy.balance).max() <= MOTIONS * energy.scale


def test_explain_tells_the_reduced_train():
    system = gauss.compile_scene(to_scene(_geared_motor()))
    why = stages(system)[trains].why
    assert len(why) == 2 and "'layshaft'" in why[0] and "'crank shaft'" in why[1]
    assert all(reason in system.explain() for reason in why)


WRONG = {
    "unknown joint": (lambda: to_scene(_geared_motor(), gauss.load("four_bar"), on={"motor": "E"}), "no joint 'E'"),
    "unknown shaft": (lambda: to_scene(_geared_motor(), at={"moter": (0, 0, 0)}), "no shaft 'moter'.*Did you mean 'motor'"),
    "slider": (lambda: to_scene(_geared_motor(), gauss.load("screw_jack"), on={"motor": "thread"}), "revolute"),
    "axis": (lambda: to_scene(_geared_motor(), axis=(0, 0, 0)), "expected a direction"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_fit_a_scene_is_refused(case):
    call, words = WRONG[case]
    with pytest.raises(SceneError, match=words):
        call()


def test_functions_of_the_user_act_in_the_scene():
    network = Network("one")
    network.shaft("wheel", 2.0, speed=1.0, angle=0.5)
    network.torque("wheel", TorqueFunction(lambda t, angle, speed: 3.0 * t - 0.5 * angle - speed))
    network.torque("wheel", 4.0, begin=0.1, until=0.3)
    system = gauss.compile_scene(to_scene(network))
    for t, extra in ((0.0, 0.0), (0.2, 4.0), (0.4, 0.0)):
        expected = (3.0 * t - 0.5 * (0.5 + 0.7) - 1.5 + extra) / 2.0
        assert system.accelerations(system.state([0.7], [1.5], t=t)) == pytest.approx([expected], rel=1e-14)
