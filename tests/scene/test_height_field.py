"""Height fields: distances beside coal, what is looked at, normals of the surface, what is refused."""

import coal
import numpy as np
import pytest

import gauss
from gauss.errors import SceneError
from gauss.rotations import from_quaternion
from gauss.scene.contact_patch import SLOTS, SolidPose, solid_of
from gauss.scene.patch_distances import solid_pair
from gauss.scene.terrain import Terrain
from tests.scene.test_contact_shapes import EXACT, MAKE, SMOOTH
from tests.support.terrain import in_coal

KINDS = "sphere", "capsule", "box", "ellipsoid", "cylinder", "cone", "mesh"
CURVED = "ellipsoid", "cylinder", "cone"
HEIGHTS = 0.3 * np.random.default_rng(1).standard_normal((9, 11))
ROUNDING = 1e-12


def land(heights=HEIGHTS, size=(5.0, 4.0), **options):
    """Height field of the ground."""
    return gauss.Scene("land").height_field("land", "ground", heights, size, **options)


def solid(kind: str):
    """Shape on a body."""
    scene = gauss.Scene("solid")
    scene.body("A", mass=1.0, inertia=(1.0, 1.0, 1.0))
    return MAKE[kind](scene, "A")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_nearest_point_is_that_of_coal(kind):
    field, shape, rng, seen = land(rotation=(0.1, 0.2, 0.3), at=(0.1, 0.2, 0.3)), solid(kind), np.random.default_rng(3), 0
    ground, form, pair = in_coal(field), solid_of(shape).in_coal(coal), solid_pair(shape, field)
    error = SMOOTH if kind in CURVED else EXACT
    for _ in range(30):
        quaternion = rng.standard_normal(4)
        R = from_quaternion(quaternion / np.linalg.norm(quaternion))
        x = np.array(field.at) + field.axes @ (rng.uniform(-2, 2), rng.uniform(-1.5, 1.5), rng.uniform(0.5, 2))
        result = coal.DistanceResult()
        gap = coal.distance(form, coal.Transform3s(R, x), ground, coal.Transform3s(), coal.DistanceRequest(), result)
        if gap < 1e-3:
            continue  # triangles of coal have no inside
        found = pair.points(SolidPose(R, x), SolidPose(field.axes, field.centre), gap + 0.05)
        nearest = min(found, key=lambda point: point.gap)
        assert len(found) <= SLOTS
        assert nearest.gap == pytest.approx(gap, abs=error)
        assert nearest.normal @ field.axes[:, 2] > 0.0
        assert not pair.points(SolidPose(R, x), SolidPose(field.axes, field.centre), gap - 2 * error)
        seen += 1
    assert seen > 5


@pytest.mark.parametrize("gap", [1e-3, 1e-9, 0.0, -1e-9, -1e-3])
@pytest.mark.parametrize("kind", ["sphere", "box", "mesh", "cylinder"])
def test_on_a_tilted_plane_only_its_normal_counts(kind, gap):
    slope = np.array([0.2, -0.1])
    x, y = np.meshgrid(np.linspace(-4, 4, 17), np.linspace(-4, 4, 25))
    field, shape = land(slope[0] * x + slope[1] * y, (8, 8)), solid(kind)
    up = np.array([*-slope, 1.0]) / np.sqrt(1.0 + slope @ slope)
    rng = np.random.default_rng(7)
    for _ in range(5):
        quaternion = rng.standard_normal(4)
        R = from_quaternion(quaternion / np.linalg.norm(quaternion))
        x = np.array([*rng.uniform(-0.5, 0.5, 2), 0.0])
        form = solid_of(shape)
        x = x + up * (gap + form.extent(-up[None] @ R)[0] - x @ up)
        found = solid_pair(shape, field).points(SolidPose(R, x), SolidPose(field.axes, field.centre), 0.02)
        assert min(point.gap for point in found) == pytest.approx(gap, abs=SMOOTH if kind in CURVED else EXACT)
        assert np.abs([point.normal - up for point in found]).max() < ROUNDING


def test_a_ball_over_a_ridge_or_peak_has_one_contact_and_in_a_valley_two():
    x = np.linspace(-2, 2, 5)
    slope, radius = 1.0, 0.3
    ball = gauss.Scene("ball")
    ball.body("A", 1.0, (1, 1, 1))
    shape = ball.sphere("ball", "A", radius)
    for sign, count in ((-1.0, 1), (1.0, 2)):
        field = land(np.tile(sign * slope * np.abs(x), (5, 1)), (4, 4))
        height = radius + 1e-3 if sign < 0.0 else (radius + 1e-3) * np.sqrt(1.0 + slope**2)
        pose = SolidPose(np.eye(3), np.array([0.0, 0.1, height]))
        found = solid_pair(shape, field).points(pose, SolidPose(field.axes, field.centre), 0.01)
        assert [point.gap for point in found] == pytest.approx([1e-3] * count, abs=ROUNDING)
    cone = land(-np.hypot(*np.meshgrid(x, x)), (4, 4))
    found = solid_pair(shape, cone).points(
        SolidPose(np.eye(3), np.array([0.0, 0.0, radius])), SolidPose(cone.axes, cone.centre), 0.01
    )
    assert len(found) == 1
    assert found[0].normal == pytest.approx((0, 0, 1), abs=ROUNDING)


