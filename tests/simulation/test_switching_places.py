"""Loads that depend on places and rates: no step passes their switching unnoticed.

Motions have closed forms; sliding modes and opaque laws are refused or warned of.
"""

import math
import warnings

import numpy as np
import pytest
from scipy.integrate import quad

import gauss
from gauss import math as gm
from gauss.errors import GaussError, SwitchingWarning
from tests.support.switching import ROOT_PI, STEPS, bell, beside, moved, slider, verdict

# Laws of the place x = t of a body, the duration, and the rate that they give to another body.
OF_PLACE = {
    "narrow": (lambda t, m: 100.0 if 33 < m.coordinate("x") < 33.01 else 0.0, 50.0, 1.0),
    "narrow in the middle": (lambda t, m: gm.where(abs(m.coordinate("x") - 25) < 1e-3, 1e3, 0.0), 50.0, 2.0),
    "tent": (lambda t, m: gm.maximum(0.0, 1 - abs(m.coordinate("x") - 25) / 0.01), 50.0, 0.01),
    "teeth": (lambda t, m: 10.0 if m.coordinate("x") % 1.0 < 0.05 else 0.0, 19.5, 10.0),
    "stairs": (lambda t, m: np.floor(m.coordinate("x") / 10), 50.0, 100.0),
    "time and place": (lambda t, m: 10.0 if t > 30 and m.coordinate("x") < 30.01 else 0.0, 50.0, 0.1),
    "time and place at once": (lambda t, m: 10.0 if t > 30 and m.coordinate("x") > 30 else 0.0, 50.0, 200.0),
    "gate that moves": (lambda t, m: 100.0 if 0 < m.coordinate("x") - 20 - 0.5 * t < 0.005 else 0.0, 50.0, 1.0),
    "bell": (lambda t, m: bell(0.01, 33.0)(m.coordinate("x")), 50.0, 0.01 * ROOT_PI),
    "bell in the middle": (lambda t, m: bell(1e-3, 25.0)(m.coordinate("x")), 50.0, 1e-3 * ROOT_PI),
    "piecewise of a place": (lambda t, m: gm.piecewise(STEPS, m.coordinate("x")), 19.0, 1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_PLACE)
def test_places_are_never_flown_past(name):
    law, duration, expected = OF_PLACE[name]
    system = gauss.compile_scene(beside(law))
    for _ in range(2):
        assert verdict(lambda: gauss.simulate(system, duration, progress=False).v[-1, 1], expected) == "right"


def oscillator(law):
    """A kilogram that starts at x = 1 m, and a force that brings it back."""
    scene = slider(law)
    scene.start("x", position=1.0)
    return scene


def test_a_spring_that_acts_past_a_gap():
    """Beyond ±0.5 m it is 100 N/m: half a turn of the spring, a flight of 1 m, and so on."""
    flat = lambda x: gm.maximum(x - 0.5, 0.0) - gm.maximum(-0.5 - x, 0.0)  # noqa: E731
    scene = oscillator(lambda t, m: -100.0 * flat(m.coordinate("x")))
    period = 2.0 * (math.pi / 10.0) + 2.0 / 5.0  # the speed of the flight is 0.5 m times 10 rad/s
    assert verdict(lambda: moved(scene, 3 * period), [1.0, 0.0]) == "right"


@pytest.mark.slow
def test_a_controller_that_saturates_and_one_with_a_dead_zone():
    """Full force 1 N until 0.5 m, its opposite after it: at rest in the middle; the dead zone is flown through."""
    bang = oscillator(lambda t, m: gm.clip(-1e3 * m.coordinate("x"), -1.0, 1.0))
    until = math.sqrt(2.0 * (1.0 - 1e-3))
    assert verdict(lambda: moved(bang, until), [1e-3, -until]) == "right"
    dead = lambda x: 0.0 if abs(x) < 0.25 else -2.0 * gm.sign(x)  # noqa: E731
    fast = math.sqrt(2 * 2.0 * 0.75)
    quarter = fast / 2.0
    assert (
        verdict(lambda: moved(oscillator(lambda t, m: dead(m.coordinate("x"))), 2 * quarter + 0.5 / fast), [-1.0, 0.0])
        == "right"
    )


@pytest.mark.slow
def test_friction_by_the_sign_of_a_rate_ends_in_words():
    for law in (
        lambda t, m: -2.0 * gm.sign(m.rate("x")),
        lambda t, m: -2.0 if m.rate("x") > 0 else 2.0,
    ):
        system = gauss.compile_scene(slider(law, rate=1.0))
        assert verdict(lambda system=system: moved(system, 0.4), [0.24, 0.2]) == "right"
        for _ in range(2):
            with pytest.raises(GaussError, match=r"drive of x.*sign of a rate"):
                moved(system, 1.0)


@pytest.mark.slow
def test_a_sliding_mode_between_events_ends_in_words_before_its_steps_take_hours():
    """At a coarse tolerance steps across the jump are longer than time asks for: 5e6 of them lead to the end."""
    scene = slider(lambda t, m: -2.0 * gm.sign(m.rate("x")) - 1.0 * m.coordinate("x"), rate=0.3)
    scene.stop("x", highest=10.0)
    with pytest.raises(GaussError, match=r"drive of x.*sign of a rate"):
        gauss.simulate(scene, 1.0, rtol=1e-7, atol=1e-7, progress=False)


@pytest.mark.slow
def test_an_opaque_law_that_jumps_at_a_place_is_crossed():
    """Its jump is met by steps as short as time allows, and places that may be missed are warned of."""
    system = gauss.compile_scene(beside(lambda t, m: 100.0 if float(m.coordinate("x")) > 3 else 0.0))
    assert verdict(lambda: gauss.simulate(system, 5.0, integrator="dopri5", progress=False).v[-1, 1], 200.0) == "right"
    system = gauss.compile_scene(beside(lambda t, m: 100.0 if 3 < float(m.coordinate("x")) < 3.001 else 0.0))
    for _ in range(2):
        with pytest.warns(SwitchingWarning, match="drive of y"):
            gauss.simulate(system, 5.0, progress=False)


# Narrow smooth forces of u, the distance from a place in widths of 0.05 m: quotients, powers, differences of steps.
NARROW = {
    "cubed": lambda u: 1.0 / (1.0 + u * u) ** 3,
    "twentieth power": lambda u: 1.0 / (1.0 + u * u) ** 20,
    "power of a quotient": lambda u: (1.0 / (1.0 + u * u)) ** 30,
    "root": lambda u: 1.0 / np.sqrt(1.0 + u * u) ** 6,
    "steps that cancel": lambda u: (u + 1) / np.sqrt((u + 1) ** 2 + 1e-4) - (u - 1) / np.sqrt((u - 1) ** 2 + 1e-4),
}


@pytest.mark.slow
@pytest.mark.parametrize("shape", NARROW)
def test_narrow_quotients_are_never_flown_past(shape):
    """The place varies, for samples may lie on the peak by chance; half of v² is the work, by quadrature."""
    for at in 50.0 + 5.0 * np.sin(1.7 * np.arange(3)):
        scene = slider(lambda t, m, at=at: 10.0 * NARROW[shape]((m.coordinate("x") - at) / 0.05), rate=3.0)
        motion = gauss.simulate(scene, 20.0, rtol=1e-10, atol=1e-10, progress=False)
        points = [at + d for d in (-1.0, -0.1, -0.06, -0.05, -0.04, 0.0, 0.04, 0.05, 0.06, 0.1, 1.0)]
        work = quad(lambda x, at=at: 10.0 * NARROW[shape]((x - at) / 0.05), 0.0, motion.q[-1, 0], points=points, limit=500)[
            0
        ]
        assert motion.v[-1, 0] == pytest.approx(np.sqrt(9.0 + 2.0 * work), rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("shape", NARROW)
@pytest.mark.parametrize("backend", ["auto", "recursion"])
def test_fixed_steps_over_a_narrow_peak_are_warned_of(shape, backend):
    """The peak is half a step wide; the same law at a place that is not reached is no cause of a warning."""
    for at, warned in ((3.0 + 0.7, True), (100.0, False)):
        scene = slider(lambda t, m, at=at: 10.0 * NARROW[shape]((m.coordinate("x") - at) / 0.05), rate=1.0)
        for _ in range(2):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                gauss.simulate(scene, 5.0, integrator="rk4", step=0.1, backend=backend, progress=False)
            assert any(issubclass(each.category, SwitchingWarning) for each in caught) == warned


@pytest.mark.slow
def test_steps_that_resolve_a_peak_are_not_warned_of():
    for shape in NARROW.values():
        scene = slider(lambda t, m, shape=shape: 10.0 * shape((m.coordinate("x") - 3.7) / 0.05), rate=1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            gauss.simulate(scene, 5.0, integrator="rk4", step=5e-4, progress=False)


# Narrow bumps of a guide, 0.05 m high; each with its slope.
DELAYS = 3e-8  # [m] at a rate of 1 m/s: a hundred times atol, and the tails of a quotient
BUMPS = {
    "quotient": (lambda u: 0.05 / (1 + u * u) ** 3, lambda u: -0.3 * u / (1 + u * u) ** 4),
    "bell": (lambda u: 0.05 * gm.exp(-u * u), lambda u: -0.1 * u * np.exp(-u * u)),
    "piece": (
        lambda u: gm.where(abs(u) < 1.0, 0.05 * (1 - u * u) ** 3, 0.0),
        lambda u: -0.3 * u * (1 - u * u) ** 2 * (abs(u) < 1.0),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.002, 0.02])
@pytest.mark.parametrize("bump", BUMPS)
@pytest.mark.parametrize("integrator", ["dop853", "radau5"])
def test_bumps_of_a_constraint_are_never_passed_over(bump, width, integrator):
    """Of (1 + f′²) ẋ² = 1 follows the delay ∫ (√(1 + f′²) − 1) dx, by quadrature."""
    height, slope = BUMPS[bump]
    scene = gauss.Scene("guide", gravity=(0.0, 0.0, 0.0))
    for name, axis in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0))):
        scene.body(f"body of {name}", 1.0)
        scene.prismatic(name, "ground", f"body of {name}", axis=axis)
    scene.start("x", rate=1.0)
    scene.constrain("guide", lambda view: view.coordinate("y") - height((view.coordinate("x") - 6.1) / width))
    motion = gauss.simulate(scene, 20.0, integrator=integrator, rtol=1e-10, atol=1e-10, progress=False)
    delay = quad(
        lambda u: width * (np.sqrt(1.0 + (slope(u) / width) ** 2) - 1.0), -30.0, 30.0, points=[-1, 0, 1], limit=500
    )[0]
    assert delay > 1e3 * DELAYS  # a bump that is passed over delays nothing
    assert motion.q[-1, 0] == pytest.approx(20.0 - delay, abs=DELAYS)


