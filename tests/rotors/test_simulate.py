"""Rotor networks: reference motions, two forms of the equations, energy, and what must happen at rest and in slip."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gauss.rotors import (
    BeltSlipWarning,
    Constant,
    Dry,
    Kloss,
    Linear,
    Network,
    Quadratic,
    Viscous,
    simulate,
    snapshot,
)
from gauss.rotors.contract import reduce
from tests.support.rotor_networks import FALLING, random_network, reference, two_shafts

NAMES = ("gear-runup", "friction-chain", "parallel", "stall")
TIGHT = {"rtol": 1e-12, "atol": 1e-12}
# differences between two routes as the files state them: speeds 2.4e-11, angles 6e-11, torques 1.2e-10, energy 4e-11;
# rates and energies are compared over their size
DIGITS = {"speed": 2e-10, "angle": 2e-10, "acceleration": 2e-9, "torque": 2e-9, "slip": 1e-12, "energy": 2e-11}
FORMS = 1e-11  # reduced against full
BALANCE = 1e-9  # of the input energy


@pytest.fixture(scope="module")
def motions():
    """Motion of each reference file at its samples."""
    found = {}
    for name in NAMES:
        network, data = reference(name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BeltSlipWarning)
            found[name] = simulate(network, data["table"]["time"][-1], times=data["table"]["time"], **TIGHT), data
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_reference_tables(motions, name):
    """Every column of the worked examples, which two other routes agree upon."""
    motion, data = motions[name]
    seen = set()
    for column, values in data["table"].items():
        kind = column.split("_")
        if column in ("time", "J_pr", "Q_pr"):
            continue
        if kind[0] == "shaft":
            ours, digits = getattr(motion, kind[2])(f"s{kind[1]}"), DIGITS[kind[2]]
        elif column == "driver_acceleration":
            ours, digits = motion.accelerations[:, -1], DIGITS["acceleration"]
        elif kind[-1] == "backward":
            ours, digits = ~motion.forward[:, int(kind[1])], 0.0
        elif kind[0] == "link":
            ours, digits = getattr(motion, kind[2])(f"l{kind[1]}"), DIGITS[kind[2]]
        else:
            totals = {"work_applied": motion.work, "heat_slip": motion.slip_heat, "heat_mesh": motion.mesh_heat}
            ours, digits = totals[column].sum(axis=1), DIGITS["energy"] * max(values)
        seen.add(kind[-1])
        assert np.abs(np.subtract(ours, values, dtype=float)).max() <= digits, column
    assert {"angle", "speed", "torque"} <= seen


def test_reduced_inertia_and_torque_of_the_reference():
    """J_pr and Q_pr (III.58), (III.63) before and after the power turns."""
    network, data = reference("gear-runup")
    table = data["table"]
    for k in (0, 10, 31, 35):
        speeds = [table[f"shaft_{j}_speed"][k] for j in range(3)]
        found = snapshot(network, table["time"][k], speeds=speeds)
        f = np.array([link.factor(bool(way)) for link, way in zip(network.links.values(), found.forward, strict=True)])
        J = reduce(network).factors(f)[1][0]
        assert J == pytest.approx(table["J_pr"][k], rel=1e-13)
        assert J * found.accelerations[2] == pytest.approx(table["Q_pr"][k], rel=1e-11)


@pytest.mark.slow
def test_events_of_the_reference(motions):
    """Reversals of slip, stall and restart at the stated times, and the power turns in both gears at once."""
    chain, data = motions["friction-chain"]
    times = [event.time for event in chain.events if event.kind == "slip reversal"]
    assert times == pytest.approx(data["slip_sign_changes"], abs=2e-10)
    stall, data = motions["stall"]
    found = [(e.kind, e.time) for e in stall.events if e.kind in ("stall", "start")]
    assert [kind for kind, _ in found] == ["stall", "start"]
    assert [time for _, time in found] == pytest.approx([e["time"] for e in data["events"]], abs=1e-11)
    gear, _ = motions["gear-runup"]
    assert [(e.time, e.element) for e in gear.events if e.kind == "power reversal"] == [(6.0, "l0"), (6.0, "l1")]
    assert not [e for e in motions["parallel"][0].events if e.kind != "switch"]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_energy_is_balanced_and_heat_never_falls(motions, name):
    energy = motions[name][0].energy()
    assert np.abs(energy.balance).max() <= BALANCE * energy.input[-1]
    motion = motions[name][0]
    for link in motion.reduced.network.links:  # a belt of constant slip driven backward loses less by its mesh than it seems
        assert (np.diff(motion.loss(link)) >= -1e-12 * energy.scale).all()


@pytest.mark.slow
@pytest.mark.parametrize("speeds", ["random", "some at rest"])
@settings(max_examples=200)
@given(seed=st.integers(0, 2**32 - 1))
def test_full_and_reduced_forms_agree(speeds, seed):
    """One coordinate for each set of geared shafts, or all shafts with multipliers: the same accelerations and torques."""
    network = random_network(seed, resting=speeds != "random")
    reduced, rng = reduce(network), np.random.default_rng(seed)
    w = rng.uniform(-100, 100, reduced.n_groups)
    if speeds != "random":
        w[rng.random(w.size) < 0.6] = 0.0
    angles = reduced.angle + reduced.K * rng.uniform(-1, 1, w.size)[reduced.group]
    given_ = {"angles": angles, "speeds": reduced.K * w[reduced.group]}
    short, long = (snapshot(network, 0.3, **given_, form=form) for form in ("reduced", "full"))
    scale = np.abs(long.torques).max() + 100.0  # N m: torques of the laws are of this size, inertias of 0.05 kg m² and more
    assert np.abs(short.accelerations - long.accelerations).max() <= FORMS * max(np.abs(long.accelerations).max(), scale)
    if speeds == "random":  # at rest the torques of a stuck train are one choice of many
        assert np.abs(short.torques - long.torques).max() <= FORMS * scale
        links = network.links.values()
        drivers = np.array([list(network.shafts).index(link.driver) for link in links])
        flow = long.torques * given_["speeds"][drivers] / np.array([link.ratio for link in links])
        lossy = np.array([link.lossy for link in links])
        assert (short.forward[lossy] == (flow[lossy] >= 0)).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.rotors.BeltSlipWarning")
@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5, 12])
def test_compiled_equations_are_the_same(seed):
    network = random_network(seed, resting=True)
    one, other = (simulate(network, 0.01, times=[0.005, 0.01], compiled=way) for way in (True, False))
    assert [found.stats.plan.dynamics for found in (one, other)] == ["compiled", "numpy"]
    scale = np.abs(other.speeds).max() + 1.0
    assert np.abs(one.speeds - other.speeds).max() <= 1e-9 * scale
    assert [e.kind for e in one.events] == [e.kind for e in other.events]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.rotors.BeltSlipWarning")
@pytest.mark.parametrize("seed", range(12))
def test_random_motions_balance_their_energy(seed):
    """Gears with losses, slips, springs, dry friction, starting from rest: nothing is made or lost."""
    energy = simulate(random_network(seed, resting=True), 0.2, rtol=1e-10, atol=1e-10).energy()
    assert np.abs(energy.balance).max() <= BALANCE * max(energy.scale, 1e-3)


CURVE = (40.0, 1.6, 0.04)


def test_start_from_rest_has_a_constant_slip():
    """Zero speed start: the limit 0/0 is the root of Rotor chains, section 8."""
    _, data = reference("stall")
    expected = data["start_from_rest"]
    network = two_shafts(curve=CURVE, efficiency=0.98)
    network.torque("in", 30.0)
    motion = simulate(network, 1.0)
    assert motion.slip("link")[-1] == pytest.approx(expected["slip"], rel=1e-8)
    assert motion.torque("link")[-1] == pytest.approx(expected["link_torque"], rel=1e-8)
    assert motion.accelerations[-1] == pytest.approx(expected["acceleration"], rel=1e-8)


def test_stalled_output_lets_the_driver_slip():
    """A dry load above the traction holds the output; the driver runs against Q_em(1) = A − B/(C + 1)."""
    network = two_shafts(curve=CURVE, efficiency=0.98, speeds=(0.0, 90.0))
    network.torque("out", Dry(55.0))
    network.torque("in", Linear(1.5, 100.0))
    motion = simulate(network, 2.0)
    full_slip = 40.0 - 1.6 / 1.04
    assert motion.stuck[:, 0].all() and (motion.speed("out") == 0).all()
    assert motion.slip("link") == pytest.approx(1.0)
    assert motion.torque("link") == pytest.approx(full_slip)
    assert motion.speed("in")[-1] == pytest.approx(100.0 - full_slip / (1.5 * 0.98) / 1.5, rel=1e-3)  # on its way to it
    assert np.diff(motion.loss("link")).min() > 0


def test_stopped_driver_is_turned_and_brakes_the_output():
    """Driver at rest, output turning: x = −1, Q_em = −(A − B/(C + 1)), and power flows back with η̄ = 2 − 1/η."""
    found = snapshot(two_shafts(curve=CURVE, efficiency=0.98, speeds=(50.0, 0.0)))
    full_slip = 40.0 - 1.6 / 1.04
    assert found.torques == pytest.approx([-full_slip]) and not found.forward[0]
    assert found.accelerations == pytest.approx([-full_slip / 0.8, full_slip * (2.0 - 1.0 / 0.98) / 1.5 / 0.4])


@pytest.mark.slow
def test_both_shafts_come_to_rest_under_dry_loads():
    network = two_shafts(curve=CURVE, efficiency=0.98, speeds=(50.0, 80.0))
    network.torque("out", Dry(6.0))
    network.torque("in", Dry(9.0))
    motion = simulate(network, 15.0)
    assert "rest" in [event.kind for event in motion.events]
    assert motion.stuck[-1].all() and (motion.speeds[-1] == 0).all()
    energy = motion.energy()
    assert np.abs(energy.balance).max() <= BALANCE * energy.scale


def test_slip_beyond_the_range_of_a_curve_is_reported_and_followed():
    """The law goes on where it was not fitted; the message names the link, the time, and so the slip."""
    motions = []
    for largest in (0.1, None):
        network = two_shafts(curve=CURVE, largest_slip=largest, speeds=(59.0, 90.0))
        network.torque("out", Dry(55.0))
        network.torque("in", Linear(1.5, 100.0))
        motions.append(simulate(network, 3.0, **TIGHT))
    mode, plain = motions
    (beyond,) = (event for event in mode.events if event.kind == "beyond the range of the curve")
    assert beyond.element == "link" and mode.slip("link")[mode.t == beyond.time] == pytest.approx(0.1, abs=1e-9)
    assert mode.speeds[-1] == pytest.approx(plain.speeds[-1], abs=1e-9)


def test_reversing_load_is_followed_through_zero():
    """A constant load pulls the train back: the power turns where the speed does, and the train is driven backward."""
    network = two_shafts(3.0, speeds=(10.0, None), efficiency=0.9)
    network.torque("out", -20.0)
    network.torque("in", 5.0)
    network.torque("in", Viscous(0.1))
    motion = simulate(network, 40.0, **TIGHT)
    (turn,) = (e.time for e in motion.events if e.kind == "reversal")
    assert motion.speed("in")[0] > 0 > motion.speed("in")[-1]
    assert [e.time for e in motion.events if e.kind == "power reversal"] == [turn]
    # from then on the load drives: 20/3 η̄ − 5 = 0.1 ω in the end
    assert motion.speed("in")[-1] == pytest.approx(-(20.0 / 3.0 * (2.0 - 1.0 / 0.9) - 5.0) / 0.1, rel=1e-3)
    before, after = motion.accelerations[motion.t < turn][-1, 1], motion.accelerations[motion.t > turn][0, 1]
    assert before < after < 0  # friction of the gear braked before and holds back afterwards


@pytest.mark.slow
def test_driver_that_reverses_pulls_the_output_through_zero():
    network = two_shafts(curve=CURVE, speeds=(60.0, 92.0))
    network.torque("in", -30.0)
    motion = simulate(network, 6.0)
    assert motion.speed("in")[-1] < 0 and motion.speed("out")[-1] < 0
    counter = (motion.speed("in") < 0) & (motion.speed("out") > 0)
    assert counter.any() and (motion.torque("link")[counter] < 0).all()
    energy = motion.energy()
    assert np.abs(energy.balance).max() <= 1e-8 * energy.scale


@pytest.mark.slow
@pytest.mark.parametrize("slip, caught", [(0.05, True), (0.3, False)])
def test_slip_beyond_the_peak_runs_away(slip, caught):
    """On the falling branch the output loses its drive and stalls; before the peak the same load is carried."""
    network = two_shafts(1.0, curve=FALLING, speeds=(100.0 * (1 - slip), 100.0))
    network.torque("out", Dry(30.0))
    network.torque("in", Linear(50.0, 100.6))
    motion = simulate(network, 8.0)
    kinds = [event.kind for event in motion.events]
    assert ("stall" in kinds) is not caught
    if caught:
        assert 2 * 40.0 * 0.1 * motion.slip("link")[-1] / (motion.slip("link")[-1] ** 2 + 0.01) == pytest.approx(
            30.0, rel=1e-6
        )
    else:
        assert motion.stuck[-1, 0] and motion.slip("link")[-1] == pytest.approx(1.0)


@pytest.mark.slow
def test_passing_the_peak_is_reported():
    network = two_shafts(1.0, curve=FALLING, speeds=(97.0, 100.0))
    network.torque("out", Dry(50.0))
    network.torque("in", Linear(50.0, 100.6))
    kinds = [event.kind for event in simulate(network, 4.0).events]
    assert kinds.index("past the peak") < kinds.index("stall")


def _motor_and_fan(order=("motor", "belt", "fan"), split=False, sign=1.0):
    network = Network("fan")
    inertia = {"motor": 0.1, "belt": 0.4, "fan": 1.0, "half": 0.25}
    for name in order:
        network.shaft(name, inertia[name] * (0.75 if split and name == "fan" else 1.0))
    if split:
        network.shaft("half", inertia["half"])
        network.gear("weld", "half", "fan", 1.0)
    links = [
        lambda: network.gear("gear", "belt", "motor", 2.0, efficiency=0.95),
        lambda: network.friction_drive("drive", "fan", "belt", 1.2, (60.0, 1.8, 0.03), efficiency=0.98),
    ]
    for link in links if order[0] == "motor" else links[::-1]:
        link()
    network.torque("motor", Kloss(40.0, 0.15, sign * 157.0))
    network.torque("fan", Quadratic(0.002))
    network.torque("fan", Constant(-sign * 5.0))
    return network


@pytest.mark.slow
@pytest.mark.parametrize("change", [{"order": ("fan", "motor", "belt")}, {"split": True}, {"sign": -1.0}])
def test_order_splitting_and_mirroring_change_nothing(change):
    times = np.linspace(0.1, 3.0, 30)
    plain, changed = (simulate(_motor_and_fan(**how), 3.0, times=times, **TIGHT) for how in ({}, change))
    for name in ("motor", "belt", "fan"):
        mirrored = change.get("sign", 1.0) * changed.speed(name)
        assert mirrored == pytest.approx(plain.speed(name), rel=1e-9)


def _loop(last=0.75, **options):
    network = Network("loop")
    for name in ("a", "b", "c"):
        network.shaft(name, 0.1)
    network.gear("ab", "b", "a", 2.0)
    network.gear("bc", "c", "b", 1.5)
    network.gear("ac", "c", "a", 4.0 * last, **options)
    network.torque("a", 10.0)
    network.torque("c", -6.0)
    return network


def test_power_loop_has_one_motion_and_the_least_torques():
    found, full = (snapshot(_loop(), form=form) for form in ("reduced", "full"))
    assert reduce(_loop()).redundant
    assert found.accelerations == pytest.approx(full.accelerations, rel=1e-13)
    assert found.torques == pytest.approx(full.torques, rel=1e-12)
    one_less = _loop()
    del one_less.links["ac"]
    assert snapshot(one_less).accelerations == pytest.approx(found.accelerations, rel=1e-13)


@pytest.mark.parametrize("ratio", [-2.0, 3.0])
def test_ideal_chain_is_the_reduction_by_kinetic_energy(ratio):
    """η = 1, ε = 0: ½ Σ J ω² = ½ J_pr ω_r²."""
    network = random_network(7, ideal=True, gears_only=True)
    reduced = reduce(network)
    f = np.array([link.factor(True) for link in network.links.values()])
    assert reduced.factors(f)[1] == pytest.approx([reduced.inertia @ reduced.K**2], rel=1e-14)
    two = two_shafts(ratio)
    two.torque("in", 6.0)
    assert snapshot(two).accelerations[1] == pytest.approx(6.0 / (0.4 + 0.8 / ratio**2), rel=1e-14)


def test_energies_do_not_depend_on_the_samples():
    network = Network("wound up")
    network.shaft("out", 0.5)
    network.shaft("in", 0.1)
    network.spring("spring", "out", "in", stiffness=200.0, rest=0.3)  # elastic at the start
    whole, part = (simulate(network, 0.5, times=times, **TIGHT).energy() for times in ([0.0, 0.1, 0.5], [0.1, 0.5]))
    np.testing.assert_allclose(whole.elastic[1:], part.elastic, atol=BALANCE * whole.scale)
    assert np.abs(part.balance).max() <= BALANCE * part.scale