@pytest.mark.parametrize("kind", ["sphere", "box"])
@pytest.mark.parametrize("depth", [0.05, 0.2, 0.45])
def test_what_is_deep_in_the_field_is_pushed_up(kind, depth):
    field, shape = land(np.zeros((21, 21)), (4, 4), depth=2.0), solid(kind)
    pose = SolidPose(np.eye(3), np.array([0.1, 0.2, -depth]))
    found = solid_pair(shape, field).points(pose, SolidPose(field.axes, field.centre), 1e-3)
    lowest = -depth - solid_of(shape).extent(np.array([[0.0, 0.0, -1.0]]) @ np.eye(3))[0]
    assert min(point.gap for point in found) <= -depth
    if kind == "sphere":
        assert found[0].gap == pytest.approx(lowest, abs=ROUNDING)
    assert all(point.normal @ (0, 0, 1) > 0.99 for point in found)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sphere", "box"])
def test_only_cells_under_a_body_are_looked_at(monkeypatch, kind):
    seen, under = [], Terrain.under

    def counted(self, low, high):
        found = under(self, low, high)
        seen.append(len(found.corners))
        return found

    monkeypatch.setattr(Terrain, "under", counted)
    for cells in (20, 200):
        field = land(np.zeros((cells + 1, cells + 1)), (0.1 * cells, 0.1 * cells))
        pose = SolidPose(np.eye(3), np.array([0.03, 0.04, 0.45]))
        assert solid_pair(solid(kind), field).points(pose, SolidPose(field.axes, field.centre), 0.1)
    assert seen[0] == seen[1] <= 2 * 11**2
    far = SolidPose(np.eye(3), np.array([50.0, 0.0, 0.0]))
    assert not solid_pair(solid(kind), field).points(far, SolidPose(field.axes, field.centre), 0.1)
    assert seen[-1] == 0


def test_the_height_is_that_of_the_triangles():
    field, rng = land(), np.random.default_rng(2)
    terrain, (points, corners) = Terrain(field), field.surface
    for _ in range(40):
        shares = rng.dirichlet((1, 1, 1))
        place = shares @ points[corners[rng.integers(len(corners))]] - field.centre
        assert terrain.height(place) == pytest.approx(place[2], abs=ROUNDING)


@pytest.mark.parametrize(
    ("heights", "size", "options", "words"),
    [
        ([[0.0, 1.0]], (1, 1), {}, "two rows"),
        ([[0.0, 1.0], [0.0]], (1, 1), {}, "one length"),
        ([0.0, 1.0], (1, 1), {}, "shape (2,)"),
        ([["a", "b"], ["c", "d"]], (1, 1), {}, "grid"),
        ("hills", (1, 1), {}, "grid"),
        (None, (1, 1), {}, "grid"),
        ([[0.0, np.nan], [0.0, 0.0]], (1, 1), {}, "row 0, column 1"),
        ([[0.0, 0.0], [np.inf, 0.0]], (1, 1), {}, "row 1, column 0"),
        (np.zeros((2, 2)), (1, -1), {}, "edges > 0"),
        (np.zeros((2, 2)), (1, 0), {}, "edges > 0"),
        (np.zeros((2, 2)), (1, 1, 1), {}, "2 numbers"),
        (np.zeros((2, 2)), (1, 1), {"depth": 0.0}, "positive"),
        (np.zeros((2, 2)), (1, 1), {"depth": np.nan}, "positive"),
    ],
)
def test_what_is_no_grid_is_refused_by_name(heights, size, options, words):
    with pytest.raises(SceneError, match="land") as error:
        land(heights, size, **options)
    assert words in str(error.value)


def test_planes_have_no_rule_and_points_need_a_radius():
    scene = gauss.Scene("land")
    scene.height_field("land", "ground", HEIGHTS, (5, 4))
    scene.body("A", 1.0, (1, 1, 1))
    scene.half_space("floor", "A")
    with pytest.raises(SceneError, match="floor"):
        scene.contact("floor on land", "floor", "land")
    scene.points("feet", "A", [(0, 0, 0)])
    with pytest.raises(SceneError, match="feet.*radius"):
        scene.contact("feet on land", "feet", "land")
    scene.points("round feet", "A", [(0, 0, 0), (0, 1, 0)], radius=0.1)
    contact = scene.contact("round feet on land", "round feet", "land")
    assert len(contact.sides(scene)) == 2 * SLOTS


def test_a_field_comes_back_from_a_file(tmp_path):
    scene = gauss.Scene("land")
    scene.body("A", 1.0, (1, 1, 1))
    field = scene.height_field("land", "A", HEIGHTS, (5, 4), at=(1, 2, 3), rotation=(0.1, 0.2, 0.3), depth=0.5)
    again = gauss.load(gauss.save(scene, tmp_path / "land.toml")).shapes["land"]
    assert again == field
    assert hash(again) == hash(field)
