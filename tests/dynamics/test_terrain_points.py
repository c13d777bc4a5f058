"""Contact points of balls and convex hulls with height fields by machine code: beside those found with coal in Python."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import free_body
from gauss.codegen.kernels.near_pairs import FAR_AWAY, UNKNOWN
from gauss.dynamics.contact.hull_records import HullRecord, TerrainRecord
from gauss.dynamics.contact.patch_kernels import PatchKernels, terrain_distances
from gauss.rotations import from_quaternion
from gauss.scene import HeightField, Sphere
from gauss.scene.contact_patch import SLOTS, SolidPose, solid_of
from gauss.scene.patch_distances import solid_pair
from tests.scene.test_height_field import HEIGHTS, land, solid

COAL = 2e-9  # [m] of distances by coal, along normals that have a few digits less
REACH = 0.01  # [m]
DEEP = 0.005  # [m] beyond which one of several triangles is chosen by rounding
TOUCHING = 1e-3  # [m]: points no farther than the nearest one and this; farther ones differ by what may touch next
KINDS = "sphere", "capsule", "box", "mesh"
ROUGH = 0.03 * np.random.default_rng(1).standard_normal((41, 41))
X = np.linspace(-2.0, 2.0, 21)
LANDS = {
    "hills": lambda: land(HEIGHTS, rotation=(0.1, 0.2, 0.3), at=(0.1, 0.2, 0.3)),
    "fine": lambda: land(ROUGH, (4, 4)),
    "level": lambda: land(np.zeros((21, 21)), (4, 4)),
    "steps": lambda: land(np.tile(0.2 * (X > 0.0), (21, 1)), (4, 4)),
    "ridges": lambda: land(np.tile(0.2 * np.abs(np.sin(4.0 * X)), (21, 1)), (4, 4)),
}


def points(shape, field: HeightField, one: SolidPose, other: SolidPose):
    """Points (k, 7) by machine code; None where it leaves the pair."""
    patch, records = np.full((SLOTS, 7), np.nan), (HullRecord(solid_of(shape)), TerrainRecord(field))
    placed = [np.concatenate([pose.R.ravel(), pose.x, np.zeros(4)]) for pose in (one, other)]
    addresses = [*(record.address for record in records), patch.ctypes.data]
    found = terrain_distances(isinstance(shape, Sphere))(np.array([*placed[0], *placed[1], 1.0, REACH, *addresses]))
    return None if found[0] <= UNKNOWN else patch[: np.count_nonzero(found < FAR_AWAY)]


def poses(pair, field: HeightField, rng: np.random.Generator):
    """Poses of a body near a field or a little in it, some along its grid, and its distance from it [m]."""
    other = SolidPose(field.axes, field.centre)
    for k in range(6):
        quaternion = rng.standard_normal(4)
        R = from_quaternion(quaternion / np.linalg.norm(quaternion)) if k % 3 else field.axes
        x = np.array(field.at) + field.axes @ (*rng.uniform(-1.0, 1.0, 2), 1.3)
        nearest = min(pair.points(SolidPose(R, x), other, 1.2), key=lambda point: point.gap)
        for gap in (3e-2, 1e-3, 1e-6, 0.0, -1e-6, -1e-3):
            yield SolidPose(R, x - nearest.normal * (nearest.gap - gap)), other, gap


@pytest.mark.slow
@pytest.mark.parametrize("ground", LANDS)
@pytest.mark.parametrize("kind", KINDS)
def test_points_are_those_found_in_python(kind, ground):
    field, shape, seen = LANDS[ground](), solid(kind), 0
    pair = solid_pair(shape, field)
    for one, other, gap in poses(pair, field, np.random.default_rng(5)):
        expected = pair.points(one, other, REACH)
        least = min((point.gap for point in expected), default=REACH)
        found = points(shape, field, one, other)
        if found is None or least < -DEEP:
            continue
        nearest = found[:, 0].min(initial=REACH)
        assert nearest == pytest.approx(min(least, gap) if gap >= 0.0 else least, abs=COAL)
        for point in expected:
            if point.gap < least + TOUCHING:
                assert np.abs(found[:, 0] - point.gap).min() < COAL
        seen += len(expected) > 0
    assert seen > 9


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_motions_on_hills_rarely_call_python(monkeypatch, kind):
    calls, called = [], PatchKernels._distances

    def counted(self, given, found):
        calls.append(1)
        called(self, given, found)

    monkeypatch.setattr(PatchKernels, "_distances", counted)
    scene = gauss.Scene("hills")
    scene.height_field("land", "ground", ROUGH, (4.0, 4.0))
    free_body(scene, "A", 0.01, (0.1, 0.2, 1.3), rate=(0.5, 0.4, 0.0, 1.0, 2.0, 3.0))
    small = {
        "sphere": lambda: scene.sphere("solid", "A", 0.2),
        "capsule": lambda: scene.capsule("solid", "A", 0.1, 0.3),
        "box": lambda: scene.box("solid", "A", (0.3, 0.2, 0.1)),
        "mesh": lambda: scene.mesh("solid", "A", 0.2 * np.random.default_rng(2).standard_normal((12, 3))),
    }
    small[kind]()
    scene.contacts_all(friction=0.4)
    steps = 800
    motion = gauss.simulate(scene, 1e-3 * steps, integrator="time_stepping", step=1e-3, progress=False)
    assert motion.q[-1][2] < 0.6  # it touched
    assert len(calls) <= 0.01 * steps
