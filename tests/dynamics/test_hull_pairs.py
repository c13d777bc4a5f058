"""Contact points of convex hulls by machine code: beside coal and the faces themselves."""

from itertools import product

import numpy as np
import pytest

import gauss
from gauss.codegen.kernels.near_pairs import FAR_AWAY, UNKNOWN
from gauss.dynamics.contact.hull_records import HullRecord
from gauss.dynamics.contact.patch_kernels import hull_distances
from gauss.rotations import from_quaternion
from gauss.scene.contact_patch import SAME_DEPTH, SLOTS, SolidPair, SolidPose, solid_of
from gauss.scene.support_faces import Segment
from tests.scene.test_contact_shapes import random_pose, shape

COAL = 2e-10  # [m] of coal's distances of shapes of the size of 1 m
ROUGH = 1e-6  # [m] distances below which coal's normals have few digits
EXACT = 1e-12  # [m] of places and heights over planes that support both shapes
REACH = 0.3  # [m]
PAIRS = ("mesh", "mesh"), ("box", "mesh"), ("sphere", "mesh"), ("capsule", "mesh")
TILT = np.array([0.6, 0.8, 0.0])
CUBE = tuple((x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5))
PRISM = tuple((np.cos(a), np.sin(a), z) for a in np.arange(12) * np.pi / 6 for z in (-0.5, 0.5))


def points(solids, poses, reach: float = REACH):
    """Points (k, 7) by machine code; None where it leaves the pair."""
    patch = np.full((SLOTS, 7), np.nan)
    records = [HullRecord(solid) if solid else None for solid in solids]
    placed = [np.concatenate([pose.R.ravel(), pose.x, np.zeros(4)]) for pose in poses]
    addresses = [record.address if record else 0 for record in records]
    found = hull_distances(solids[1] is None)(np.array([*placed[0], *placed[1], 1.0, reach, *addresses, patch.ctypes.data]))
    return None if found[0] <= UNKNOWN else patch[: np.count_nonzero(found < FAR_AWAY)]


def height(solid, pose: SolidPose, direction: np.ndarray) -> float:
    """Farthest that a solid reaches in a direction [m]."""
    return float(pose.x @ direction + solid.extent((pose.R.T @ direction)[None])[0])


def outside(solid, pose: SolidPose, place: np.ndarray) -> float:
    """Height of a place over the faces of a solid, or over the surface around a segment [m]."""
    own = pose.R.T @ (place - pose.x)
    if isinstance(solid, Segment):
        return float(np.linalg.norm(own - [0.0, 0.0, np.clip(own[2], -solid.half, solid.half)])) - solid.radius
    return max(float((own - face.points[0]) @ face.normal) for face in map(solid.faces, range(len(solid.normals))))


@pytest.mark.parametrize("kinds", PAIRS)
def test_the_nearest_points_are_those_of_coal_and_lie_on_both_hulls(kinds):
    solids, rng = [solid_of(shape(kind, name)) for kind, name in zip(kinds, "AB", strict=True)], np.random.default_rng(3)
    pair, seen = SolidPair(*solids), 0
    near = SAME_DEPTH * pair.size
    for k in range(60):
        one, other = random_pose(rng, 0.5), random_pose(rng, 0.3)
        if k % 3:  # near each other, or a little in each other
            nearest = pair.nearest(one, other)
            way = nearest.gap - rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12.0, -2.0)
            one = SolidPose(one.R, one.x - nearest.normal * way)
        nearest, found = pair.nearest(one, other), points(solids, (one, other))
        assert found is not None
        if abs(nearest.gap) > ROUGH:
            assert len(found) == len(pair.points(one, other, REACH))
        if nearest.gap > REACH:
            continue
        least = found[np.argmin(found[:, 0])]
        assert abs(least[0] - nearest.gap) < near
        at_nearest = found[np.abs(found[:, 0] - nearest.gap) < COAL]
        for gap, *rest in at_nearest[:1]:
            place, normal = np.array(rest[:3]), np.array(rest[3:])
            between = -height(solids[0], one, -normal) - height(solids[1], other, normal)
            assert abs(between - gap) < near
            assert outside(solids[1], other, place) < EXACT
            assert outside(solids[0], one, place + gap * normal) < EXACT
        seen += len(at_nearest) > 0
    assert seen > 20


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4])
@pytest.mark.parametrize("vertices", [CUBE, PRISM])
def test_faces_on_each_other_touch_at_their_corners_whatever_their_distance(vertices, turn):
    scene = gauss.Scene("two")
    for name in "AB":
        scene.body(name, mass=1.0, inertia=(1.0, 1.0, 1.0))
        scene.mesh(f"on {name}", name, vertices if name == "A" else CUBE)
    solids = [solid_of(one) for one in scene.shapes.values()]
    tilt, turned = (
        from_quaternion(np.array([np.cos(a), *np.sin(a) * axis])) for a, axis in ((0.4, TILT), (turn, np.eye(3)[2]))
    )
    for gap, east in product((0.0, 1e-15, -1e-15, 1e-11, -1e-11, 1e-6, -1e-6, -1e-3), (0.0, 0.25)):
        place = np.array([east, 2 * east, 1.0 + gap])
        found = points(solids, (SolidPose(tilt @ turned, tilt @ place), SolidPose(tilt, np.zeros(3))))
        assert found is not None
        assert len(found) >= 4
        assert np.abs(found[:, 0] - gap).max() < EXACT
        assert np.abs(found[:, 4:] - tilt[:, 2]).max() < EXACT
