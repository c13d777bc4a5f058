"""Poses and velocities of one state: what the public name gives is what the laws are given, and closed forms."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.dynamics.kinematics import kinematics

ROUNDING = 1e-14  # relative: a dozen products and sums of numbers of size one
DIFFERENCE = 1e-9  # error of a central difference of step 1e-6, of motions of size and speed one

SCENES = ["pendulum", "double_pendulum", "four_bar", "slider_crank", "cardan"]


def _moving(name: str):
    """System and a state of it that moves."""
    system = gauss.compile_scene(gauss.load(name))
    start = system.initial_state()
    return system, system.state(start.q, np.linspace(0.5, 1.0, system.n_v), start.t)


def test_a_turning_body_is_where_the_angle_says():
    scene = gauss.Scene("one")
    arm = scene.body("a", mass=1, inertia=(1, 1, 1))
    scene.revolute("J", "ground", arm)
    system = gauss.compile_scene(scene)
    angle, rate = 0.7, 2.0
    found = gauss.Kinematics(system, system.state([angle], [rate]))
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(found.position("a", (1, 0, 0)), [c, s, 0], atol=ROUNDING)
    np.testing.assert_allclose(found.velocity("a", (1, 0, 0)), [-rate * s, rate * c, 0], atol=2 * ROUNDING)
    np.testing.assert_allclose(found.angular_velocity("a"), [0, 0, rate], atol=2 * ROUNDING)
    np.testing.assert_allclose(found.rotation("a"), [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=ROUNDING)


@pytest.mark.parametrize("name", SCENES)
def test_the_public_name_gives_what_the_dynamics_use(name):
    system, state = _moving(name)
    found, used = gauss.Kinematics(system, state), kinematics(system, state)
    for field in ("R", "x", "W", "u"):
        np.testing.assert_array_equal(getattr(found, field), getattr(used, field))
    assert len(found.joints) == len(used.joints) == len(system.joints)


@pytest.mark.parametrize("name", ["double_pendulum", "n_pendulum"])
def test_velocities_are_the_rates_of_positions(name):
    system, state = _moving(name)
    h = 1e-6
    ahead, behind = (gauss.Kinematics(system, system.state(state.q + s * h * state.v, state.v)) for s in (1, -1))
    now = gauss.Kinematics(system, state)
    for body in system.structure.bodies:
        slope = (ahead.position(body) - behind.position(body)) / (2 * h)
        np.testing.assert_allclose(now.velocity(body), slope, atol=DIFFERENCE)


def test_what_is_asked_first_does_not_change_the_answers():
    system, state = _moving("double_pendulum")
    body = system.structure.bodies[-1]
    asked = [gauss.Kinematics(system, state) for _ in range(4)]
    first = [asked[0].R, asked[1].u, asked[2].joints, asked[3].quasi_velocities()]
    assert all(part is not None for part in first)
    for one in asked[1:]:
        np.testing.assert_array_equal(one.position(body), asked[0].position(body))
        np.testing.assert_array_equal(one.velocity(body), asked[0].velocity(body))


def test_threads_that_ask_at_once_see_whole_poses():
    system, state = _moving("double_pendulum")
    expected = kinematics(system, state).x
    with ThreadPoolExecutor(4) as pool:
        for _ in range(50):
            shared = gauss.Kinematics(system, state)
            for found in pool.map(lambda _, shared=shared: list(shared.x), range(4)):
                np.testing.assert_array_equal(found, expected)


def test_a_clutch_whose_torque_asks_where_bodies_are_slips_with_that_torque():
    """The law sees the poses of its state in the audit of forces, too, not a body at the origin."""
    scene = gauss.Scene("clutch")
    for name in ("a", "b"):
        scene.revolute(f"of {name}", "ground", scene.body(name, mass=1, inertia=(1, 1, 1)))
    scene.clutch("C", "of a", "of b", torque=lambda t, motion: 2.0 + motion.position("a", (1, 0, 0))[0], hold=4.0)
    angle = 0.6
    system = gauss.compile_scene(scene)
    trajectory = gauss.simulate(system, 0.05, state=system.state([angle, 0.0], [3.0, 0.0]), times=[0.0], progress=False)
    force = gauss.set_valued_forces(trajectory, "C")
    np.testing.assert_allclose(abs(force[0]), 2.0 + np.cos(angle), rtol=1e-12)


def test_the_former_name_is_the_same_and_says_so():
    with pytest.warns(DeprecationWarning, match="Kinematics"):
        assert gauss.Motion is gauss.Kinematics
    scene = gauss.load("four_bar")
    with pytest.warns(DeprecationWarning, match=r"Scene.grips is called Scene.set_valued now"):
        assert scene.grips is scene.set_valued


def test_a_state_of_another_system_is_refused():
    system, _ = _moving("double_pendulum")
    _, other = _moving("pendulum")
    with pytest.raises(gauss.GaussError, match="double pendulum"):
        gauss.Kinematics(system, other).position("ground")


def test_a_law_may_ask_the_kinematics_of_symbols():
    """Traced laws see the same poses as numbers do."""
    scene = gauss.Scene("one")
    arm = scene.body("a", mass=1, inertia=(1, 1, 1))
    scene.revolute("J", "ground", arm)
    scene.drive("J", torque=lambda t, motion: math.sin(t) - motion.position("a", (1, 0, 0))[0])
    system = gauss.compile_scene(scene)
    state = system.state([0.3], [0.0], 0.5)
    np.testing.assert_allclose(system.accelerations(state), np.sin(0.5) - np.cos(0.3), rtol=1e-13)
