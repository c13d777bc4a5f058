"""Scenes in files and by name: nothing is lost, nothing is executed, mistakes are named."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gauss
from gauss.errors import FileError, PainleveWarning, SceneError
from gauss.io.catalog import families, folder, shipped
from tests.support import mechanisms

MODELS = sorted(shipped())
FAMILIES = sorted(families())
FINITE = st.floats(-1e6, 1e6, allow_nan=False)
POSITIVE = st.floats(1e-6, 1e6)


@pytest.mark.parametrize("name", MODELS + FAMILIES)
def test_scenes_survive_a_file_unchanged(name, tmp_path):
    scene = gauss.load(name)
    assert gauss.load(gauss.save(scene, tmp_path / "scene.toml")) == scene


@pytest.mark.slow
@given(mass=POSITIVE, moment=POSITIVE, point=st.tuples(FINITE, FINITE, FINITE), stiffness=POSITIVE, text=st.text(min_size=1))
def test_numbers_and_names_survive_to_the_last_bit(mass, moment, point, stiffness, text, tmp_path_factory):
    name = text if text.strip() else "x"
    scene = gauss.Scene(name, gravity=point)
    try:
        scene.body(name, mass, (moment, moment, moment), com=point, rotation=np.array(point) / 1e6)
    except gauss.GaussError:
        return  # "ground"
    scene.universal("U", "ground", name, at=point, axis=(0, 0, 2), second_axis=(0, 3, 0))
    scene.drive("U", torque=point[:2])
    scene.force("F", name, force=point, at=point, axes="body")
    scene.spring("S", name, "ground", other_at=point, stiffness=stiffness)
    scene.start("U", point[:2])
    path = tmp_path_factory.mktemp("round") / "scene.toml"
    assert gauss.load(gauss.save(scene, path)) == scene


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_models_start_consistent_and_keep_their_energy(name):
    from gauss.dynamics.assemble import position_residual
    from gauss.dynamics.kinematics import kinematics

    system = gauss.compile_scene(gauss.load(name))
    state = system.initial_state()
    assert np.abs(position_residual(kinematics(system, state))).max() <= 1e-12
    rough = bool(system.slips.placed)  # friction of contacts is stepped by a method of order 1
    options = {"integrator": "time_stepping", "step": 2e-3} if rough else {"rtol": 1e-10, "atol": 1e-12}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PainleveWarning)
        trajectory = gauss.simulate(system, 0.05, **options)
    energy = gauss.energy(trajectory)
    assert np.abs(energy.balance).max() <= (1e-2 if rough else 1e-8) * max(energy.scale, 1e-3)


def test_catalogue_describes_everything():
    described = gauss.catalog()
    assert set(described) == set(MODELS) | set(FAMILIES)
    assert all(len(text) > 20 for text in described.values())


def test_the_format_page_knows_every_key():
    """models/README.md names every section and every key that a file may have."""
    from gauss.scene.toml import SECTIONS, _keys

    page = (folder() / "README.md").read_text()
    for section, kind in SECTIONS.items():
        assert f"[[{section}]]" in page
        for key in _keys(section, kind):
            assert f"`{key}`" in page, (section, key)


def test_the_example_of_the_format_page_loads(tmp_path):
    page = (folder() / "README.md").read_text()
    path = tmp_path / "example.toml"
    path.write_text(re.search(r"```toml\n(.*?)```", page, re.S).group(1))
    assert gauss.simulate(gauss.load(path), 0.1).t[-1] == 0.1


GOOD = """
[[body]]
name = "crank"
mass = 1.0
inertia = [0.1, 0.1, 0.1]

