"""Torques that act for a while, at some times, angles or speeds: no step of a rotor network passes them unseen."""

import warnings
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from gauss import math, save_rotors
from gauss.cli import app
from gauss.errors import SimulationError, SwitchingWarning
from gauss.rotors import Characteristic, Linear, Network, TorqueFunction, TorqueTable, run_up_time, simulate, to_scene
from gauss.rotors.bernstein import NODES, PARTS, hulls

EXACT = 1e-8  # relative; steps are made to 1e-10
TIGHT = {"rtol": 1e-10, "atol": 1e-10}
METHODS = ("dop853", "radau", "auto")
DURATION = 20.0
INERTIA = 2.0


def shaft(law, speed=0.0, **options) -> Network:
    network = Network("single")
    network.shaft("a", INERTIA, speed)
    network.torque("a", law, **options)
    return network


def geared(law, speed=0.0, **options) -> Network:
    """The same inertia about the first of two geared shafts."""
    network = Network("geared")
    network.shaft("a", 0.5 * INERTIA, speed)
    network.shaft("b", 2.0 * INERTIA)
    network.gear("wheels", "b", "a", 2.0)
    network.torque("a", law, **options)
    return network


def sprung(law, speed=0.0, **options) -> Network:
    """The same beside a shaft that swings on a spring, so that steps have something to do."""
    network = shaft(law, speed, **options)
    network.shaft("c", 1.0, 1.0)
    network.shaft("d", 1.0)
    network.spring("spring", "d", "c", stiffness=3.0, damping=0.1)
    return network


def smooth_step(t):
    return 10.0 * np.exp(-(((t - 8.0) / 0.3) ** 2))


