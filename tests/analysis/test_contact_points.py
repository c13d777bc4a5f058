"""Contacts of one sample: geometry by the shapes' own functions, forces by Newton's law, friction against the slip."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import dominoes, floor, free_body, stack
from gauss.dynamics.contact.contact_geometry import contact_geometry
from gauss.dynamics.kinematics import kinematics
from gauss.errors import StateError
from gauss.system import sides

STEP, GRAVITY = 1e-3, np.array([0.0, 0.0, -9.81])  # [s], [m/s²]
SAME = 1e-12  # [m]: kernels against the functions of the shapes they are made of
LAWS = 1e-6  # [N] of 10 N: the laws of a step are met to 1e-10 of speeds of 1 m/s, over steps of 1 ms, for 1 kg
EXPECTED = 1e-3  # relative: a step of the motion expects the forces of the step before, that of one sample its own
REACH = 0.05  # [m]


def stepped(scene, duration: float, **options):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=STEP, **options)


def solids():
    """Bodies of all shapes above a floor, none of them aligned with another."""
    rng, scene = np.random.default_rng(3), floor("solids")
    for k in range(8):
        turn = rng.normal(size=4)
        free_body(scene, f"body {k}", 0.01, (0.15 * k, 0.02 * k, 0.1), turn=tuple(turn / np.linalg.norm(turn)))
    scene.sphere("sphere", "body 0", 0.1)
    scene.capsule("capsule", "body 1", 0.05, 0.1, axis=(0, 1, 0))
    scene.box("box", "body 2", (0.1, 0.15, 0.2))
    scene.cylinder("cylinder", "body 3", 0.08, 0.1)
    scene.cone("cone", "body 4", 0.08, 0.15)
    scene.ellipsoid("ellipsoid", "body 5", (0.05, 0.08, 0.1))
    scene.mesh("mesh", "body 6", 0.05 * rng.normal(size=(12, 3)))
    scene.points("points", "body 7", 0.05 * rng.normal(size=(4, 3)))
    scene.contacts_all(friction=0.3)
    return gauss.compile_scene(scene)


@pytest.mark.slow
def test_gaps_points_and_normals_are_those_of_the_shapes():
    system = solids()
    geometry, motion = contact_geometry(system), kinematics(system, system.initial_state())
    found = geometry.find(motion, REACH)
    assert len({geometry.contact_of(place)[0].shape for place in found.place}) > 4
    for place, width, point, normal in zip(*found, strict=True):
        contact, number = geometry.contact_of(place)
        expected = contact.places(system.scene)[number].touch(motion)
        if "mesh" not in contact.name and contact.name != "cylinder on box":  # numbers in patches depend on the reach
            assert width == pytest.approx(expected.gap, abs=SAME)
            np.testing.assert_allclose([point, normal], [expected.place, expected.normal], atol=SAME)
        assert sides(system.scene)[place].name == contact.sides(system.scene)[number]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "mass", "tolerance"),
    [(stack(3), 1.0, LAWS), (dominoes(3, push=3.0), 0.1, EXPECTED)],
    ids=["stack", "dominoes"],
)
def test_forces_of_a_sample_change_the_momentum_of_each_body_in_the_step_that_follows(scene, mass, tolerance):
    motion = stepped(scene, 0.2)
    for sample in (0, 90, 150):
        found = gauss.contact_points(motion, sample)
        assert found.t == motion.t[sample]
        for name in scene.bodies:
            one, other = np.array(found.bodies).T == name
            pushed = found.force[one].sum(axis=0) - found.force[other].sum(axis=0)
            rate = motion.rate(f"{name} floats")[:, :3]
            change = mass * (rate[sample + 1] - rate[sample]) / STEP
            np.testing.assert_allclose(pushed, change - mass * GRAVITY, atol=tolerance * max(1.0, np.abs(pushed).max()))


@pytest.mark.slow
def test_friction_of_a_block_that_slides_is_against_its_slip():
    motion = stepped(gauss.load("block_on_incline"), 0.05)
    found = gauss.contact_points(motion, 20)
    (friction,) = {contact.friction for contact in motion.system.scene.contacts.values()}
    speed = np.linalg.norm(found.slip, axis=1)
    assert len(found) == 4 and (speed > 0.1).all()
    expected = -friction * found.normal_force[:, None] * found.slip / speed[:, None]
    np.testing.assert_allclose(found.friction, expected, atol=LAWS)
    np.testing.assert_allclose((found.slip * found.normal).sum(axis=1), 0.0, atol=SAME)


@pytest.mark.slow
def test_a_motion_between_events_has_the_forces_of_rest_and_none_in_flight():
    scene = floor("ball")
    scene.free("F", "ground", scene.body("ball", 1.0, (0.004,) * 3, position=(0, 0, 0.3)), at=(0, 0, 0.3))
    scene.sphere("round", "ball", radius=0.1)
    scene.contact("bounce", "round", "floor", restitution=0.5)
    motion = gauss.simulate(scene, 2.0, times=[0.0, 2.0])
    assert not len(gauss.contact_points(motion, 0))
    found = gauss.contact_points(motion, -1)
    (name,) = found.names
    np.testing.assert_allclose(found.normal_force, gauss.contact_forces(motion, name)[-1], rtol=SAME)


@pytest.mark.slow
def test_nothing_touches_in_flight():
    scene = floor("ball")
    free_body(scene, "ball", 0.004, (0.0, 0.0, 1.0))
    scene.sphere("round", "ball", 0.1)
    scene.contacts_all(friction=0.5)
    found = gauss.contact_points(stepped(scene, 2 * STEP), 0)
    assert not len(found) and found.force.shape == found.slip.shape == (0, 3)


def test_a_sample_beyond_the_motion_is_refused():
    motion = stepped(gauss.load("block_on_incline"), 0.002)
    with pytest.raises(StateError, match="from 0 to 2, got 3"):
        gauss.contact_points(motion, 3)
