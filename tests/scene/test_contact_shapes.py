"""Cylinders, cones, ellipsoids and convex meshes: distances and normals beside coal, patches, what is refused."""

from itertools import combinations_with_replacement

import coal
import numpy as np
import pytest

import gauss
from gauss.errors import SceneError
from gauss.rotations import from_quaternion
from gauss.scene.contact_pairs import places
from gauss.scene.contact_patch import SLOTS, SolidPose, solid_of
from gauss.scene.patch_distances import solid_pair
from gauss.simulation.moreau.unseen_contacts import thickness

SMOOTH = 1e-4  # [m] coal's distance of curved shapes, and depths, with its tolerance of 1e-6
EXACT = 1e-9  # [m] of other shapes of the size of 1 m
NORMALS = 5e-3  # [rad] of normals of these at those tolerances: the square root of them
POINTS = tuple(map(tuple, np.random.default_rng(5).standard_normal((14, 3))))
CUBE = tuple((x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5))
CLOSED = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
CORNER = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
MAKE = {
    "sphere": lambda scene, body: scene.sphere(f"{body} shape", body, 0.4),
    "capsule": lambda scene, body: scene.capsule(f"{body} shape", body, 0.2, 0.7, axis=(1, 2, 0)),
    "box": lambda scene, body: scene.box(f"{body} shape", body, (0.4, 0.6, 0.8), rotation=(0.3, 0.2, 0.1)),
    "ellipsoid": lambda scene, body: scene.ellipsoid(f"{body} shape", body, (0.3, 0.5, 0.4), rotation=(0.1, 0.4, 0.2)),
    "cylinder": lambda scene, body: scene.cylinder(f"{body} shape", body, 0.3, 0.8, axis=(1, 1, 1)),
    "cone": lambda scene, body: scene.cone(f"{body} shape", body, 0.4, 0.7, axis=(0, 1, 2)),
    "mesh": lambda scene, body: scene.mesh(f"{body} shape", body, POINTS, at=(0.1, 0.0, 0.0), rotation=(0.2, 0.0, 0.4)),
    "plane": lambda scene, body: scene.half_space("plane", at=(0, 0, -0.1), normal=(0.1, 0.2, 1.0)),
}
NEW = "ellipsoid", "cylinder", "cone", "mesh"
PAIRS = [pair for pair in combinations_with_replacement(list(MAKE)[:-1], 2) if set(pair) & set(NEW)]


def shape(kind: str, name: str):
    """Shape on a body of its own."""
    scene = gauss.Scene("shapes")
    if kind != "plane":
        scene.body(name, mass=1.0, inertia=(1.0, 1.0, 1.0))
    return MAKE[kind](scene, name)


def random_pose(rng, spread: float = 1.0) -> SolidPose:
    """SolidPose whose place is normally distributed."""
    quaternion = rng.standard_normal(4)
    return SolidPose(from_quaternion(quaternion / np.linalg.norm(quaternion)), spread * rng.standard_normal(3))