[[joint]]
name = "A"
type = "revolute"
parent = "ground"
child = "crank"
"""

MISTAKES = {
    "not toml": ("name = ", "not a TOML file"),
    "unknown section": (GOOD + '[[boddy]]\nname = "x"', "unknown section 'boddy'. Did you mean 'body'"),
    "unknown key": (GOOD.replace("mass", "mas"), r"\[\[body\]\] 'crank': unknown key 'mas'. Did you mean 'mass'"),
    "single brackets": (GOOD.replace("[[body]]", "[body]"), r"write \[\[body\]\] with double brackets"),
    "missing mass": (GOOD.replace("mass = 1.0", ""), "'crank': missing mass"),
    "missing two": ('[[joint]]\nname = "A"', "missing type, parent, child"),
    "mass as text": (GOOD.replace("1.0", '"1 kg"'), "mass of|mass: expected a"),
    "infinite mass": (GOOD.replace("1.0", "inf"), "finite"),
    "nan": (GOOD.replace("0.1, 0.1]", "0.1, nan]"), "finite"),
    "wrong type": (GOOD.replace('"revolute"', '"revolut"'), "Did you mean 'revolute'"),
    "wrong child": (GOOD.replace('child = "crank"', 'child = "rank"'), "Did you mean 'crank'"),
    "table for a number": (GOOD.replace("mass = 1.0", "mass = {kg = 1.0}"), "mass: expected"),
    "code": (GOOD + '[[drive]]\njoint = "A"\neffort = "__import__(\'os\').abort()"', "expected a number"),
    "gravity": ("gravity = 9.81\n" + GOOD, "gravity: expected 3 numbers"),
    "date": (GOOD.replace("1.0", "2020-01-01"), "mass: expected"),
    "start": (GOOD + '[[start]]\njoint = "B"', "no joint 'B'"),
    "same name twice": (GOOD + GOOD, "taken"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_files_are_named_with_the_file(mistake, tmp_path):
    text, words = MISTAKES[mistake]
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=words) as caught:
        gauss.load(path)
    assert "scene.toml" in str(caught.value)


@pytest.mark.slow
@given(text=st.text())
def test_any_text_is_a_scene_or_a_clear_error(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("any") / "scene.toml"
    path.write_text(text, encoding="utf-8")
    try:
        gauss.load(path)
    except FileError as error:
        assert "scene.toml" in str(error)


@pytest.mark.parametrize(
    "source, options, words",
    [
        ("four_baar", {}, "Did you mean 'four_bar'"),
        ("robot:pandda", {}, "Did you mean 'panda'"),
        ("x" * 5000, {}, "neither a file nor a model"),  # longer than a name of a file may be
        ("missing.toml", {}, "missing.toml: no such file"),
        ("missing.urdf", {}, "no such file"),
        ("scene.step", {}, "cannot read a file of type '.step'"),
        ("four_bar", {"n": 3}, "takes no options"),
        ("n_pendulum", {"m": 3}, "unexpected keyword"),
        ("robot:panda", {"rot": "free"}, "Did you mean 'root'"),
        ("robot:panda", {"root": "loose"}, "root must be one of fixed, free"),
    ],
)
def test_what_does_not_exist_is_named(source, options, words):
    with pytest.raises(FileError, match=words):
        gauss.load(source, **options)


def test_functions_cannot_be_written(tmp_path):
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: t)
    with pytest.raises(FileError, match="Python function"):
        gauss.save(scene, tmp_path / "scene.toml")
    with pytest.raises(FileError, match="written as .toml"):
        gauss.save(mechanisms.rods(1), tmp_path / "scene.json")


def test_motions_are_readable_without_gauss(tmp_path):
    scene = mechanisms.rods(2)
    trajectory = gauss.simulate(scene, 0.1, times=[0.0, 0.05, 0.1])
    archive = np.load(gauss.save(trajectory, tmp_path / "motion.npz"))
    assert np.array_equal(archive["q"], trajectory.q) and np.array_equal(archive["t"], trajectory.t)
    assert list(archive["coordinates"]) == ["J1", "J2"] and list(archive["bodies"]) == ["rod1", "rod2"]
    assert np.array_equal(archive["positions"][:, 1], trajectory.body("rod2").position)


@pytest.mark.slow
def test_every_name_of_the_package_exists():
    assert all(hasattr(gauss, name) for name in gauss.__all__)
    assert sorted(gauss.__all__) == gauss.__all__
    assert Path(folder(), "families.py").is_file()


@pytest.mark.parametrize("name", ["half \ud800", "cut\0off", "ends\0"])
def test_names_that_no_file_can_hold_are_refused(name):
    scene = gauss.load("pendulum")
    with pytest.raises(SceneError, match="no file can hold"):
        scene.frame(name, "rod")


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".csv", ".json", ".nc"])
def test_columns_that_no_file_can_hold_are_refused(tmp_path, ending):
    with pytest.raises(FileError, match="no file can hold"):
        gauss.save({"half \ud800": np.arange(3.0)}, tmp_path / f"table{ending}")
