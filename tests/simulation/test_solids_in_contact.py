"""Motions of cylinders, cones, ellipsoids and convex meshes in contact, against closed forms."""

import numpy as np
import pytest

import gauss
from benchmarks.convex_meshes import heap
from benchmarks.free_bodies import free_body
from gauss.errors import GaussError
from gauss.scene import contact_patch

STEP, G, FRICTION = 1e-3, 9.81, 0.4
RADIUS = 0.1  # [m]
ON_FLOOR = 1e-8  # [m]
ROLLING = 1e-4  # relative: points fixed to a rim meet a plane within a step
CUBE = tuple((x, y, z) for x in (-RADIUS, RADIUS) for y in (-RADIUS, RADIUS) for z in (-RADIUS, RADIUS))
SOLIDS = {
    "cylinder": lambda scene: scene.cylinder("solid", "A", RADIUS, 2 * RADIUS),
    "cone": lambda scene: scene.cone("solid", "A", RADIUS, 2 * RADIUS),
    "mesh": lambda scene: scene.mesh("solid", "A", CUBE),
}
FLOORS = {
    "plane": lambda scene: scene.half_space("floor"),
    "box": lambda scene: scene.box("floor", "ground", (4, 4, 1), at=(0, 0, -0.5)),
    "mesh": lambda scene: scene.mesh("floor", "ground", 20 * np.array(CUBE), at=(0, 0, -2)),
}


def moved(scene, duration: float):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=STEP, progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("kind", SOLIDS)
def test_a_solid_that_slides_comes_to_rest_after_v2_over_2_mu_g(kind, floor):
    scene, speed = gauss.Scene("slide"), 0.3
    FLOORS[floor](scene)
    free_body(scene, "A", 0.4 * RADIUS**2, (0, 0, RADIUS), rate=(speed, 0, 0, 0, 0, 0))
    SOLIDS[kind](scene)
    scene.contacts_all(friction=FRICTION)
    end = moved(scene, 0.3)
    way = speed**2 / (2 * FRICTION * G)
    assert end.q[-1][:3] == pytest.approx((way, 0, RADIUS), abs=speed * STEP)
    assert abs(end.q[-1][2] - RADIUS) < ON_FLOOR
    assert np.abs(end.v[-1]).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("floor", FLOORS)
def test_a_cylinder_rolls_down_with_two_thirds_of_g_sin(floor):
    slope, length = 0.2, 0.3
    scene = gauss.Scene("roll", gravity=(G * np.sin(slope), 0, -G * np.cos(slope)))
    FLOORS[floor](scene)
    scene.body("A", mass=1.0, inertia=(RADIUS**2 / 4 + length**2 / 12, RADIUS**2 / 2, RADIUS**2 / 4 + length**2 / 12))
    scene.free("A floats", "ground", "A")
    scene.start("A floats", position=(-0.5, 0, RADIUS, 1, 0, 0, 0))
    scene.cylinder("solid", "A", RADIUS, length, axis=(0, 1, 0))
    scene.contacts_all(friction=FRICTION)
    end, time = moved(scene, 0.5), 0.5
    speed = 2 / 3 * G * np.sin(slope) * time
    assert end.v[-1][0] == pytest.approx(speed, rel=ROLLING)
    assert end.q[-1][0] == pytest.approx(-0.5 + 0.5 * speed * time, abs=2 * speed * STEP)
    assert abs(end.q[-1][2] - RADIUS) < ON_FLOOR


def test_nearest_points_that_are_not_found_are_refused_by_the_name_of_the_contact(monkeypatch):
    scene = gauss.Scene("lost")
    FLOORS["box"](scene)
    free_body(scene, "A", 0.4 * RADIUS**2, (0, 0, RADIUS))
    SOLIDS["cylinder"](scene)
    scene.contacts_all(friction=FRICTION)
    system = gauss.compile_scene(scene)
    monkeypatch.setattr(contact_patch, "FAILED", 0.0)
    with pytest.raises(GaussError, match="solid on floor"):
        moved(system, 0.1)


@pytest.mark.slow
def test_a_heap_of_meshes_stays_above_its_floor_without_a_search_in_python(monkeypatch):
    scene = heap(8, wall=0.12)
    monkeypatch.setattr(contact_patch.SolidPair, "points", None)  # a call is refused by the name of the contact
    end = moved(scene, 0.4)
    for pose, shape in zip(end.q[-1].reshape(-1, 7), (s for s in scene.shapes.values() if s.kind == "mesh"), strict=True):
        R = gauss.rotations.from_quaternion(pose[3:])
        assert ((shape.corners @ R.T + pose[:3])[:, 2]).min() > -1e-5