def _carriage(press=0.0, mass=0.5):
    """Half a kilogram on a rail at 1 m/s, and another across it, on which a force may press."""
    scene = gauss.Scene("carriage", gravity=(0.0, 0.0, 0.0))
    for name in ("carriage", "slide"):
        scene.body(name, mass)
    scene.prismatic("x", "ground", "carriage", axis=(1.0, 0.0, 0.0))
    scene.prismatic("y", "carriage", "slide", axis=(0.0, 1.0, 0.0))
    scene.start("x", rate=1.0)
    if press:
        scene.drive("y", force=-press)
    return scene


def _bell(x, width=0.002, height=0.05):
    return height * gm.exp(-(((x - 6.1) / width) ** 2))


WAYS = {  # in which a function of the user leads the slide
    "constraint": lambda scene: scene.constrain("guide", lambda at: at.coordinate("y") - _bell(at.coordinate("x"))),
    "cam": lambda scene: scene.cam("guide", "x", "y", _bell),
    "curve": lambda scene: scene.on_curve("guide", "slide", "ground", lambda p: p[1] - _bell(p[0])),
    "mode": lambda scene: scene.constrain(  # a kink far behind divides the motion into modes
        "guide", lambda at: at.coordinate("y") - _bell(at.coordinate("x")) - gm.maximum(0.0, at.coordinate("x") - 40.0)
    ),
}


