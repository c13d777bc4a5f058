"""Elements of rotor networks: laws, curves, and what is refused with which words."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gauss import load_rotors
from gauss.codegen import trace
from gauss.errors import GaussError, SceneError, SimulationError, StateError
from gauss.rotors import (
    DC,
    Characteristic,
    Diesel,
    Dry,
    FrictionDrive,
    GearPair,
    Hyperbola,
    Kloss,
    Linear,
    Measured,
    Network,
    Periodic,
    Quadratic,
    TorqueTable,
    Viscous,
    operating_points,
    simulate,
    snapshot,
)
from gauss.rotors.laws import LAWS
from gauss.rotors.traction import symmetric_slip

DIESEL = {"speed": (100.0, 150.0, 220.0), "torque": (80.0, 100.0, 85.0), "governed": 210.0, "idle": 230.0, "drag": 15.0}
VALUES = {
    "kloss at its pull-out": (Kloss(180.0, 0.15, 157.0), 157.0 * 0.85, 180.0),
    "kloss at rest": (Kloss(180.0, 0.15, 157.0), 0.0, 2 * 180 * 0.15 / (1 + 0.15**2)),
    "kloss the other way": (Kloss(180.0, 0.15, -157.0), -157.0 * 0.85, -180.0),
    "linear": (Linear(2.0, 150.0), 100.0, 100.0),
    "dc at rest": (DC(24.0, 0.5, 0.2), 0.0, 0.2 * 24.0 / 0.5),
    "dc without load": (DC(24.0, 0.5, 0.2), 120.0, 0.0),
    "quadratic backward": (Quadratic(0.1), -3.0, 0.9),
    "viscous": (Viscous(0.5), 4.0, -2.0),
    "diesel at full load": (Diesel(**DIESEL), 150.0, 100.0),
    "diesel below the curve": (Diesel(**DIESEL), 20.0, 80.0),
    "diesel without load": (Diesel(**DIESEL), 230.0, 0.0),
    "diesel driven": (Diesel(**DIESEL), 400.0, -15.0),
    "table at a point": (TorqueTable((0.0, 10.0, 30.0), (5.0, -1.0, 2.0)), 10.0, -1.0),
    "table beyond": (TorqueTable((0.0, 10.0, 30.0), (5.0, -1.0, 2.0)), 50.0, 2.0),
}


@pytest.mark.parametrize("case", VALUES)
def test_laws_by_hand(case):
    law, speed, torque = VALUES[case]
    assert float(law(0.0, 0.0, speed)) == pytest.approx(torque, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("case", VALUES)
def test_laws_are_the_same_when_compiled(case):
    law, speed, _ = VALUES[case]
    kernel = trace(lambda w: [law(0.0, 0.0, w[0])], 1, batch=False)
    for w in (speed, 0.3 * speed, 1.2 * speed - 7.0):
        assert kernel(np.array([w]))[0] == pytest.approx(float(law(0.0, 0.0, w)), rel=1e-13, abs=1e-13)


def test_a_diesel_is_continuous_where_its_slope_jumps():
    law = Diesel(**DIESEL)
    for kink in law.kinks:
        assert float(law(0, 0, kink - 1e-9)) == pytest.approx(float(law(0, 0, kink + 1e-9)), abs=1e-6)


def test_periodic_torque_goes_through_its_points():
    torque = (3.0, -1.0, 4.0, 1.0, -5.0, 9.0)
    law = Periodic(torque, period=np.pi)
    angles = np.arange(6) * np.pi / 6
    assert [law(0.0, angle, 0.0) for angle in angles] == pytest.approx(torque)
    assert law(0.0, angles[1] + np.pi, 0.0) == pytest.approx(torque[1])


CURVES = {
    "hyperbola": Hyperbola(90.0, 0.03),
    "measured": Measured((0.0, 0.02, 0.1, 1.0), (0.0, 60.0, 80.0, 70.0)),
    "function": Characteristic(lambda x: 30.0 * x / (0.05 + abs(x))),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CURVES)
@given(x=st.floats(-2.0, 2.0))
def test_curves_are_odd_and_of_the_sign_of_the_slip(name, x):
    curve = CURVES[name]
    torque = float(curve(x, np.sign(x)))
    assert torque == pytest.approx(-float(curve(-x, -np.sign(x))), rel=1e-12, abs=1e-12)
    assert torque * x >= 0


def test_peaks_are_found():
    assert CURVES["hyperbola"].peak is None and CURVES["function"].peak is None
    assert CURVES["measured"].peak == 0.1
    falling = Characteristic(lambda x: x / (x * x + 0.01))
    assert falling.peak == pytest.approx(0.1, rel=1e-4)


@given(v_d=st.floats(-200, 200), v=st.floats(-200, 200))
def test_symmetric_slip(v_d, v):
    """The slip of the book between rest and synchronism, odd in exchanging the wheels, never beyond ±2."""
    x = float(symmetric_slip(v_d, v, 1e-6))
    assert x == -float(symmetric_slip(v, v_d, 1e-6)) and abs(x) <= 2
    if 1e-6 < v_d and 0 <= v <= v_d:
        assert x == pytest.approx(1 - v / v_d, abs=1e-15)


def test_default_back_efficiency_makes_friction_work_alike_both_ways():
    assert GearPair("g", "a", "b", 2.0, efficiency=0.8).back_efficiency == pytest.approx(0.75)
    assert GearPair("g", "a", "b", 2.0, efficiency=0.4).back_efficiency == 0.0
    assert GearPair("g", "a", "b", 2.0, slip=0.02).back_efficiency == 0.98


def _network():
    network = Network("n")
    network.shaft("motor", 0.1)
    network.shaft("drum", 2.0)
    return network


MISTAKES = {
    "no inertia": (lambda n: n.shaft("s", 0.0), "inertia: expected a positive"),
    "inertia as text": (lambda n: n.shaft("s", "1 kg"), "inertia.*kg m².*'1 kg'"),
    "shaft twice": (lambda n: n.shaft("motor", 1.0), "'motor'.*taken"),
    "unknown shaft": (lambda n: n.gear("g", "drm", "motor", 2.0), "no shaft 'drm'.*Did you mean 'drum'"),
    "torque on nothing": (lambda n: n.torque("dru", 1.0), "no shaft 'dru'.*'drum'"),
    "ratio zero": (lambda n: n.gear("g", "drum", "motor", 0.0), "ratio.*other than 0"),
    "gear to itself": (lambda n: n.gear("g", "drum", "drum", 2.0), "both 'drum'"),
    "efficiency above one": (lambda n: n.gear("g", "drum", "motor", 2.0, efficiency=1.1), "at most 1"),
    "efficiency zero": (lambda n: n.gear("g", "drum", "motor", 2.0, efficiency=0.0), "efficiency: expected a positive"),
    "slip that makes energy": (
        lambda n: n.gear("g", "drum", "motor", 2.0, slip=0.1, back_efficiency=0.95),
        "would make energy.*0.9",
    ),
    "slip of one": (lambda n: n.gear("g", "drum", "motor", 2.0, slip=1.0), "below 1"),
    "curve that makes energy": (lambda n: n.friction_drive("f", "drum", "motor", 2.0, (40, 2, 0.04)), "energy from nothing"),
    "curve of two": (lambda n: n.friction_drive("f", "drum", "motor", 2.0, (40, 2)), r"expected \[A, B, C\]"),
    "curve of the wrong sign": (
        lambda n: n.friction_drive("f", "drum", "motor", 2.0, lambda x: -x),
        "torque of the slip's sign",
    ),
    "curve not from zero": (
        lambda n: n.friction_drive("f", "drum", "motor", 2.0, {"slip": [0.1, 1], "torque": [1, 2]}),
        "start at 0",
    ),
    "spring of nothing": (lambda n: n.spring("s", "drum", "motor"), "neither stiffness nor damping"),
    "backlash without flanks": (lambda n: n.spring("s", "drum", "motor", damping=1.0, backlash=0.1), "stiffness"),
    "clutch of weak rest": (lambda n: n.clutch("c", "drum", "motor", 10.0, static=0.5), "at least 1"),
    "clutch table": (lambda n: n.clutch("c", "drum", "motor", {"time": [0, 1]}), "time .s. and torque"),
    "clutch table backward": (
        lambda n: n.clutch("c", "drum", "motor", {"time": [1, 0], "torque": [0, 1]}),
        "time must increase",
    ),
    "law as class": (lambda n: n.torque("drum", Viscous), "class Viscous"),
    "torque of no time": (lambda n: n.torque("drum", 1.0, begin=2.0, until=1.0), "until 1.0 s must be after"),
    "role": (lambda n: n.torque("drum", 1.0, role="lod"), "Did you mean 'load'"),
    "diesel without droop": (lambda n: Diesel((1, 2), (3, 3), governed=5.0, idle=5.0), "idle 5.0 must be above"),
    "something else": (lambda n: n.add("drum"), "expected a Shaft"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused_and_leave_the_network_as_it_was(mistake):
    make, words = MISTAKES[mistake]
    network = _network()
    with pytest.raises(SceneError, match=words):
        make(network)
    assert network == _network()


def _cycle(**options):
    network = _network()
    network.shaft("fan", 1.0)
    network.gear("a", "drum", "motor", 2.0)
    network.gear("b", "fan", "drum", 1.5)
    network.gear("c", "fan", "motor", **{"ratio": 3.0} | options)
    return network


def _locked_between():
    network = _network()
    network.shaft("other motor", 1.0)
    network.gear("worm 1", "drum", "motor", 20.0, efficiency=0.4, back_efficiency=0.0)
    network.gear("worm 2", "drum", "other motor", 20.0, efficiency=0.4, back_efficiency=0.0)
    return network


def _speeds(first, second):
    network = Network("n")
    network.shaft("motor", 0.1, speed=first)
    network.shaft("drum", 2.0, speed=second)
    network.gear("g", "drum", "motor", 2.0)
    return network


def _pushing():
    network = Network("n")
    network.shaft("pedal", 0.1, speed=5.0)
    network.shaft("wheel", 2.0, speed=1.0)
    network.one_way("freewheel", "wheel", "pedal")
    return network


IMPOSSIBLE = {
    "nothing": (Network, "has no shafts"),
    "contradicting cycle": (lambda: _cycle(ratio=2.5), "'c' form a cycle over the shafts .*instead of 1"),
    "lossy cycle": (lambda: _cycle(efficiency=0.9), "'c' loses energy"),
    "worms against each other": (_locked_between, "self-locking gear 'worm"),
    "speeds against the gear": (lambda: _speeds(10.0, 4.0), "does not fit.*expected 5"),
    "impact in a freewheel": (_pushing, "by an impact"),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_networks_that_cannot_be_are_refused(case):
    make, words = IMPOSSIBLE[case]
    with pytest.raises(SceneError, match=words):
        simulate(make(), 1.0)


def test_wrong_questions_are_refused():
    network = _speeds(10.0, 5.0)
    for options, words in (({"method": "rk"}, "no method"), ({"times": [2.0]}, "increasing times"), ({"rtol": -1}, "rtol")):
        with pytest.raises(SimulationError, match=words):
            simulate(network, 1.0, **options)
    with pytest.raises(StateError, match="'drum' is 1 rad/s off"):
        snapshot(network, speeds=[10.0, 6.0])
    with pytest.raises(StateError, match="Did you mean 'reduced'"):
        snapshot(network, form="reduce")
    motion = simulate(network, 0.1)
    with pytest.raises(StateError, match="no link 'h'.*Known: g"):
        motion.torque("h")
    with pytest.raises(SceneError, match="no shaft 'moter'.*Did you mean 'motor'"):
        motion.speed("moter")


@pytest.mark.slow
@pytest.mark.parametrize("when", [float, lambda t: t], ids=["opaque", "traced"])
def test_a_law_that_breaks_is_reported(when):
    network = _speeds(10.0, 5.0)
    network.torque("drum", lambda t, angle, speed: float("nan") if when(t) > 0.5 else 1.0)
    with pytest.raises(SimulationError, match="no step is small enough"):
        simulate(network, 1.0)


@given(
    law=st.sampled_from(sorted(LAWS)),
    values=st.lists(
        st.floats() | st.just("1") | st.none() | st.lists(st.floats(-1e3, 1e3), max_size=3), min_size=1, max_size=5
    ),
)
def test_any_law_is_sound_or_refused(law, values):
    kind = LAWS[law]
    try:
        made = kind(*values[: len(kind.__dataclass_fields__)])
    except (GaussError, TypeError) as error:
        assert isinstance(error, GaussError) or "argument" in str(error)
        return
    if not isinstance(made, Dry):
        assert not np.isnan(float(made(0.0, 0.3, 12.0)))


def test_sticking_curve_is_dry():
    """B < A C: the drive holds up to A − B/C, and slips beyond."""
    assert FrictionDrive("f", "a", "b", 1.0, (40.0, 0.8, 0.04)).dry
    network = _network()
    network.friction_drive("f", "drum", "motor", 1.0, (40.0, 0.8, 0.04))
    network.torque("motor", lambda t, angle, speed: 10.0 * t)
    motion = simulate(network, 5.0)
    (slip,) = [event.time for event in motion.events if event.kind == "slip"]
    assert slip == pytest.approx(20.0 * (2.1 / 2.0) / 10.0, rel=1e-9)  # Q_em = J_drum ω̇ = 20 N m
    assert motion.torque("f").max() < 40.0


@pytest.mark.parametrize("t", [np.nan, "late"])
@pytest.mark.parametrize("ask", [operating_points, snapshot])
def test_times_that_are_none_are_refused(ask, t):
    with pytest.raises(SceneError, match="t: expected"):
        ask(load_rotors("gear_runup"), t)


def test_links_that_are_not_there_are_named():
    point, *_ = operating_points(load_rotors("gear_runup"))
    with pytest.raises(StateError, match="no link 'chain'"):
        point.slip("chain")
