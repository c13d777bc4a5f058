"""Loads that act for a while are never stepped over: each motion is right, in every call.

Sliders whose forces are laws of time have closed forms. Laws of places and rates, other integrators, and motions in phases
are in the files beside this one.
"""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PPoly
from typer.testing import CliRunner

import gauss
from gauss import cli
from gauss import math as gm
from tests.support.switching import ROOT_PI, STEPS, Counting, bell, between, moved, slider, verdict

pytestmark = pytest.mark.slow


def nested(t):
    if t < 5:
        return 0.0
    if t < 6:
        return 10.0
    return -1.0 if t > 19 else 0.0


def short(width, at=8.0, force=10.0):
    return lambda t: gm.where(t > at, gm.where(t < at + width, force, 0.0), 0.0)


KNOTS = np.linspace(0.0, 20.0, 41)
WAVY = CubicSpline(KNOTS, np.where(np.abs(KNOTS - 8.0) < 0.6, 1.0, 0.0))
LADDER = PPoly(np.arange(60.0)[None, :] % 7.0, np.linspace(0.0, 20.0, 61))
TABLE = np.array([[0.0, 7.99, 8.0, 8.01, 20.0], [0.0, 0.0, 1.0, 0.0, 0.0]])
PULSE = (20.0, 10.0, 145.0)
# Laws of time, the duration, and the rate and the place of the slider at the end.
OF_TIME = {
    "if": (between, *PULSE),
    "nested if": (nested, 20.0, 9.0, 144.5),
    "where": (lambda t: gm.where(t > 5, gm.where(t < 6, 10.0, 0.0), 0.0), *PULSE),
    "product of comparisons": (lambda t: 10.0 * (t > 5) * (t < 6), *PULSE),
    "and": (lambda t: 10.0 if t > 5 and t < 6 else 0.0, *PULSE),
    "min and max": (lambda t: min(max(t - 5, 0), 1) - min(max(t - 6, 0), 1), 20.0, 1.0, 14.0),
    "clip": (lambda t: gm.clip(t - 5, 0.0, 1.0) - gm.clip(t - 6, 0.0, 1.0), 20.0, 1.0, 14.0),
    "np.clip": (lambda t: np.clip(t - 5, 0.0, 1.0) - np.clip(t - 6, 0.0, 1.0), 20.0, 1.0, 14.0),
    "np.maximum": (lambda t: np.maximum(0.0, 1 - np.abs(t - 8) / 0.01), 20.0, 0.01, 0.12),
    "abs": (lambda t: max(0, 1 - abs(t - 8) / 1e-3), 20.0, 1e-3, 0.012),
    "sign": (lambda t: gm.sign(t - 5) + gm.sign(6 - t), 20.0, 2.0, 29.0),
    "floor": (lambda t: 10.0 if np.floor(t) == 5 else 0.0, *PULSE),
    "//": (lambda t: 10.0 if t // 1 == 5 else 0.0, *PULSE),
    "%": (lambda t: 1000.0 if t % 1 < 1e-3 else 0.0, 20.0, 20.0, sum(20 - k - 0.5e-3 for k in range(20))),
    "square wave": (lambda t: 1.0 if t % 1 < 0.5 else -1.0, 20.0, 0.0, 5.0),
    "gate of a sine": (lambda t: gm.where(gm.sin(t) > 0.999999, 1.0, 0.0), 12.0, 4.0 * math.acos(0.999999), None),
    "10 ms": (short(1e-2), 20.0, 0.1, 0.1 * 11.995),
    "1 ms": (short(1e-3), 20.0, 0.01, 0.01 * 11.9995),
    "10 us": (short(1e-5), 20.0, 1e-4, 1e-4 * (12 - 0.5e-5)),
    "two pulses": (lambda t: short(1e-2, 3.0)(t) + short(1e-2, 13.0)(t), 20.0, 0.2, 0.1 * (16.995 + 6.995)),
    "thousand pulses": (lambda t: 1000.0 if t % 0.02 < 1e-3 else 0.0, 20.0, 1000.0, None),
    "at the very start": (lambda t: 10.0 if t < 1e-3 else 0.0, 20.0, 0.01, 0.01 * 19.9995),
    "at the very end": (lambda t: 10.0 if t >= 20 - 1e-3 else 0.0, 20.0, 0.01, 0.5e-5),
    "at the end alone": (lambda t: 1e6 if t >= 20 else gm.sin(t), 20.0, 1 - math.cos(20), 20 - math.sin(20)),
    "after the end": (lambda t: 10.0 if t > 20 else 0.0, 20.0, 0.0, 0.0),
    "of no length": (lambda t: 1e10 if 8 <= t <= 8 else 0.0, 20.0, 0.0, 0.0),
    "twice the same": (lambda t: between(t) + between(t) - between(t), *PULSE),
    "ends where another begins": (lambda t: short(1.0, 5.0)(t) + short(1.0, 6.0)(t), 20.0, 20.0, 10 * 14.5 + 10 * 13.5),
    **{f"bell {w:g} at {c:g}": (bell(w, c), 20.0, w * ROOT_PI, (20 - c) * w * ROOT_PI)
       for w in (0.3, 1e-2, 1e-3, 1e-5) for c in (8.0, 10.0, 5.0, 20 * 0.31)},
    "bells in rhythm": (lambda t: gm.exp(-((gm.sin(math.pi * (t + 2.5) / 5) / 0.01) ** 2)), 20.0, None, None),
    "hyperbola": (lambda t: 1e-5 / (1e-10 + (t - 8) ** 2), 20.0, math.atan(8e5) + math.atan(12e5), None),
    "edges of tanh": (lambda t: 0.5 * (gm.tanh((t - 8) / 1e-3) - gm.tanh((t - 8.01) / 1e-3)), 20.0, 0.01, None),
    "bell on a large sine": (lambda t: 1e2 * gm.sin(t) + bell(1e-3, 10.0)(t), 20.0,
                             1e2 * (1 - math.cos(20)) + 1e-3 * ROOT_PI, None),
    "high power of a sine": (lambda t: gm.sin(math.pi * t / 20) ** 200, 20.0, 20 * math.comb(200, 100) / 2**200, None),
    "piecewise": (lambda t: gm.piecewise(STEPS, t), 20.0, 1.0, 11.995),
    "piecewise with many breaks": (lambda t: gm.piecewise(LADDER, t), 20.0, float(LADDER.integrate(0, 20)), None),
    "spline": (lambda t: gm.piecewise(WAVY, t), 20.0, float(WAVY.integrate(0, 20)),
               float(WAVY.antiderivative().integrate(0, 20))),
    "opaque if": (lambda t: 10.0 if 5 <= float(t) < 6 else 0.0, *PULSE),
    "opaque, at the end alone": (lambda t: 1e6 if float(t) >= 20 else 1.0, 20.0, 20.0, 200.0),
    "opaque, seen by one sample": (lambda t: 10.0 if 5.123 <= float(t) < 5.124 else 0.0, 20.0, 0.01, 0.01 * 14.8765),
    "opaque, with a memory": (Counting(), *PULSE),
    "opaque sine": (lambda t: math.sin(float(t)), 20.0, 1 - math.cos(20), None),
    "opaque bell": (lambda t: math.exp(-(((float(t) - 10) / 0.01) ** 2)), 20.0, 0.01 * ROOT_PI, 0.1 * ROOT_PI),
    "opaque table": (lambda t: float(np.interp(t, *TABLE)), 20.0, 0.01, 0.12),
    "opaque steps": (lambda t: float(int(float(t) / 0.05) % 7), 20.0, float(sum(k % 7 for k in range(400)) * 0.05), None),
}  # fmt: skip


@pytest.fixture(scope="module")
def systems():
    return {name: gauss.compile_scene(slider(case[0])) for name, case in OF_TIME.items()}


def rhythm() -> float:
    """Rate that bells in rhythm give, by quadrature of one: four whole ones are passed in 20 s."""
    s = np.linspace(-0.5, 0.5, 200_001)
    return float(4 * np.trapezoid(np.exp(-((np.sin(np.pi * s / 5) / 0.01) ** 2)), s))


@pytest.mark.parametrize("name", OF_TIME)
def test_laws_of_time_are_right_in_every_call(systems, name):
    _, duration, rate, place = OF_TIME[name]
    rate = rhythm() if rate is None else rate
    kept = slice(1, 2) if place is None else slice(2)
    expected = np.array([place or 0.0, rate])[kept]
    for _ in range(2):
        assert verdict(lambda: moved(systems[name], duration)[kept], expected) == "right"


def test_breaks_are_heeded():
    pulse = lambda t: 1e4 if 8 < float(t) < 8.0001 else 0.0  # noqa: E731
    assert verdict(lambda: moved(slider(pulse), 20.0, breaks=[8.0, 8.0001]), [12 - 0.5e-4, 1.0]) == "right"
    assert verdict(lambda: moved(slider(pulse, breaks=[8.0, 8.0001]), 20.0), [12 - 0.5e-4, 1.0]) == "right"


MOVE = """
name = "cart"
[[body]]
name = "cart"
mass = 2.0
[[joint]]
name = "x"
type = "prismatic"
parent = "ground"
child = "cart"
axis = [1, 0, 0]
[[drive]]
joint = "x"
effort = {{ {profile} }}
"""
# Of the smoothstep s⁵ (126 − …) the mean over the move is one half.
PROFILES = {
    "move": ('profile = "move", start = 0.0, end = 4.0, begin = 8.0, duration = 1.0', 2.0 * 11.5),
    "short move": ('profile = "move", start = 0.0, end = 4.0, begin = 8.0, duration = 1e-3', 2.0 * 11.9995),
    "sine": ('profile = "sine", amplitude = 4.0, frequency = 0.5', 0.0),
    "ramp": ('profile = "ramp", start = -1.0, speed = 0.2', 10.0),
    "polynomial": ('profile = "polynomial", coefficients = [1.0, 0.0, 0.03]', 10.0 + 40.0),
}


@pytest.mark.parametrize("name", PROFILES)
def test_profiles_from_the_command_line(tmp_path, name):
    profile, expected = PROFILES[name]
    (tmp_path / "cart.toml").write_text(MOVE.format(profile=profile), encoding="utf-8")
    motion = tmp_path / "motion.npz"
    for integrator in ((), ("--integrator", "rk4", "--step", "0.01")):
        called = ["run", tmp_path / "cart.toml", "--duration", 20, "--output", motion, *integrator]
        result = CliRunner().invoke(cli.app, [str(argument) for argument in called])
        assert result.exit_code == 0, result.output
        assert np.load(motion)["v"][-1, 0] == pytest.approx(expected, rel=1e-6, abs=1e-9)  # rk4 is of order 4


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1.0, 1e5, 1e9])
@pytest.mark.parametrize("method", [{}, {"integrator": "radau5", "rtol": 1e-9}, {"integrator": "rk4", "step": 0.01}])
def test_times_may_have_any_unit(method, unit):
    """Nothing acts at the start, so that the scene has no time of its own: in units of the duration the motion is one."""
    force = 10.0 / unit**2
    options = method | {"step": 0.01 * unit} if "step" in method else method
    for law in (
        lambda t: force if 0.5 * unit <= t < 0.6 * unit else 0.0,
        lambda t: gm.where(float(t) > 0.5 * unit, force, 0.0),
    ):
        system = slider(law)
        place, rate = moved(system, unit, **options)
        expected = (0.45, 1.0) if law(0.7 * unit) == 0.0 else (1.25, 5.0)
        assert (place, rate * unit) == pytest.approx(expected, rel=1e-8)
