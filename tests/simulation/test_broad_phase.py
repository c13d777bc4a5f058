"""Near contacts by a grid of cells are those of all pairs, one by one."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import free_body
from gauss.dynamics.contact import near_detection
from gauss.dynamics.contact.free_body_step import FreeBodyStepper

pytestmark = pytest.mark.slow

SPREAD = 0.5  # half edge of the cloud [m]


def cloud(sizes, places, planes=1):
    """Balls, boxes and capsules of some sizes, some planes, and a body of two shapes; one pair is left out."""
    scene, rng = gauss.Scene("cloud"), np.random.default_rng(7)
    for k in range(planes):
        scene.half_space(f"plane {k}", at=(0.0, 0.0, -SPREAD), normal=tuple(rng.standard_normal(3)))
    for k, (size, place) in enumerate(zip(sizes, places, strict=True)):
        free_body(scene, f"body {k}", 0.01, place)
        if k % 3 == 0:
            scene.sphere(f"shape {k}", f"body {k}", size)
        elif k % 3 == 1:
            scene.box(f"shape {k}", f"body {k}", (size, 1.5 * size, 2.0 * size), rotation=tuple(rng.standard_normal(3)))
        else:
            scene.capsule(f"shape {k}", f"body {k}", 0.5 * size, size, axis=tuple(rng.standard_normal(3)))
    scene.sphere("ear", "body 0", 0.05, at=(0.0, 0.1, 0.0))
    scene.contacts_all(exclude=[("body 0", "body 1")])
    return scene


def around(n, spread=SPREAD):
    return np.random.default_rng(n).uniform(-spread, spread, (n, 3))


CLOUDS = {
    "sizes alike": lambda: cloud(np.full(60, 0.1), around(60)),
    "sizes of two decades": lambda: cloud(np.geomspace(0.005, 0.5, 60), around(60)),
    "one large body": lambda: cloud([*np.full(59, 0.02), 1.0], around(60)),
    "points": lambda: cloud([*np.full(57, 1e-9), 0.1, 0.1, 0.1], around(60, 0.2)),
    "on lattice points": lambda: cloud(np.full(64, 0.1), 0.2 * np.array(list(np.ndindex(4, 4, 4)))),
    "far from the origin": lambda: cloud(np.full(60, 0.1), around(60) + [1e6, -1e6, 1e3]),
    "some flown away": lambda: cloud(np.full(60, 0.1), around(60) * np.where(np.arange(60) % 7, 1.0, 1e12)[:, None]),
    "all at one place": lambda: cloud(np.full(20, 0.1), np.zeros((20, 3))),
    "two bodies": lambda: cloud([0.1, 0.1], np.zeros((2, 3))),
    "many planes": lambda: cloud(np.full(30, 0.1), around(30), planes=12),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_a_grid_finds_the_contacts_of_all_pairs(name, monkeypatch):
    system, found = gauss.compile_scene(CLOUDS[name]()), []
    for most in (10**9, 0):
        monkeypatch.setattr(near_detection, "MOST_LISTED_PAIRS", most)
        stepper = FreeBodyStepper(system)
        assert (len(stepper.detection.pair) > 0) == (most > 0)
        bodies = stepper.begin(system.initial_state(), 0.0, 0.0).bodies
        found.append([stepper.detection.find(bodies, reach, 0.5) for reach in (0.0, 0.03, 0.3, 100.0)])
    assert any(near.key.size for near, _ in found[0])
    for (listed, one), (gridded, other) in zip(*found, strict=True):
        for a, b in zip(listed, gridded, strict=True):
            np.testing.assert_array_equal(a, b)
        assert one == other


@pytest.mark.slow
@pytest.mark.parametrize("most", [10**9, 0])
def test_positions_without_a_number_have_no_contacts(most, monkeypatch):
    monkeypatch.setattr(near_detection, "MOST_LISTED_PAIRS", most)
    system = gauss.compile_scene(CLOUDS["sizes alike"]())
    stepper = FreeBodyStepper(system)
    bodies = stepper.begin(system.initial_state(), 0.0, 0.0).bodies
    assert stepper.detection.find(bodies, 0.1)[0].key.size
    assert not stepper.detection.find(bodies * np.nan, 0.1)[0].key.size
