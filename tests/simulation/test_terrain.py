"""Motions on height fields, against planes, closed forms and coal's distances."""

import coal
import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import free_body
from gauss.rotations import from_quaternion
from gauss.scene.contact_patch import solid_of
from gauss.scene.patch_distances import axes_of
from tests.support.terrain import in_coal

pytestmark = pytest.mark.slow

STEP, G, FRICTION, RADIUS = 1e-3, 9.81, 0.4, 0.1
AS_ON_A_PLANE = 1e-8  # relative: nothing catches on the edges of triangles of one plane
PENETRATION = 2e-5  # [m] of bodies that hop over edges at 2 m/s: of the order of (G h²), and of the turn within a step
SOLIDS = {
    "ball": lambda scene, name, body: scene.sphere(name, body, RADIUS),
    "capsule": lambda scene, name, body: scene.capsule(name, body, RADIUS, 0.1, axis=(1, 0, 0)),
    "box": lambda scene, name, body: scene.box(name, body, (2 * RADIUS, 1.5 * RADIUS, 2 * RADIUS)),
    "mesh": lambda scene, name, body: scene.mesh(name, body, RADIUS * (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1)),
    "cylinder": lambda scene, name, body: scene.cylinder(name, body, RADIUS, 2 * RADIUS),
}


def moved(scene, duration: float):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=STEP, progress=False)


def flat(scene):
    """Level field whose cells are smaller than the bodies."""
    scene.height_field("land", "ground", np.zeros((11, 31)), (3.0, 1.0), rotation=(0, 0, 0.3))


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_level_field_is_a_plane(kind):
    ends = []
    for ground in (flat, lambda scene: scene.half_space("land")):
        scene = gauss.Scene("slide")
        ground(scene)
        free_body(scene, "A", 0.4 * RADIUS**2, (0.013, 0.021, RADIUS), rate=(0.6, 0.2, 0, 0, 0, 0))
        SOLIDS[kind](scene, "solid", "A")
        scene.contacts_all(friction=FRICTION)
        ends.append(moved(scene, 0.15))
    assert ends[0].q[-1][:3] == pytest.approx(ends[1].q[-1][:3], abs=AS_ON_A_PLANE)
    assert ends[0].v[-1] == pytest.approx(ends[1].v[-1], abs=AS_ON_A_PLANE / STEP)


@pytest.mark.parametrize("turned", [False, True])
def test_feet_are_balls_at_their_points(turned):
    places, ends = np.array([(0.2, 0.1, -0.2), (0.2, -0.1, -0.2), (-0.2, 0.0, -0.2)]), []
    x, y = np.meshgrid(np.linspace(-1, 1, 15), np.linspace(-1, 1, 13))
    for feet in (True, False):
        scene = gauss.Scene("tripod")
        scene.height_field("land", "ground", 0.05 * np.sin(3 * x) * np.cos(2 * y), (2.0, 2.0))
        free_body(scene, "A", 0.4 * RADIUS**2, (0.013, 0.021, 0.4), rate=(0.6, 0.2, 0, 0, 0, 0))
        if feet:
            scene.points("feet", "A", places, radius=0.05)
        for k, place in enumerate(places):
            scene.sphere(f"foot {k}", "A", 0.05, at=place)
        pairs = ["feet"] if feet else [f"foot {k}" for k in range(3)]
        for name in pairs:
            shapes = ("land", name) if turned else (name, "land")
            scene.contact(name, *shapes, friction=FRICTION)
        end = moved(scene, 0.4)
        ends.append((end.q[-1], np.concatenate([np.ravel(gauss.contact_forces(end, name)[-1]) for name in pairs])))
    assert ends[0][0] == pytest.approx(ends[1][0], abs=AS_ON_A_PLANE)
    assert ends[0][1] == pytest.approx(ends[1][1], abs=1e-6 * G)
    assert np.count_nonzero(ends[0][1]) >= 2


@pytest.mark.slow
def test_a_ball_in_a_valley_presses_on_both_sides():
    slope, scene = 0.5, gauss.Scene("valley")
    x = np.linspace(-1, 1, 5)
    scene.height_field("land", "ground", np.tile(slope * np.abs(x), (4, 1)), (2.0, 1.5))
    free_body(scene, "A", 0.4 * RADIUS**2, (0.0, 0.1, RADIUS * np.hypot(1.0, slope)))
    SOLIDS["ball"](scene, "ball", "A")
    scene.contacts_all()
    end = moved(scene, 0.05)
    assert end.q[-1][:3] == pytest.approx((0.0, 0.1, RADIUS * np.hypot(1.0, slope)), abs=1e-9)
    forces = gauss.contact_forces(end, "ball on land")[-1]
    pressed = np.sort(np.ravel(forces))[-2:]
    assert pressed == pytest.approx([0.5 * G * np.hypot(1.0, slope)] * 2, rel=1e-8)


@pytest.mark.parametrize("kind", SOLIDS)
def test_bodies_stay_above_hills(kind):
    rng, scene = np.random.default_rng(6), gauss.Scene("hills")
    x, y = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21))
    field = scene.height_field("land", "ground", 0.1 * np.sin(5 * x) * np.cos(4 * y) + 0.3 * (x**2 + y**2), (2.0, 2.0))
    quaternion = rng.standard_normal(4)
    turn = quaternion / np.linalg.norm(quaternion)
    free_body(scene, "A", 0.4 * RADIUS**2, (0.3, 0.1, 0.35), rate=(-0.5, 0.4, 0, 1, 2, 3), turn=turn)
    shape = SOLIDS[kind](scene, "solid", "A")
    scene.contacts_all(friction=FRICTION)
    motion, ground, solid = moved(scene, 0.6), in_coal(field), solid_of(shape).in_coal(coal)
    gaps = []
    for q in motion.q[::5]:
        raised = coal.Transform3s(from_quaternion(q[3:7]) @ axes_of(shape), q[:3] + (0, 0, PENETRATION))
        result = coal.DistanceResult()
        gaps.append(coal.distance(solid, raised, ground, coal.Transform3s(), coal.DistanceRequest(), result))
    assert min(gaps) >= 0.0
    assert min(gaps) < 1e-3  # it touched
