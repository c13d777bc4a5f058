"""Local errors in the units of the user: for all coordinates, for a kind, for a joint."""

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError
from gauss.simulation.tolerances import tolerance
from tests.support import mechanisms

FINE = 1e-10


def _steps(scene, atol, **options) -> int:
    return gauss.simulate(scene, 1.0, rtol=1e-15, atol=atol, **options).stats.steps


def test_kinds_and_joints_are_told_apart():
    system = gauss.compile_scene(gauss.load("cart_pole"))
    rail, pin = (system.joint(name).v.start for name in ("rail", "pin"))
    shares = tolerance(system, 1e-9, {"pin": (1e-5, 1e-4), "angle": 1e-7, "length": 1e-6}).shares
    assert shares[:, pin].tolist() == [1e-5, 1e-4] and shares[:, rail].tolist() == [1e-6, 1e-6]
    default = [1e-12 * system.scale.length, 1e-12 * system.scale.speed]
    assert tolerance(system, 1e-9, {"angle": 1e-7}).shares[:, rail] == pytest.approx(default, rel=1e-15)
    assert tolerance(system, 1e-9, (1e-7, 1e-6)).shares is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "integrator", ["dop853", "dopri5", "radau5", "scipy_dop853"], ids=["rows", "pair", "implicit", "library"]
)
def test_what_may_be_coarse_saves_steps(integrator):
    scene, run = gauss.load("cart_pole"), {"integrator": integrator}
    same = _steps(scene, {"angle": FINE, "length": FINE}, **run)
    assert same == _steps(scene, FINE, **run)
    assert _steps(scene, {"pin": 1e-4, "length": 1e-4}, **run) < _steps(scene, {"pin": 1e-4, "rail": FINE}, **run) <= same


@pytest.mark.slow
def test_directions_of_a_quaternion_are_angles():
    body = gauss.load("free_body")
    system = gauss.compile_scene(body)
    shares = tolerance(system, 1e-9, {"length": 1e-3, "angle": 1e-8}).shares
    assert shares[0].tolist() == [1e-3] * 3 + [1e-8] * 3
    exact = gauss.simulate(system, 1.0, times=[1.0])
    for integrator in ("dop853", "scipy_dop853"):
        options = {"rtol": 1e-15, "atol": {"length": 1e-3, "angle": 1e-8}, "times": [1.0], "integrator": integrator}
        assert gauss.simulate(system, 1.0, **options).q[0] == pytest.approx(exact.q[0], abs=1e-5)


@pytest.mark.slow
def test_certified_and_many_motions_take_the_same():
    scene, atol = mechanisms.rods(2), {"J1": 1e-5, "J2": (1e-9, 1e-8)}
    system = gauss.compile_scene(scene)
    start, run = system.initial_state(), {"rtol": 1e-15, "atol": atol, "times": [0.5]}
    compiled = gauss.simulate(system, 0.5, **run)
    certified = gauss.simulate(system, 0.5, backend="recursion", **run)
    many = gauss.rollout(system, [start.q] * 3, [start.v] * 3, integrator="dop853", **run)
    assert compiled.stats.steps == certified.stats.steps == many.steps[1]
    assert compiled.q[-1] == pytest.approx(certified.q[-1], abs=1e-12) == many.q[1, -1]


@pytest.mark.slow
def test_it_is_kept_with_the_motion_and_verified():
    atol = {"angle": 1e-7}
    motion = gauss.simulate(mechanisms.rods(2), 0.5, rtol=1e-9, atol=atol, verify=True)
    assert motion.settings["atol"] == atol and 0.0 < motion.stats.global_error[0] < 1e-5
    assert "1e-07" in gauss.to_dataset(motion).attrs["setting_atol"]


@pytest.mark.parametrize(
    "atol, words",
    [
        ({"elbow": 1e-6}, "no joint 'elbow', and no kind of coordinates of this name. Known: J1, angle, length"),
        ({"J1": 0.0}, "atol of 'J1': expected a positive number, got 0.0"),
        ({"angle": (1.0, np.nan)}, "atol of 'angle': expected a positive number"),
        ({"J1": "fine"}, "atol of 'J1': expected a positive number, got 'fine'"),
        ({"J1": (1.0, 2.0, 3.0)}, "atol of 'J1': expected a number, or a pair"),
        ({3: 1.0}, "no joint 3"),
        ("fine", "atol: expected a positive number"),
    ],
)
def test_wrong_tolerances_are_refused(atol, words):
    with pytest.raises(SimulationError, match=words):
        gauss.simulate(mechanisms.rods(1), 0.1, atol=atol)


ROUND_OFF_START = 1e-15  # coordinates at rest that are zero but for round-off: 1e-3 of the tolerances below
ROUND_OFF_REACHED = 1e-9  # of two motions whose steps differ


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "four_bar"])
@pytest.mark.parametrize("run", ["simulate", "rollout"])
def test_a_rest_that_is_zero_but_for_round_off_moves_as_from_zero(name, run):
    scene = gauss.load(name)
    scene.starts.clear()
    system = gauss.compile_scene(scene)
    zero = system.initial_state()

    def end(q):
        if run == "rollout":
            found = gauss.rollout(system, q[None], 0.0 * zero.v[None], integrator="dop853", times=[0.0, 0.2])
            return found.q[0, -1]
        return gauss.simulate(system, 0.2, state=system.state(q, 0.0 * zero.v), progress=False).q[-1]

    assert end(zero.q + ROUND_OFF_START) == pytest.approx(end(zero.q), abs=ROUND_OFF_REACHED)


@pytest.mark.slow
def test_a_phase_begins_at_rest_in_every_run_of_a_system():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    scene.stop("A", lowest=-0.2, name="buffer")
    system = gauss.compile_scene(scene)
    first, *later = [
        gauss.simulate(system, 0.3, progress=False).q[-1] for _ in range(3)
    ]  # by compiled phases from the second on
    for one in later:
        assert one == pytest.approx(first, abs=ROUND_OFF_REACHED)