# law of (t, angle, speed) and the impulse that it gives [N m s]
OF_TIME = {
    "where": (lambda t, a, w: math.where(t > 5.0, math.where(t < 6.0, 10.0, 0.0), 0.0), 10.0),
    "if": (lambda t, a, w: 10.0 if 5.0 <= t < 6.0 else 0.0, 10.0),
    "10 ms": (lambda t, a, w: 10.0 if 5.0 <= t < 5.01 else 0.0, 0.1),
    "0.1 ms": (lambda t, a, w: 1e5 if 5.0 <= t < 5.0001 else 0.0, 10.0),
    "smooth": (lambda t, a, w: smooth_step(t), 3.0 * np.sqrt(np.pi)),
    "ramp": (lambda t, a, w: math.clip(10.0 * (t - 5.0), 0.0, 10.0) - math.clip(10.0 * (t - 7.0), 0.0, 10.0), 20.0),
    "train": (lambda t, a, w: math.where(np.floor(t / 4.0) * 4.0 + 0.01 > t, 100.0, 0.0), 5.0),
    "opaque": (lambda t, a, w: 10.0 if 5.0 <= float(t) < 6.0 else 0.0, 10.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("make", [shaft, geared, sprung])
@pytest.mark.parametrize("law", OF_TIME)
def test_impulses(law, make, method):
    """Change of speed by impulse over inertia."""
    function, impulse = OF_TIME[law]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if law == "opaque" else "error", SwitchingWarning)
        motion = simulate(make(function), DURATION, method=method, **TIGHT)
    assert motion.speed("a")[-1] == pytest.approx(impulse / INERTIA, rel=EXACT)


@pytest.mark.slow
def test_the_foot_of_a_pulse_is_no_scale_of_a_network():
    """At rest the torque is 1e-308 N m: energies are not controlled against those of such a torque."""
    pulses = [OF_TIME["smooth"][0], lambda t, a, w: math.where(t > 5.0, smooth_step(t), 0.0)]
    steps = [simulate(shaft(law), DURATION, method="radau", **TIGHT).stats.steps for law in pulses]
    assert steps[0] <= 1.5 * steps[1]


# law, speed at the start [rad/s], work that it does on the way [J]
OF_STATE = {
    "narrow angle": (lambda t, a, w: 10.0 if 50.0 < a < 50.01 else 0.0, 3.0, 0.1),
    "hard narrow angle": (lambda t, a, w: math.where(a > 50.0, math.where(a < 50.01, 1000.0, 0.0), 0.0), 3.0, 10.0),
    "two angles": (lambda t, a, w: 10.0 * ((1 if 20 < a < 20.1 else 0) + (2 if 20.2 < a < 20.3 else 0)), 3.0, 3.0),
    "every turn": (lambda t, a, w: 5.0 if a - 2 * np.pi * np.floor(a / (2 * np.pi)) < 0.02 else 0.0, 1.0, 0.4),
    "smooth": (lambda t, a, w: 10.0 * np.exp(-(((a - 50.0) / 0.05) ** 2)), 3.0, 0.5 * np.sqrt(np.pi)),
    "two fronts": (lambda t, a, w: 5.0 * (math.tanh((a - 50.0) / 0.01) - math.tanh((a - 50.1) / 0.01)), 3.0, 1.0),
    "kink": (lambda t, a, w: math.maximum(0.0, 10.0 - 1000.0 * abs(a - 50.0)), 3.0, 0.1),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("make", [shaft, geared])
@pytest.mark.parametrize("law", OF_STATE)
def test_work_between_two_angles(law, make, method):
    """Kinetic energy by the area under the torque over the angle."""
    function, speed, work = OF_STATE[law]
    motion = simulate(make(function, speed), DURATION, method=method, **TIGHT)
    assert motion.speed("a")[-1] == pytest.approx(np.sqrt(speed**2 + 2.0 * work / INERTIA), rel=EXACT)


PLACES = 50.0 + 5.0 * np.sin(1.7 * np.arange(40))  # rad; by chance, samples of a step lie on the peak at some of them


def peak(place, t, angle, speed):
    return 10.0 * np.exp(-(((angle - place) / 0.05) ** 2))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_smooth_peak_is_met_wherever_it_lies(method):
    for place in PLACES:
        motion = simulate(shaft(partial(peak, place), 3.0), DURATION, method=method, **TIGHT)
        assert motion.speed("a")[-1] == pytest.approx(np.sqrt(9.0 + 0.5 * np.sqrt(np.pi)), rel=EXACT), place


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dop853", "auto"])
def test_narrow_torque_over_speed(method):
    """Constant torque and a table with a narrow peak; time and speed by quadrature over the pieces of the table."""
    table = TorqueTable((0.0, 49.99, 50.0, 50.01, 200.0), (0.0, 0.0, 5000.0, 0.0, 0.0))
    network = shaft(10.0, 1.0)
    network.torque("a", table)
    motion = simulate(network, DURATION, method=method, **TIGHT)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    passed = sum(
        0.005 * INERTIA * float(w / (10.0 + table(0.0, 0.0, middle + 0.005 * x)))
        for middle in (49.995, 50.005)
        for x, w in zip(nodes, weights, strict=True)
    )
    before = INERTIA * (49.99 - 1.0) / 10.0
    assert motion.speed("a")[-1] == pytest.approx(50.01 + 10.0 / INERTIA * (DURATION - before - passed), rel=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_characteristic_with_a_narrow_peak(method):
    """A friction drive with a user's curve from a shaft of constant speed: ẋ = −(200 x + peak)/100, piece by piece."""
    network = Network("drive")
    network.shaft("a", 1e12, 100.0)
    network.shaft("b", 1.0, 0.0)
    curve = Characteristic(lambda x: 200.0 * x + math.sign(x) * math.where(abs(abs(x) - 0.3001) < 0.0001, 500.0, 0.0))
    network.friction_drive("drive", "b", "a", 1.0, curve)
    motion = simulate(network, 1.5, method=method, **TIGHT)
    there, across = 0.5 * np.log(1.0 / 0.3002), 0.5 * np.log((2 * 0.3002 + 5.0) / (2 * 0.3 + 5.0))
    slip = 0.3 * np.exp(-2.0 * (1.5 - there - across))
    assert motion.speed("b")[-1] == pytest.approx(100.0 * (1.0 - slip), rel=EXACT)


def test_samples_at_a_switching_time_are_those_after_it():
    times = np.array([0.0, 4.0, 5.0, 5.5, 6.0, 20.0])
    motion = simulate(shaft(OF_TIME["where"][0]), DURATION, times=times, **TIGHT)
    assert motion.t == pytest.approx(times, abs=0.0)
    assert motion.speed("a") == pytest.approx([0.0, 0.0, 0.0, 2.5, 5.0, 5.0], rel=EXACT, abs=1e-12)
    assert motion.acceleration("a") == pytest.approx([0.0, 0.0, 5.0, 5.0, 0.0, 0.0], rel=EXACT, abs=1e-12)


def test_gates_and_conditions_at_one_time():
    law = TorqueFunction(lambda t, a, w: 10.0 if t > 5.0 else 0.0)
    motion = simulate(shaft(law, begin=5.0, until=6.0), DURATION, **TIGHT)
    assert motion.speed("a")[-1] == pytest.approx(5.0, rel=EXACT)


def test_run_up_after_a_pause():
    """A motor that is switched on at 12 s: ω = ω₀ (1 − exp(−k t/J)), 95 % after 3 J/k."""
    motor = Linear(stiffness=4.0, omega_0=150.0)
    motion = simulate(shaft(lambda t, a, w: motor(t, a, w) if t >= 12.0 else 0.0), DURATION, **TIGHT)
    reached = run_up_time(motion, "a", 150.0 * (1.0 - np.exp(-3.0)))
    assert reached == pytest.approx(12.0 + 3.0 * INERTIA / 4.0, abs=1e-5)  # by cubics between steps


@pytest.mark.slow
def test_breaks_tell_of_a_law_that_cannot_be_traced():
    """A pulse of a tenth of a millisecond lies between all samples; breaks= of the torque or of the run tell of it."""
    law = lambda t, a, w: 1e5 if 5.0 <= float(t) < 5.0001 else 0.0  # noqa: E731
    for torque, run in (([5.0, 5.0001], ()), ((), [5.0, 5.0001])):
        with pytest.warns(SwitchingWarning, match="torque on a"):
            motion = simulate(shaft(law, breaks=torque), DURATION, breaks=run, **TIGHT)
        assert motion.speed("a")[-1] == pytest.approx(10.0 / INERTIA, rel=EXACT)


@pytest.mark.slow
def test_a_law_that_cannot_be_traced_is_warned_of_on_every_call():
    network = shaft(lambda t, a, w: np.interp(float(a), [50.0, 50.01], [0.0, 10.0]), 3.0)
    for _ in range(2):
        with pytest.warns(SwitchingWarning, match="single.*torque on a"):
            simulate(network, DURATION)


def _counted():
    """A law that counts its calls."""
    calls = [0.0]

    def law(t, a, w):
        calls[0] += 1.0
        return calls[0]

    return law


RNG = np.random.default_rng(1)
CHANGING = {
    "random": lambda: lambda t, a, w: float(RNG.normal()),
    "random part": lambda: lambda t, a, w: 5.0 * RNG.uniform() - w,
    "count": _counted,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", CHANGING)
def test_a_law_with_other_values_in_a_second_call_is_no_constant(kind):
    network = shaft(CHANGING[kind](), 3.0)
    for _ in range(2):
        with pytest.warns(SwitchingWarning, match="'torque on a' gives other values"):
            simulate(network, 1.0)


@pytest.mark.slow
def test_a_function_of_nothing_is_a_constant():
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchingWarning)
        motion = simulate(shaft(lambda t, a, w: 3.0), DURATION, **TIGHT)
    assert motion.speed("a")[-1] == pytest.approx(3.0 * DURATION / INERTIA, rel=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_friction_written_as_a_sign_is_refused(method):
    """It would switch for ever where the shaft stops, at 3 s."""
    with pytest.raises(SimulationError, match="t = 3 s.*'torque on a'"):
        simulate(shaft(lambda t, a, w: -2.0 if w > 0 else 2.0, 3.0), DURATION, method=method)


def test_breaks_are_checked_and_reach_a_scene():
    with pytest.raises(Exception, match="breaks"):
        shaft(OF_TIME["where"][0], breaks="soon")
    scene = to_scene(shaft(OF_TIME["where"][0], breaks=[6.0, 5.0]))
    assert next(iter(scene.loads.values())).breaks == (5.0, 6.0)


@pytest.mark.slow
def test_command_line(tmp_path):
    """A gate in a file, and a table with a narrow peak: what is shown is what simulate finds."""
    network = shaft(TorqueTable((0.0, 49.99, 50.0, 50.01, 200.0), (0.0, 0.0, 5000.0, 0.0, 0.0)), 1.0)
    network.torque("a", 10.0, begin=3.0)
    path = save_rotors(network, tmp_path / "peak.toml")
    shown = CliRunner().invoke(app, ["rotors", str(path), "--duration", "20"])
    assert shown.exit_code == 0, shown.output
    assert f"{simulate(network, DURATION).speed('a')[-1]:.6g}" in shown.output


def test_hulls_enclose_a_polynomial_and_its_derivative():
    """Degree 8 on steps of any length: against fine samples; ends of the hull are no farther than twice the range."""
    rng = np.random.default_rng(3)
    for length in (1e-6, 1.0, 1e3):
        polynomial = np.polynomial.Polynomial(rng.standard_normal(9))
        low, high, slope_low, slope_high = (x[0] for x in hulls(polynomial(NODES)[None], length))
        for part in range(PARTS):
            s = (part + np.linspace(0.0, 1.0, 101)) / PARTS
            for ends, found in (
                ((low[part], high[part]), polynomial(s)),
                ((slope_low[part] * length, slope_high[part] * length), polynomial.deriv()(s)),
            ):
                rounding = 1e-12 * max(1.0, np.abs(found).max())
                assert ends[0] <= found.min() + rounding
                assert ends[1] >= found.max() - rounding
                assert ends[1] - ends[0] <= 2.0 * np.ptp(found) + 0.2 * np.abs(found).max()