def _delay(width=0.002, height=0.05):
    """Delay on the bell at the pace √(2 energy) = 1 m/s, of (1 + f′²/2) ẋ² = 1."""
    slope = lambda u: -2.0 * height / width * u * np.exp(-u * u)  # noqa: E731
    return quad(lambda u: width * (np.sqrt(1.0 + 0.5 * slope(u) ** 2) - 1.0), -9.0, 9.0, points=[-1, 0, 1], limit=500)[0]


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "taylor"])
@pytest.mark.parametrize("way", WAYS)
def test_bumps_are_met_however_a_function_of_the_user_leads(way, integrator):
    scene = _carriage()
    WAYS[way](scene)
    motion = gauss.simulate(scene, 20.0, integrator=integrator, rtol=1e-10, atol=1e-10, progress=False)
    assert motion.q[-1, 0] == pytest.approx(20.0 - _delay(), abs=DELAYS)


@pytest.mark.slow
def test_bumps_are_met_in_sweeps():
    """The delay does not depend on the mass."""

    def scene(mass):
        made = _carriage(mass=mass)
        made.cam("guide", "x", "y", _bell)
        return made

    for together in (False, True):
        found = gauss.sweep(scene, {"mass": [0.5, 2.0]}, 20.0, together=together, samples=3, rtol=1e-10, progress=False)
        assert found.q[:, -1, 0].to_numpy() == pytest.approx(20.0 - _delay(), abs=DELAYS)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_transmissions_with_a_ratio_at_one_place_turn_there(integrator):
    """ẏ = f(x) ẋ: y is the integral of the ratio."""
    scene = _carriage()
    scene.transmission("guide", "y", "x", lambda at: _bell(at.coordinate("x")))
    motion = gauss.simulate(scene, 20.0, integrator=integrator, rtol=1e-10, atol=1e-12, progress=False)
    assert motion.q[-1, 1] == pytest.approx(0.05 * 0.002 * ROOT_PI, rel=1e-6)


