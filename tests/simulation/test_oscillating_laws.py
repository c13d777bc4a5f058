"""Laws that oscillate faster than fixed steps sample them are another, slower force to the method: said at every call."""

import warnings

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.dynamics.laws.step_sampling import coarse_steps
from gauss.errors import SwitchingWarning

STEP, STEPS, RATE = 0.01, 40, 1.0
FAST = {  # periods within a step, which three samples at its ends and in the middle may take for any other
    "time": lambda t: 10.0 * math.sin(2.0 * math.pi * 1003.3 * t),
    "time, periods of a step": lambda t: 10.0 * math.cos(2.0 * math.pi * 800.0 * t),
    "opaque": lambda t: 10.0 * np.cos(2.0 * np.pi * 800.0 * float(t)),
    "place": lambda t, motion: 10.0 * math.cos(2.0 * math.pi * 800.0 * motion.coordinate("rail")),
}
SLOW = {
    "time": lambda t: 10.0 * math.sin(2.0 * math.pi * 12.0 * t),
    "opaque": lambda t: 10.0 * np.sin(2.0 * np.pi * 12.0 * float(t)),
    "place": lambda t, motion: 10.0 * math.sin(2.0 * math.pi * 12.0 * motion.coordinate("rail")),
    "a ripple of no account": lambda t: 10.0 + 1e-7 * math.sin(2.0 * math.pi * 800.0 * t),
}
REACHES = {  # law of time → time from which steps are too long for it [s]
    "chirp": (lambda t: np.sin(400.0 * t * t), 2.3 / (2.0 * 400.0 * STEP)),
    "root": (np.sqrt, np.inf),
    "parabola": (lambda t: 1e6 * t * t, np.inf),
}


def _pushed(law) -> gauss.Scene:
    scene = gauss.Scene("pushed", gravity=(0, 0, 0))
    scene.body("cart", 2.0)
    scene.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
    scene.start("rail", rate=RATE)
    scene.drive("rail", force=law)
    return scene


def _moved(integrator: str):
    return lambda scene: gauss.simulate(scene, STEPS * STEP, integrator=integrator, step=STEP, progress=False)


def _rolled_out(scene):
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    return gauss.rollout(system, start.q[None], start.v[None], step=STEP, steps=STEPS)


def _stepped(scene):
    gauss.Simulator(scene, STEP).step(n=STEPS)


ROUTES = {"rk4": _moved("rk4"), "rollout": _rolled_out, "simulator": _stepped}
ROUTES |= {name: _moved(name) for name in ("time_stepping", "verlet", "gauss4")}
CASES = [(law, route) for law in FAST for route in ROUTES if not (law == "opaque" and route in ("verlet", "gauss4"))]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "route"), CASES)
def test_an_oscillation_within_steps_is_warned_of_by_every_call(law, route):
    scene = _pushed(FAST[law])
    for _ in range(2):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", category=gauss.errors.BalanceWarning)
            with pytest.warns(SwitchingWarning):
                ROUTES[route](scene)


@pytest.mark.slow
@pytest.mark.parametrize("law", SLOW)
@pytest.mark.parametrize("route", ["rk4", "rollout", "simulator", "time_stepping"])
def test_an_oscillation_that_steps_resolve_is_not(law, route):
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchingWarning)
        ROUTES[route](_pushed(SLOW[law]))


@pytest.mark.parametrize("name", REACHES)
def test_steps_become_too_long_where_the_law_becomes_fast(name):
    law, reach = REACHES[name]
    count, first = coarse_steps(lambda times: law(times)[:, None], 0.0, 1.0, STEP, np.zeros(0))
    assert (count == 0) == np.isinf(reach)
    assert first == reach or first == pytest.approx(reach, rel=0.3)
