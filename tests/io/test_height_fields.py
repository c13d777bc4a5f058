"""Height fields of MJCF files: as MuJoCo has them, from the file or beside it, and back."""

import mujoco
import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import free_body
from gauss.errors import FileError
from gauss.rotations import from_quaternion
from gauss.scene import HeightField
from gauss.scene.contact_patch import SolidPose
from gauss.scene.patch_distances import solid_pair

FLOAT32 = 1e-7  # [m] MuJoCo keeps heights in single precision
DISTANCES = 1e-9  # [m] of the same surface; MuJoCo's tolerance of nearest points is 1e-6, which balls do not need
ELEVATION = "1 2 3  4 6 8"
GEOM = '<geom name="land" type="hfield" hfield="hills" pos="1 2 3" euler="0 0 90"/>'
BALL = '<body name="ball" pos="1 2 5"><freejoint/><geom name="round" size="0.2"/></body>'


def written(path, asset: str, body: str = BALL):
    """File of a ball over a height field."""
    path.write_text(f"<mujoco><asset>{asset}</asset><worldbody>{GEOM}{body}</worldbody></mujoco>")
    return path


def test_elevations_radii_and_base_are_those_of_mujoco(tmp_path):
    asset = f'<hfield name="hills" nrow="2" ncol="3" size="2 1 .7 .1" elevation="{ELEVATION}"/>'
    scene = gauss.load(written(tmp_path / "land.xml", asset), contacts=True)
    field = scene.shapes["land"]
    assert isinstance(field, HeightField)
    assert (field.size, field.depth) == ((4.0, 2.0), 0.1)
    # the first row of a file lies at the greatest y; elevations are scaled to 0 … 1
    assert np.array(field.heights) == pytest.approx(np.array([[3, 5, 7], [0, 1, 2]]) * 0.1, abs=FLOAT32)
    corner = field.surface[0][0]  # x = −2, y = −1, turned by a quarter about z
    assert corner == pytest.approx((1 + 1, 2 - 2, 3.3), abs=FLOAT32)
    assert {scene.contacts["land on round"].shape, scene.contacts["land on round"].other} == {"land", "round"}


@pytest.mark.parametrize("seed", range(3))
def test_distances_are_those_of_mujoco(tmp_path, seed):
    rng, scene = np.random.default_rng(seed), gauss.Scene("land")
    scene.height_field(
        "land", "ground", 0.2 * rng.standard_normal((7, 9)), (4, 3), at=(0.3, 0.2, 0.1), rotation=(0.1, 0.2, 0.3)
    )
    free_body(scene, "A", 0.4, (0, 0, 2))
    scene.sphere("ball", "A", 0.2)
    scene.contacts_all(friction=0.5)
    path = gauss.save(scene, tmp_path / "land.xml")
    field, pair_margin = gauss.load(path, contacts=True).shapes["land"], 1.0
    given = scene.shapes["land"]
    assert field.surface[0] == pytest.approx(given.surface[0], abs=FLOAT32)
    assert field.half_edges == pytest.approx(given.half_edges, abs=FLOAT32)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.pair_margin[:] = pair_margin
    data, pair = mujoco.MjData(model), solid_pair(scene.shapes["ball"], field)
    for _ in range(10):
        place = np.array(given.at) + given.axes @ (rng.uniform(-1.5, 1.5), rng.uniform(-1, 1), rng.uniform(0.3, 0.6))
        data.qpos[:] = [*place, 1, 0, 0, 0]
        mujoco.mj_forward(model, data)
        found = pair.points(SolidPose(np.eye(3), place), SolidPose(field.axes, field.centre), pair_margin)
        expected = min(contact.dist for contact in data.contact)
        assert min(point.gap for point in found) == pytest.approx(expected, abs=DISTANCES)


def test_fields_in_files_are_read_where_they_may_lie(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    content = np.array([2, 3], dtype=np.int32).tobytes() + np.arange(6, dtype=np.float32).tobytes()
    (folder / "hills.bin").write_bytes(content)
    (tmp_path / "hills.bin").write_bytes(content)
    asset = '<hfield name="hills" size="2 1 .5 .1" file="{}"/>'
    field = gauss.load(written(folder / "land.xml", asset.format("hills.bin")), contacts=True).shapes["land"]
    assert np.array(field.heights) == pytest.approx(np.arange(6).reshape(2, 3) * 0.1, abs=FLOAT32)
    with pytest.raises(FileError, match="outside its own folder"):
        gauss.load(written(folder / "land.xml", asset.format("../hills.bin")), contacts=True)


@pytest.mark.parametrize("elevation", ["1 2 3 4 5 nan", "1 2 3 4 5 inf", "1 2 3"])
def test_what_is_no_grid_of_numbers_is_refused(tmp_path, elevation):
    asset = f'<hfield name="hills" nrow="2" ncol="3" size="2 1 .7 .1" elevation="{elevation}"/>'
    with pytest.raises(FileError, match=r"land\.xml"):
        gauss.load(written(tmp_path / "land.xml", asset), contacts=True)


def test_grounds_do_not_touch_each_other(tmp_path):
    asset = '<hfield name="hills" nrow="2" ncol="2" size="2 1 .7 .1" elevation="0 0 0 0"/>'
    moving = '<body name="plate" pos="0 0 5"><freejoint/><geom name="other" type="hfield" hfield="hills" mass="1"/></body>'
    path = written(tmp_path / "land.xml", asset, BALL + moving)
    scene = gauss.load(path, contacts=True)
    assert sorted(scene.contacts) == ["land on round", "round on other"]
    assert {type(scene.shapes[name]) for name in ("land", "other")} == {HeightField}


def test_a_flat_field_on_a_turned_frame_comes_back(tmp_path):
    scene, turn = gauss.Scene("flat"), from_quaternion(np.array([0.8, 0.0, 0.6, 0.0]))
    scene.height_field("land", "ground", np.full((3, 4), -0.25), (2, 1), rotation=turn, depth=0.3)
    free_body(scene, "A", 0.4, (0, 0, 2))
    scene.sphere("ball", "A", 0.2)
    scene.contacts_all()
    back = gauss.load(gauss.save(scene, tmp_path / "flat.xml"), contacts=True).shapes["land"]
    assert back.surface[0] == pytest.approx(scene.shapes["land"].surface[0], abs=FLOAT32)
    assert back.depth == pytest.approx(0.3, abs=FLOAT32)