@pytest.mark.slow
def test_bumps_are_met_while_a_gap_of_the_user_is_closed():
    """Energy ½ (1 + f′²/2) ẋ² + P f is kept; the force P holds the slide on the bump."""
    press, width, height = 1e5, 5e-3, 1e-6
    scene = _carriage(press=press)
    scene.one_sided("guide", lambda at: at.coordinate("y") - _bell(at.coordinate("x"), width, height))
    motion = gauss.simulate(scene, 20.0, rtol=1e-10, atol=1e-12, progress=False)

    def late(u):
        f, slope = height * np.exp(-u * u), -2.0 * height / width * u * np.exp(-u * u)
        return width * (np.sqrt((1.0 + 0.5 * slope**2) / (1.0 - 2.0 * press * f)) - 1.0)

    delay = quad(late, -9.0, 9.0, points=[-1, 0, 1], limit=500)[0]
    assert delay > 1e4 * DELAYS
    assert motion.q[-1, 0] == pytest.approx(20.0 - delay, abs=DELAYS)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["cvode_bdf", "scipy_lsoda"])
def test_opaque_laws_of_places_that_other_libraries_pass_over_are_warned_of(integrator):
    system = gauss.compile_scene(beside(lambda t, m: math.exp(-(((float(m.coordinate("x")) - 7.31) / 0.005) ** 2))))
    for _ in range(2):
        found = verdict(lambda: moved(system, 20.0, integrator=integrator, rtol=1e-8)[3:], [0.005 * ROOT_PI])
        assert found in ("warned", "right")
