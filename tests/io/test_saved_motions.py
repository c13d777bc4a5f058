"""Motions from disk: shown with the meshes of their robot, or without them by name; other files are refused in a line."""

import shutil
import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning, SceneError
from gauss.io.results import joined, separated

pytest.importorskip("h5netcdf")
MESH = """solid s
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid s
"""
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
VISUAL = '<visual><geometry><mesh filename="package://meshes/part.stl"/></geometry></visual>'
ROBOT = f"""<robot name="r">
<link name="base">{INERTIAL}{VISUAL}</link>
<link name="arm">{INERTIAL}{VISUAL}</link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
</robot>"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.stl").write_text(MESH)
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT)
    return path


def _saved(robot, ending: str, root: str):
    return gauss.save(gauss.simulate(gauss.load(robot, root=root), 0.01), robot.with_suffix(ending))


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".nc", ".h5", ".zarr"])
@pytest.mark.parametrize("root", ["fixed", "free"])
def test_a_saved_motion_keeps_its_meshes(robot, ending, root):
    """In its file, and by the name of the file that they are from."""
    from gauss.io.visuals import read_visuals, saved_visuals, visuals_of

    path, expected = _saved(robot, ending, root), read_visuals(robot, root)
    named = visuals_of(gauss.load_motion(path).system.scene)
    robot.unlink()
    for found in (named, saved_visuals(path)):
        assert [visual.body for visual in found] == [visual.body for visual in expected] and len(found) == 2
        for one, other in zip(found, expected, strict=True):
            assert (one.vertices == other.vertices).all() and (one.faces == other.faces).all()
            assert one.colour == other.colour


LOST = {
    "the file is gone": lambda robot: robot.unlink(),
    "a mesh is gone": lambda robot: shutil.rmtree(robot.parent / "meshes"),
    "another robot": lambda robot: robot.write_text(ROBOT.replace('"arm"', '"leg"')),
    "no robot": lambda robot: robot.write_text("<robot/>"),
}


@pytest.mark.slow
@pytest.mark.parametrize("loss", LOST)
def test_meshes_that_are_lost_are_named(robot, loss):
    from gauss.io.visuals import visuals_of

    scene = gauss.load_motion(_saved(robot, ".nc", "fixed")).system.scene
    LOST[loss](robot)
    with pytest.warns(NotImportedWarning, match="scene 'r' is without its meshes: .*robot.urdf"):
        assert visuals_of(scene) == []


@pytest.mark.slow
def test_the_command_line_shows_the_meshes_of_saved_motions(robot, monkeypatch):
    viewer = pytest.importorskip("gauss.view.viewer", exc_type=ImportError)
    from typer.testing import CliRunner

    from gauss.cli import app

    path, given = _saved(robot, ".nc", "free"), {}
    robot.unlink()
    monkeypatch.setattr(viewer, "export_html", lambda thing, path, **options: given.update(options) or path)
    arguments = ["show", str(path), "--beside", str(path), "--html", str(robot.with_suffix(".html"))]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    for meshes in ("visuals", "beside_visuals"):
        assert [visual.body for visual in given[meshes]] == ["base", "arm"]


@pytest.mark.slow
def test_a_scene_that_no_robot_gave_has_no_meshes_to_lose(tmp_path):
    from gauss.io.visuals import visuals_of

    scene = gauss.load_motion(gauss.save(gauss.simulate(gauss.load("pendulum"), 0.01), tmp_path / "motion.nc")).system.scene
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert scene.source == "" and visuals_of(scene) == []


def _empty(path):
    import xarray

    xarray.Dataset({"x": ("x", np.zeros(3))}).to_netcdf(path, engine="h5netcdf")


def _cut(path):
    whole = gauss.save(gauss.simulate(gauss.load("pendulum"), 0.01), path).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])


NONE = {
    "no file": (lambda path: None, "no such file"),
    "text": (lambda path: path.write_text("no motion"), "not a motion .*of another format"),
    "nothing": (lambda path: path.write_bytes(b""), "not a motion .*of another format"),
    "cut off": (_cut, "not a motion .*cut off"),
    "other arrays": (_empty, "not a result file .*missing: .*'time'"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", NONE)
def test_what_is_no_motion_is_told_in_one_line(tmp_path, what):
    make, words = NONE[what]
    path = tmp_path / "motion.nc"
    make(path)
    with pytest.raises(FileError, match=rf"motion.nc: {words}") as caught:
        gauss.load_motion(path)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".csv", ".json", ".npz"])
def test_numbers_without_their_scene_are_refused_with_what_is_read(tmp_path, ending):
    path = gauss.save(gauss.simulate(gauss.load("pendulum"), 0.01), tmp_path / f"motion{ending}")
    with pytest.raises(FileError, match=r"motions are read from \.nc, \.h5, \.zarr"):
        gauss.load_motion(path)


@pytest.mark.parametrize("text", ["", "\n# nothing yet\n", 'name = "s"\ngravity = [0, 0, -1]\n'])
def test_a_scene_file_without_bodies_is_named(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=r"scene.toml: .*\[\[body\]\]"):
        gauss.load(path)


def test_elements_are_called_as_in_a_scene_file():
    scene = gauss.Scene("s")
    scene.body("a", 1.0, (1, 1, 1))
    scene.free("f", "ground", "a")
    with pytest.raises(SceneError, match="joint_spring 'damper': joint 'f'"):
        scene.joint_spring("damper", "f", damping=1.0)


GAPS = ("stop", "stop of A, the first", "[stop]", '"', "a,b", ", ", " x")


@pytest.mark.parametrize("names", [*((name,) for name in GAPS), GAPS, ()], ids=repr)
def test_names_of_gaps_are_taken_apart_as_they_were(names):
    assert separated(joined(names)) == names


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_events_name_their_gaps_again(tmp_path, ending):
    scene = gauss.load("pendulum")
    scene.stop(next(iter(scene.joints)), -0.5, 0.5, name="left, or right", restitution=0.5)
    motion = gauss.simulate(scene, 1.5, progress=False)
    assert motion.events
    again = gauss.load_motion(gauss.save(motion, tmp_path / f"motion{ending}"))
    assert again.events == motion.events
