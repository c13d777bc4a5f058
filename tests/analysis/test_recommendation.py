"""What is said before a simulation holds in it: rates, distance to singularity, the method that fits."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss import doctor
from gauss.backends.backend import BACKENDS
from gauss.codegen import object_cache

DIFFERENCES = 1e-6  # relative error of rates by central differences of step 1e-6


def _oscillator(stiffness, damping):
    scene = gauss.Scene("oscillator", gravity=(0, 0, 0))
    scene.body("mass", mass=2.0, inertia=(0.1, 0.1, 0.1))
    scene.prismatic("rail", "ground", "mass")
    scene.joint_spring("spring", "rail", stiffness=stiffness, damping=damping)
    scene.start("rail", position=0.1)
    return scene


def _loop(angle):
    """A parallelogram that folds flat, where it is singular, turned by an angle from there."""
    scene = gauss.load("parallelogram")
    scene.start("A1", position=np.pi / 2 - angle)
    return gauss.compile_scene(scene)


@pytest.mark.parametrize("stiffness, damping", [(50.0, 0.4), (50.0, 400.0), (0.5, 0.0)])
def test_rates_are_those_of_the_oscillator(stiffness, damping):
    found = gauss.advise(gauss.compile_scene(_oscillator(stiffness, damping))).rates
    expected = np.roots([2.0, damping, stiffness])
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=DIFFERENCES)


@pytest.mark.slow
@pytest.mark.parametrize("damping, method", [(0.4, "dop853"), (2e4, "radau5")])
def test_the_recommended_method_takes_fewer_steps(damping, method):
    scene = _oscillator(50.0, damping)
    assert gauss.advise(gauss.compile_scene(scene)).method == method
    steps = {name: gauss.simulate(scene, 2.0, integrator=name).stats.steps for name in ("dop853", "radau5")}
    assert min(steps, key=steps.get) == method


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene, method",
    [("block_on_incline", "time_stepping"), ("double_pendulum_stops", "dop853"), ("friction_oscillator", "dop853")],
)
def test_the_recommended_method_runs(scene, method):
    scene = gauss.load(scene)
    found = gauss.advise(gauss.compile_scene(scene))
    assert found.method == method and method in str(found)
    gauss.simulate(scene, 0.01, integrator=found.method, step=1e-2 if "step=" in found.reason else None)


@pytest.mark.slow
def test_the_distance_to_a_singular_configuration_shrinks_on_the_way_there():
    distances = [gauss.advise(_loop(angle)).separation for angle in (1.0, 0.1, 0.01, 1e-4, 0.0)]
    assert (np.diff(distances) < 0).all()
    assert "near-singular" in str(gauss.advise(_loop(1e-4)))
    assert gauss.advise(gauss.compile_scene(gauss.load("pendulum"))).separation is None


def test_scaling_is_that_of_the_bodies():
    scene = gauss.Scene("two")
    scene.body("light", mass=0.01, inertia=(1e-4, 1e-4, 0.0))
    scene.body("heavy", mass=10.0, inertia=(5.0, 5.0, 5.0))
    scene.revolute("A", "ground", "heavy", axis=(0, 1, 0))
    scene.revolute("B", "heavy", "light", at=(1, 0, 0), axis=(0, 1, 0))
    found = gauss.advise(gauss.compile_scene(scene))
    assert (found.masses, found.moments) == pytest.approx((1e3, 5e4))


def test_the_doctor_finds_what_there_is():
    findings = {finding.name: finding for finding in doctor.examine()}
    assert all(finding.works for finding in findings.values())
    assert str(object_cache.folder()) in findings["cache"].text
    assert f"{len(BACKENDS)} methods of gauss" in findings["solvers"].text and "clarabel" in findings["solvers"].text


def test_the_doctor_looks_at_all_extras_of_users():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    assert set(project["optional-dependencies"]) - {"bench", "dev"} == set(doctor.EXTRAS)  # what is left: for developers


def test_the_doctor_says_what_is_missing(monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", "")
    monkeypatch.setitem(doctor.EXTRAS, "results", ("numpy", "no_such_package"))
    monkeypatch.setattr(doctor, "trace", lambda *_: lambda x: 1 / 0)
    findings = {finding.name: finding for finding in doctor.examine()}
    assert "not kept" in findings["cache"].text
    assert "no_such_package not installed" in findings["[results]"].text
    assert findings["[results]"].remedy == "pip install no_such_package"
    assert not findings["machine code"].works and "ZeroDivisionError" in findings["machine code"].text


def test_the_doctor_lists_and_empties_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path / "cache"))
    for name in (object_cache.key("code"), "made-" + object_cache.key("entry")):
        object_cache.write(name, bytes(500_000))
    (tmp_path / "cache" / "numbers.txt").write_text("of the user")
    listed = {finding.name: finding.text for finding in doctor.examine_cache()}
    assert "2 files" in listed["cache"] and listed["object code"] == listed["by content"] == "1 files, 0.5 MB"
    emptied = {finding.name: finding.text for finding in doctor.examine_cache(empty=True)}
    assert "2 files" in emptied["emptied"] and emptied["object code"].startswith("0 files")
    assert {path.name for path in (tmp_path / "cache").iterdir()} == {"key", "numbers.txt"}


@pytest.mark.parametrize(
    ("shape", "friction", "stepped"), [("mesh", 0.0, 1), ("mesh", 0.5, 1), ("ball", 0.5, 1), ("ball", 0.0, 0)]
)
def test_scenes_that_need_time_stepping_are_explained_and_advised_so(shape, friction, stepped):
    scene = gauss.Scene("tetrahedron on a floor", gravity=(0, 0, -9.81))
    scene.body("solid", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0, 0, 1.0))
    scene.free("moves", "ground", "solid")
    if shape == "mesh":
        scene.mesh("tetrahedron", "solid", np.vstack([np.zeros(3), np.eye(3)]))
    else:
        scene.sphere("ball", "solid", 0.5)
    scene.half_space("floor")
    scene.contacts_all(friction=friction)
    system = gauss.compile_scene(scene)
    found, stepped = (system.explain(), gauss.advise(system).method), shape == "mesh" or friction > 0.0
    assert ["time_stepping" in one for one in found] == [stepped, stepped]
    assert "accelerations: " in found[0]
