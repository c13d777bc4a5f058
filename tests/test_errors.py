"""Bad input gets one clear error at once: it names the thing, what was expected, and what to do."""

import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gauss
from gauss.errors import GaussError, MissingPackageError, SceneError, extra
from gauss.versions import DISTRIBUTION, absent_packages
from tests.support import mechanisms

NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.just("1 kg") | st.none() | st.booleans()


def _scene():
    scene = gauss.Scene("scene")
    scene.body("crank", 1.0, (0.1, 0.1, 0.1))
    scene.body("rod", 1.0, (0.1, 0.1, 0.1))
    scene.revolute("A", "ground", "crank")
    return scene


MISTAKES = {
    "negative mass": (lambda s: s.body("b", -1.0), "mass.*kg"),
    "mass as text": (lambda s: s.body("b", "1 kg"), "mass.*number in .kg.*'1 kg'"),
    "mass as bool": (lambda s: s.body("b", True), "mass.*bool"),
    "mass not finite": (lambda s: s.body("b", float("nan")), "mass.*nan"),
    "negative inertia": (lambda s: s.body("b", 1.0, (-0.1, 0.2, 0.2)), "negative principal moment"),
    "triangle": (lambda s: s.body("b", 1.0, (0.1, 0.1, 0.5)), "triangle inequality.*centre of mass"),
    "triangle off the axes": (lambda s: s.body("b", 1.0, (1, 1, 1, 0.9, 0, 0)), "triangle inequality"),
    "two moments": (lambda s: s.body("b", 1.0, (0.1, 0.1)), "3 moments"),
    "unsymmetric inertia": (lambda s: s.body("b", 1.0, [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), "not symmetric"),
    "inertia without mass": (lambda s: s.body("b", 0.0, (1, 1, 1)), "without mass"),
    "com of two numbers": (lambda s: s.body("b", 1.0, com=(0, 0)), "com: expected 3 numbers"),
    "body named ground": (lambda s: s.body("ground", 1.0), "'ground' is the world"),
    "empty name": (lambda s: s.body(" ", 1.0), "non-empty name"),
    "duplicate body": (lambda s: s.body("crank", 1.0), "'crank'.*taken"),
    "duplicate joint": (lambda s: s.revolute("A", "crank", "rod"), "'A'.*taken"),
    "body on nothing": (lambda s: s.body("b", 1.0, on="rodd"), "Did you mean 'rod'"),
    "unknown parent": (lambda s: s.revolute("B", "crnk", "rod"), "parent.*'crnk'.*Did you mean 'crank'"),
    "unknown child": (lambda s: s.revolute("B", "crank", "rd"), "child.*'rd'.*'rod'"),
    "joint to itself": (lambda s: s.revolute("B", "rod", "rod"), "both 'rod'"),
    "unknown kind": (lambda s: s.joint("B", "hinge", "crank", "rod"), "unknown type 'hinge'"),
    "misspelt kind": (lambda s: s.joint("B", "revolut", "crank", "rod"), "Did you mean 'revolute'"),
    "zero axis": (lambda s: s.revolute("B", "crank", "rod", axis=(0, 0, 0)), "axis.*zero vector"),
    "axis with nan": (lambda s: s.revolute("B", "crank", "rod", axis=(0, 0, np.nan)), "axis.*finite"),
    "axes not perpendicular": (
        lambda s: s.universal("B", "crank", "rod", axis=(0, 0, 1), second_axis=(1, 0, 1)),
        "not perpendicular",
    ),
    "second axis of a hinge": (
        lambda s: s.revolute("B", "crank", "rod", second_axis=(1, 0, 0)),
        "second_axis has no meaning",
    ),
    "screw without pitch": (lambda s: s.joint("B", "screw", "crank", "rod"), "needs a pitch"),
    "pitch of a hinge": (lambda s: s.revolute("B", "crank", "rod", pitch=0.1), "pitch has no meaning"),
    "rotation of a hinge": (lambda s: s.revolute("B", "crank", "rod", rotation=(0.1, 0, 0)), "rotation has no meaning"),
    "unknown frame": (lambda s: s.revolute("B", "crank", "rod", frame="rad"), "frame.*'rad'"),
    "quaternion not unit": (lambda s: s.body("b", 1.0, rotation=(1, 1, 0, 0)), "length 1.414"),
    "not a rotation": (lambda s: s.body("b", 1.0, rotation=np.diag([1, 1, -1])), "not a rotation matrix"),
    "rotation of two numbers": (lambda s: s.body("b", 1.0, rotation=(1, 1)), "roll, pitch, yaw"),
    "drive on nothing": (lambda s: s.drive("C", torque=1.0), "no joint 'C'"),
    "drive twice said": (lambda s: s.drive("A", torque=1.0, force=1.0), "either torque= .* or force="),
    "drive without effort": (lambda s: s.drive("A"), "either torque"),
    "drive with too many": (lambda s: s.drive("A", torque=(1.0, 2.0)), "has 1 freedoms"),
    "law of three": (lambda s: s.drive("A", torque=lambda a, b, c: 0.0), "law.t, motion."),
    "force on nothing": (lambda s: s.force("f", "rid", (0, 0, 1)), "no body 'rid'.*Did you mean 'rod'"),
    "force axes": (lambda s: s.force("f", "rod", (0, 0, 1), axes="local"), "'world' or 'body'"),
    "spring without anything": (lambda s: s.spring("k", "rod", "ground"), "neither stiffness nor damping"),
    "spring to itself": (lambda s: s.spring("k", "rod", "rod", stiffness=1.0), "both ends"),
    "spring of negative length": (lambda s: s.spring("k", "rod", "ground", stiffness=1.0, length=-1.0), "length"),
    "coupling of nothing": (lambda s: s.couple("c", "A", "B", 2.0), "no joint 'B'"),
    "coupling to itself": (lambda s: s.couple("c", "A", "A", 2.0), "cannot drive itself"),
    "start of nothing": (lambda s: s.start("B", 1.0), "no joint 'B'"),
    "start of two numbers": (lambda s: s.start("A", (1.0, 2.0)), "position needs 1"),
    "start as text": (lambda s: s.start("A", "90 deg"), "rad or m.*'90 deg'"),
    "something else": (lambda s: s.add("crank"), "expected a Body"),
    "gravity as number": (lambda s: gauss.Scene("s", gravity=9.81), "gravity: expected 3 numbers"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused_and_leave_the_scene_as_it_was(mistake):
    make, words = MISTAKES[mistake]
    scene, before = _scene(), _scene()
    with pytest.raises(SceneError, match=words):
        make(scene)
    assert scene == before


UNFINISHED = {
    "nothing": (lambda: gauss.Scene("s"), "has no bodies"),
    "a body that hangs on nothing": (_scene, "no chain of joints.*'rod'.*scene.free"),
    "a leaf without mass": (
        lambda: _with(lambda s: (s.body("leaf", 0.0), s.revolute("B", "crank", "leaf"))),
        "'leaf' has no mass",
    ),
    "points that do not meet": (
        lambda: _with(lambda s: s.revolute("B", "crank", "rod", at=(1, 0, 0), child_at=(0, 0.5, 0))),
        "1.118.* m apart",
    ),
}


def _with(change):
    scene = _scene()
    change(scene)
    if "B" in scene.joints and scene.joints["B"].child != "rod":
        scene.revolute("C", "crank", "rod")
    return scene


@pytest.mark.parametrize("case", UNFINISHED)
def test_scenes_that_are_no_mechanism_are_refused(case):
    make, words = UNFINISHED[case]
    with pytest.raises(SceneError, match=words):
        gauss.compile_scene(make())


def test_planar_links_need_one_moment_only():
    scene = gauss.Scene("planar")
    scene.body("link", 1.0, (0, 0, 0.1), com=(0.5, 0, 0))
    scene.revolute("A", "ground", "link")
    system = gauss.compile_scene(scene)
    for backend in ("recursion", "kkt", "schur"):
        assert str(gauss.solve(gauss.assemble(system, system.state([0.3])), backend).status) == "solved"


@pytest.mark.slow
@given(mass=NUMBERS, inertia=st.lists(NUMBERS, max_size=10), com=st.lists(NUMBERS, max_size=4))
def test_any_body_is_physical_or_refused(mass, inertia, com):
    """Whatever is typed: a body exists only with finite, physical numbers, and nothing else than a SceneError comes."""
    scene = gauss.Scene("s")
    try:
        body = scene.body("b", mass, inertia, com)
    except SceneError:
        assert not scene.bodies
        return
    J, _ = body.principal()
    assert body.mass >= 0 and np.isfinite(J).all() and np.isfinite(body.com).all()


@pytest.mark.slow
@given(axis=st.lists(NUMBERS, max_size=4), at=st.lists(NUMBERS, max_size=4), pitch=NUMBERS)
def test_any_joint_is_sound_or_refused(axis, at, pitch):
    scene = _scene()
    try:
        joint = scene.screw("B", "crank", "rod", pitch=pitch, at=at, axis=axis)
    except SceneError:
        assert "B" not in scene.joints
        return
    R = joint.axes()
    assert np.abs(R @ R.T - np.eye(3)).max() <= 1e-12
    gauss.compile_scene(scene)


def test_errors_are_one_tree():
    import gauss.errors as errors

    kinds = [
        k
        for k in vars(errors).values()
        if isinstance(k, type) and issubclass(k, Exception) and k.__module__ == "gauss.errors"
    ]
    assert all(issubclass(k, GaussError) or issubclass(k, Warning) for k in kinds)


def test_loads_on_frames_and_unknown_coordinates():
    system = gauss.compile_scene(mechanisms.rods(2))
    with pytest.raises(gauss.GaussError, match="Did you mean 'J1'"):
        system.joint("J11")
    with pytest.raises(gauss.GaussError, match="load: expected 2"):
        gauss.assemble(system, system.reference, load=[1.0])


def test_a_missing_part_of_a_package_is_the_package():
    with pytest.raises(MissingPackageError, match=r"^nowhere is not installed"), extra("view"):
        import_module("nowhere.colours")


@pytest.mark.slow
def test_a_moment_that_digits_left_below_zero_drives_nothing_backwards():
    scene = gauss.Scene("thin rod")
    rod = scene.body("rod", 1.0, (-1e-7, 1.0, 1.0))
    scene.revolute("A", "ground", rod, axis=(1, 0, 0))
    scene.drive("A", torque=1.0)
    assert rod.principal()[0].tolist() == [0.0, 1.0, 1.0]
    with pytest.raises(gauss.GaussError, match="'A' moves no inertia"):
        gauss.simulate(scene, 0.1)


def _hinge(moment, torque):
    scene = gauss.Scene("hinge")
    scene.revolute("A", "ground", scene.body("rod", 1.0, (moment, 1.0, 1.0)), axis=(1, 0, 0))
    scene.drive("A", torque=torque)
    return scene


def _fast(rate):
    scene = gauss.load("double_pendulum")
    scene.start("A", rate=rate)
    return scene


BEYOND = {  # what has no finite numbers, and what is said of it
    "no inertia": (lambda: gauss.simulate(_hinge(0.0, lambda t: 1.0), 1.0), "'A' moves no inertia"),
    "no inertia, nothing pushes": (lambda: gauss.simulate(_hinge(0.0, lambda t: 0.0 * t), 1.0), "'A' moves no inertia"),
    "no inertia, its slope": (lambda: _slope(_hinge(0.0, lambda t: 0.0 * t)), "'A' moves no inertia"),
    "rates beyond floats": (lambda: gauss.simulate(_fast(1e200), 1e-3, integrator="rk4", step=1e-4), "not finite"),
    "torque beyond floats": (
        lambda: gauss.simulate(_hinge(1.0, lambda t: np.exp(800.0 + t)), 0.1),
        "not finite|finite numbers",
    ),
}


def _slope(scene):
    system = gauss.compile_scene(scene)
    return gauss.derivatives(system, system.initial_state())


@pytest.mark.slow
@pytest.mark.filterwarnings("error::RuntimeWarning")  # numpy's own words about single numbers help nobody
@pytest.mark.parametrize("case", BEYOND)
def test_what_no_number_can_be_is_one_error(case):
    ask, words = BEYOND[case]
    with pytest.raises(gauss.GaussError, match=words):
        ask()


OTHERS = re.compile(r"pip install [^`\n&]*(?<![/.\w-])gauss(?![\w-])")  # the name of somebody else's project
TEXTS = (".py", ".md", ".ipynb", ".toml")


def test_nobody_is_told_to_install_another_project():
    """Messages and pages name missing packages themselves; the distribution has a name of its own."""
    root = Path(__file__).parents[1]
    folders = [root / folder for folder in ("gauss", "models", "benchmarks")]
    places = [root / "README.md", *(path for folder in folders for path in folder.rglob("*") if path.suffix in TEXTS)]
    assert [str(path) for path in places if OTHERS.search(path.read_text())] == []
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert project["name"] == DISTRIBUTION != "gauss"
    wanted = [entry for extra in project["optional-dependencies"].values() for entry in extra]
    assert [entry for entry in wanted if re.match(r"gauss(?!-)", entry)] == []


@pytest.mark.parametrize(
    "module, package", [("no_such_thing", "no_such_thing"), ("imageio_ffmpeg.no_such", "imageio-ffmpeg")]
)
def test_a_missing_package_is_named_as_it_is_installed(module, package, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingPackageError, match=f"pip install {package}"), extra("film"):
        import_module(module)


def test_all_that_an_extra_lacks_is_named_at_once(monkeypatch):
    lines = ["numpy>=1.26", "no-such.thing>=1 ; extra == 'docs'", "numpy>=1.26; extra == 'docs'", "no_other; extra == 'doc'"]
    monkeypatch.setattr("importlib.metadata.requires", lambda name: lines if name == DISTRIBUTION else None)
    assert absent_packages("docs") == ["no-such.thing"] and absent_packages("view") == []
    with (
        pytest.raises(MissingPackageError, match=r"pip install furo no-such\.thing \(extra 'docs'\)") as caught,
        extra("docs"),
    ):
        raise ModuleNotFoundError("No module named 'furo.sub'", name="furo.sub")
    assert caught.value.name == "furo"


BLOCKED = """
import sys
sys.modules.update(dict.fromkeys(("pinocchio", "osqp", "qpsolvers")))
import gauss
scene = gauss.load("four_bar")
motion = gauss.simulate(scene, 0.05)
compulsion = gauss.assemble(motion.system, motion.state(0))
for ask in (lambda: gauss.solve(compulsion, backend="osqp"), lambda: gauss.crosscheck(scene)):
    try:
        ask()
    except gauss.errors.MissingPackageError as error:
        print(error)
"""


@pytest.mark.slow
def test_what_needs_a_missing_package_says_so_and_the_rest_works():
    found = subprocess.run([sys.executable, "-c", BLOCKED], capture_output=True, text=True, cwd=Path(__file__).parents[1])
    assert found.returncode == 0, found.stderr
    assert [line.split(" (")[0] for line in found.stdout.splitlines()] == [
        "qpsolvers is not installed: pip install qpsolvers",
        "pinocchio is not installed: pip install pin",
    ]
