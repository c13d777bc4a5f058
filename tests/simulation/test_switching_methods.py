"""Switching loads under every integrator, from every start, in batches and sweeps: right, or said not to be."""

import warnings

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import BalanceWarning, SwitchingWarning
from gauss.system import State
from tests.support.switching import RELATIVE, ROOT_PI, Counting, bell, beside, between, moved, slider, verdict

FIXED = ("rk4", "semi_implicit_euler", "verlet", "variational_midpoint", "gauss4", "gauss6", "generalised_alpha")
FIXED += ("energy_momentum", "time_stepping")
ADAPTIVE = ("dop853", "dopri5", "radau5")
LIBRARIES = ("scipy_dop853", "scipy_radau", "scipy_lsoda")


# Other methods: of the closed form where they are exact, else warned of.


@pytest.fixture(scope="module")
def pulses():
    return {
        "pulse": (gauss.compile_scene(slider(between)), 10.0),
        "bell": (gauss.compile_scene(slider(bell(3e-3, 10.0))), 3e-3 * ROOT_PI),
        "opaque pulse": (gauss.compile_scene(slider(Counting())), 10.0),
    }


@pytest.mark.slow
@pytest.mark.parametrize("integrator", [*ADAPTIVE, "taylor", *FIXED, *LIBRARIES])
@pytest.mark.parametrize("kind", ["pulse", "bell", "opaque pulse"])
def test_every_method_is_right_or_says_that_it_is_not(pulses, kind, integrator):
    system, expected = pulses[kind]
    options = {"integrator": integrator} | ({"step": 0.01} if integrator in FIXED else {})
    if kind == "opaque pulse" and integrator in ("energy_momentum", "time_stepping"):
        pytest.skip("a Python law in every one of their steps takes seconds")
    for _ in range(2):
        found = verdict(lambda: moved(system, 20.0, **options)[1:], expected, relative=1e-7)  # libraries come less near
        assert found in ("right", "refused", "warned")
        if kind == "pulse" and integrator != "taylor":
            assert found == "right"


@pytest.mark.slow
@pytest.mark.parametrize("integrator", [name for name in FIXED if name != "energy_momentum"])
def test_narrow_places_are_warned_of_by_steps_of_fixed_length(integrator):
    system = gauss.compile_scene(beside(lambda t, m: 1e3 if 3.0003 < m.coordinate("x") < 3.0013 else 0.0))
    for _ in range(2):
        with pytest.warns(SwitchingWarning, match="beside"):
            gauss.simulate(system, 5.0, integrator=integrator, step=0.01, progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("integrator, order", [("rk4", 4), ("gauss4", 4), ("verlet", 2), ("generalised_alpha", 2)])
def test_order_is_kept_across_a_switch(integrator, order):
    """A swinging pendulum whose drive jumps at times that no step ends at, beside the same motion put together in pieces."""
    times = (0.0, 0.3 / 0.7, 0.9 / 0.7, 1.5)

    def pendulum(law):
        scene = gauss.Scene("pendulum")
        scene.body("a", 1.0, (0.1, 0.1, 0.1), com=(0.5, 0, 0))
        scene.revolute("R", "ground", "a", axis=(0, 1, 0))
        scene.drive("R", torque=law)
        return gauss.compile_scene(scene)

    state = None
    for begin, end, torque in zip(times[:-1], times[1:], (0.0, 5.0, -2.0), strict=True):
        motion = gauss.simulate(pendulum(torque), end - begin, state=state, progress=False)
        state = State(end, motion.q[-1], motion.v[-1])
    system = pendulum(lambda t: gm.where(t < times[1], 0.0, gm.where(t < times[2], 5.0, -2.0)))
    assert verdict(lambda: moved(system, 1.5), [state.q[0], state.v[0]]) == "right"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BalanceWarning)  # of order 2
        errors = [abs(moved(system, 1.5, integrator=integrator, step=h)[0] - state.q[0]) for h in (0.02, 0.01)]
    assert errors[0] / errors[1] > 2 ** (order - 0.7)


# Starts and samples.


@pytest.mark.slow
@pytest.mark.parametrize("begin, expected", [(4.9, 10.0), (5.0, 10.0), (5.5, 5.0), (6.0, 0.0), (-3.0, 10.0), (-30.0, 0.0)])
@pytest.mark.parametrize("options", [{}, {"integrator": "rk4", "step": 0.01}, {"integrator": "scipy_dop853"}])
def test_late_and_early_starts(pulses, begin, expected, options):
    start = State(begin, np.zeros(1), np.zeros(1))
    assert verdict(lambda: moved(pulses["pulse"][0], 20.0, state=start, **options)[1:], expected) == "right"


@pytest.mark.parametrize("options", [{}, {"integrator": "radau5"}, {"integrator": "gauss4", "step": 0.3}])
def test_samples_at_switching_times(pulses, options):
    times = [0.0, 5.0, 5.25, 6.0, 7.0]
    motion = gauss.simulate(pulses["pulse"][0], 20.0, times=times, progress=False, **options)
    assert np.array_equal(motion.t, times)
    assert motion.v[:, 0] == pytest.approx([0.0, 0.0, 2.5, 10.0, 10.0], abs=1e-10)
    assert motion.q[:, 0] == pytest.approx([0.0, 0.0, 0.3125, 5.0, 15.0], abs=1e-10)


def test_what_is_verified_is_not_stepped_over(pulses):
    motion = gauss.simulate(pulses["bell"][0], 20.0, verify=True, progress=False)
    assert abs(motion.v[-1, 0] - pulses["bell"][1]) < 1e-9
    assert motion.stats.global_error[1] < 1e-9


ROWS = np.linspace(0.0, 10.0, 41)
VALUES = np.sin(3.0 * ROWS)
SHARE, SMOOTH = 0.1, 1e-12  # least share of an error that is claimed; error [m/s] of steps that end at kinks
WAYS = {  # a table that numpy reads, and whether steps end at its rows
    "kinks": ({}, False),
    "breaks": ({"breaks": ROWS[1:-1].tolist()}, True),
}


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("way", WAYS)
def test_verification_tells_of_kinks_of_opaque_laws(way, rtol):
    given, known = WAYS[way]
    scene = slider(lambda t: float(np.interp(float(t), ROWS, VALUES)), **given)
    motion = gauss.simulate(scene, 10.0, rtol=rtol, verify=True, progress=False)
    error = abs(motion.v[-1, 0] - np.trapezoid(VALUES, ROWS))
    assert (error < SMOOTH) == known
    assert motion.stats.global_error[1] > SHARE * error


# Many motions, and motions in phases.


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pulse", "bell"])
@pytest.mark.parametrize(
    "options", [{"integrator": "dop853", "times": [20.0]}, {"steps": 2000, "step": 0.01, "every": 2000}]
)
def test_batches(pulses, kind, options):
    system, expected = pulses[kind]
    starts = np.array([[0.0], [1.0], [-1.0]])
    right = np.ravel(starts) + expected
    for _ in range(2):
        found = verdict(lambda: gauss.rollout(system, 0.0 * starts, starts, **options).v[:, -1, 0], right)
        assert found == ("warned" if kind == "bell" and "steps" in options else "right")


@pytest.mark.slow
def test_sweeps():
    """Of masses; each motion is its own."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchingWarning)
        found = gauss.sweep(
            slider(between),
            {"b.mass": [1.0, 2.0, 4.0]},
            20.0,
            measure={"final": lambda motion: float(motion.v[-1, 0])},
            progress=False,
        )
    assert [float(value) for value in found["final"]] == pytest.approx([10.0, 5.0, 2.5], rel=RELATIVE)