def in_coal(one, other, poses) -> tuple[float, np.ndarray]:
    """Distance and normal by coal alone."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    solids = [solid_of(entry).in_coal(coal) for entry in (one, other)]
    placed = [coal.Transform3s(pose.R, pose.x) for pose in poses]
    gap = coal.distance(solids[0], placed[0], solids[1], placed[1], request, result)
    return gap, -np.array(result.normal)


def separation(one, other, poses, normal) -> float:
    """Distance of the planes across a normal that support both shapes."""
    ends = []
    for entry, pose, direction in zip((one, other), poses, (-normal, normal), strict=True):
        face = solid_of(entry).face(pose.R.T @ direction)
        ends.append(((face.points @ pose.R.T + pose.x) @ direction).max() + face.radius)
    return -sum(ends)


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_the_nearest_point_of_a_patch_is_that_of_coal(one, other):
    first, second, rng, seen = shape(one, "A"), shape(other, "B"), np.random.default_rng(2), 0
    is_smooth = bool({"ellipsoid", "cylinder", "cone"} & {one, other})
    for _ in range(40):
        poses = random_pose(rng), random_pose(rng, 0.2)
        gap, normal = in_coal(first, second, poses)
        if abs(gap) < 1e-3 or abs(gap) > 1e3:
            continue  # coal's normals lose digits with the distance
        found = solid_pair(first, second).points(*poses, np.inf)
        assert 0 < len(found) <= SLOTS
        nearest = min(found, key=lambda point: point.gap)
        error = SMOOTH if is_smooth or gap < 0.0 else EXACT
        assert nearest.gap >= gap - error
        assert nearest.gap <= gap + error or gap < 0.0  # coal's own depth need not be the least
        assert nearest.gap == pytest.approx(separation(first, second, poses, nearest.normal), abs=error)
        seen += 1
        assert nearest.normal @ normal > 1.0 - NORMALS**2 or gap < 0.0
    assert seen > 20


@pytest.mark.parametrize("kind", NEW)
def test_distances_from_a_half_space_are_those_of_the_lowest_point(kind):
    solid, plane, rng = shape(kind, "A"), shape("plane", "ground"), np.random.default_rng(4)
    for _ in range(20):
        pose = random_pose(rng)
        view = View(pose)
        normal = plane.outward(view)
        gaps = [place.touch(view).gap for place in places(solid, plane)]
        R, x = pose.R @ solid.axes, pose.x + pose.R @ solid.centre
        direction = -(R.T @ normal)
        face = solid_of(solid).face(direction).points
        lowest = (face @ R.T + x - np.array(plane.at)) @ normal
        assert min(gaps) == pytest.approx(lowest.min(), abs=1e-12)


class View:
    """View of one body at a pose, the ground at rest."""

    def __init__(self, pose: SolidPose):
        self.pose = pose
        self.system = type("System", (), {"scale": type("Scale", (), {"length": 1.0})})

    def position(self, body, point=(0.0, 0.0, 0.0)):
        """Place of a point."""
        return np.array(point) if body == "ground" else self.pose.x + self.pose.R @ np.asarray(point)

    def rotation(self, body):
        """Axes of the body."""
        return np.eye(3) if body == "ground" else self.pose.R


@pytest.mark.parametrize("kind", [*NEW, "box"])
def test_hulls_touch_along_faces_with_the_area_of_the_smaller(kind):
    table = shape("box", "B")
    cube = gauss.Scene("cube")
    cube.body("A", mass=1.0, inertia=(1, 1, 1))
    solid = {
        "mesh": lambda: cube.mesh("s", "A", CUBE),
        "box": lambda: cube.mesh("s", "A", CUBE, rotation=(0.0, 0.0, 0.5)),
        "cylinder": lambda: cube.cylinder("s", "A", 0.5, 1.0),
        "cone": lambda: cube.cone("s", "A", 0.5, 1.0),
        "ellipsoid": lambda: cube.ellipsoid("s", "A", (0.6, 0.7, 0.5)),
    }[kind]()
    least = {"ellipsoid": 1}.get(kind, 4)
    for gap in (1e-4, 1e-9, 0.0, -1e-9, -1e-4):
        poses = SolidPose(np.eye(3), np.array([0.0, 0.0, 0.9 + gap])), SolidPose(np.eye(3), np.zeros(3))
        found = solid_pair(solid, table).points(*poses, 1e-2)
        assert len(found) >= least
        assert max(abs(point.gap - gap) for point in found) < 1e-12
        assert max(np.abs(point.normal - (0, 0, 1)).max() for point in found) < 1e-12


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], (), "one plane"),
        ([(0, 0, 0), (1, 0, 0)], (), "one plane"),
        ([(0, 0)], (), "three entries"),
        ([*CORNER[:3], (0, 0, np.nan)], (), "finite"),
        (CORNER, CLOSED[:3], "open"),
        (CORNER, [*CLOSED, (0, 1, 1)], "no area"),
        (CORNER, [*CLOSED[:3], (1, 2, 4)], "beyond 3"),
        (CORNER, [(0.5, 1, 2)], "three entries"),
    ],
)
def test_degenerate_and_open_meshes_are_refused_by_name(vertices, faces, words):
    scene = gauss.Scene("meshes")
    scene.body("A", mass=1.0, inertia=(1, 1, 1))
    with pytest.raises(SceneError, match="rock") as error:
        scene.mesh("rock", "A", vertices, faces=faces)
    assert words in str(error.value)
    scene.mesh("rock", "A", CORNER, faces=CLOSED)


def test_a_mesh_of_triangles_with_corners_of_their_own_is_closed():
    scene, soup = gauss.Scene("meshes"), [CORNER[k] for face in CLOSED for k in face]
    scene.body("A", mass=1.0, inertia=(1, 1, 1))
    mesh = scene.mesh("rock", "A", soup, faces=np.arange(len(soup)).reshape(-1, 3))
    assert len(mesh.hull[0]) == len(CORNER)


def test_many_vertices_are_one_hull_for_all_copies():
    points = np.random.default_rng(6).standard_normal((8000, 3))
    points = tuple(map(tuple, points / np.linalg.norm(points, axis=1)[:, None]))
    scene = gauss.Scene("rocks")
    scene.body("A", mass=1.0, inertia=(1, 1, 1))
    rock, copy = (scene.mesh(name, "A", points) for name in ("rock", "copy"))
    vertices, loops, normals = rock.hull
    assert copy.hull[0] is vertices
    assert solid_of(copy) is solid_of(rock)
    corners = sum(map(len, loops))
    assert len(vertices) - corners // 2 + len(loops) == 2  # Euler: an edge has two corners that begin at it
    centres = np.array([vertices[loop].mean(axis=0) for loop in loops])
    assert (np.einsum("ij,ij->i", centres, normals) > 0.0).all()
    assert thickness(rock) == pytest.approx(2.0, rel=0.01)


def test_iterated_distances_need_time_stepping():
    scene = gauss.Scene("two")
    for name in "AB":
        scene.body(name, mass=1.0, inertia=(1, 1, 1))
        scene.free(f"{name} floats", "ground", name)
        MAKE["mesh"](scene, name)
    scene.start("A floats", position=(0, 0, 5, 1, 0, 0, 0))
    scene.contact("touch", "A shape", "B shape")
    with pytest.raises(gauss.errors.SimulationError, match="time_stepping"):
        gauss.simulate(scene, 0.1, progress=False)
