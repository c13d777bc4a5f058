import ctypes
import shutil
import subprocess
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

import gauss
from gauss import export
from gauss.analysis.export.fmu.model_description import variables
from gauss.errors import ArgumentError, SceneError, SimulationError
from gauss.scene import actuators
from gauss.scene.named_numbers import scene_of, value_of
from gauss.system import coordinate_rates
from tests.support.files import call

COMPILER = shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
ACCURACY = 1e-5  # of motions of two integrators with tolerances of 1e-8, relative to the largest value
ROUND_OFF = 1e-14  # of rates, relative to the largest
SPAN = 0.4


def cart():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=(-50.0, 50.0))
    scene.output("tip", "position", of="pole", at=(0, 0, 0.3))
    scene.output("felt", "acceleration", of="pole")
    return scene


def motor():
    scene = gauss.load("pendulum")
    actuators.dc_motor(scene, "motor", "A", 12.0, resistance=1.0, inductance=0.02, constant=0.3, ratio=4.0)
    return scene


def top():
    scene = gauss.Scene("spinning", gravity=(0, 0, -9.81))
    scene.ball("pivot", "ground", scene.body("top", 1.0, (0.01, 0.01, 0.02), com=(0, 0, 0.2)))
    scene.start("pivot", rate=(1.0, 0.5, 20.0))
    return scene


SCENES = {"four-bar": lambda: gauss.load("four_bar"), "cart-pole": cart, "motor": motor, "ball joint": top}


@pytest.mark.peer
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("name", SCENES)
def test_units_move_as_the_scene_does(name, kind, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    from fmpy.validation import validate_fmu

    system = gauss.compile_scene(SCENES[name]())
    path = str(export.to_fmu(system, tmp_path))
    assert validate_fmu(path) == []
    states = [
        one.name
        for one in fmpy.read_model_description(path).modelVariables
        if one.initial == "exact" and one.causality != "input"
    ]
    given = {"start_values": {"push": 3.0}} if system.scene.inputs else {}
    found = fmpy.simulate_fmu(
        path, stop_time=SPAN, output_interval=0.01, fmi_type=kind, relative_tolerance=1e-8, output=states, **given
    )
    held = {"control": lambda t, q, v: [3.0], "rate": 100.0} if system.scene.inputs else {}
    wanted = gauss.simulate(system, SPAN, progress=False, **held)
    expected = np.concatenate([wanted.q[-1], wanted.v[-1]])
    np.testing.assert_allclose(list(found[-1])[1:], expected, rtol=0.0, atol=ACCURACY * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_rates_of_a_unit_are_our_accelerations(name, tmp_path):
    """Called as an importer does, without one: instantiate, set time and states, get the derivatives of the states."""
    system, rng = gauss.compile_scene(SCENES[name]()), np.random.default_rng(1)
    with zipfile.ZipFile(export.to_fmu(system, tmp_path, "unit")) as archive:
        archive.extractall(tmp_path)
    token = ElementTree.parse(tmp_path / "modelDescription.xml").getroot().get("instantiationToken")
    library = ctypes.CDLL(str(next((tmp_path / "binaries").rglob("unit.*"))))
    library.fmi3InstantiateModelExchange.restype = ctypes.c_void_p
    given = [b"unit", token.encode(), b"", ctypes.c_bool(False), ctypes.c_bool(False), None, None]
    unit = ctypes.c_void_p(library.fmi3InstantiateModelExchange(*given))
    size, array = ctypes.c_size_t(system.n_q + system.n_v), (ctypes.c_double * (system.n_q + system.n_v))
    start = system.initial_state()
    for t in (0.0, 0.3, 0.7):
        q = gauss.system.retract(system, start.q, 0.2 * rng.normal(size=system.n_v))
        state = system.projected(system.state(q, start.v + rng.normal(size=system.n_v), t))
        found = array()
        assert library.fmi3SetTime(unit, ctypes.c_double(t)) == 0
        assert library.fmi3SetContinuousStates(unit, array(*state.q, *state.v), size) == 0
        assert library.fmi3GetContinuousStateDerivatives(unit, found, size) == 0
        expected = np.concatenate([coordinate_rates(system, state.q, state.v), system.accelerations(state)])
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUND_OFF * np.abs(expected).max())
    library.fmi3FreeInstance(unit)


@pytest.mark.peer
@pytest.mark.slow
def test_outputs_of_a_unit_are_those_of_the_scene(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    system = gauss.compile_scene(cart())
    path = str(export.to_fmu(system, tmp_path, "unit"))
    names = [f"{output}[{k}]" for output in ("tip", "felt") for k in range(3)]
    found = fmpy.simulate_fmu(path, stop_time=SPAN, output_interval=0.01, fmi_type="CoSimulation", output=names)
    wanted = gauss.simulate(system, SPAN, progress=False)
    expected = np.concatenate([wanted.output("tip")[-1], wanted.output("felt")[-1]])
    np.testing.assert_allclose(list(found[-1])[1:], expected, rtol=0.0, atol=ACCURACY * np.abs(expected).max())


def sprung():
    scene = gauss.load("four_bar")
    scene.joint_spring("spring", "A", stiffness=5.0, damping=0.3, rest=0.2)
    return scene


TUNED = {
    "double pendulum": (
        lambda: gauss.load("double_pendulum"),
        {"lower.mass": 2.5, "lower.com.x": 0.4, "B.at[0]": 0.8, "gravity.y": -5.0},
    ),
    "four-bar": (sprung, {"coupler.mass": 3.0, "spring.stiffness": 9.0, "spring.damping": 0.1}),
    "cart-pole": (cart, {"pole.mass": 0.4, "cart.mass": 2.0}),
}


@pytest.mark.peer
@pytest.mark.slow
@pytest.mark.parametrize("name", TUNED)
def test_parameters_of_a_unit_are_numbers_of_the_scene(name, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    from fmpy.validation import validate_fmu

    make, values = TUNED[name]
    scene = make()
    path = str(export.to_fmu(scene, tmp_path, "tuned", parameters=list(values)))
    assert validate_fmu(path) == []
    described = {one.name: one for one in fmpy.read_model_description(path).modelVariables}
    for parameter in values:
        assert (described[parameter].causality, described[parameter].variability) == ("parameter", "tunable")
        assert float(described[parameter].start) == value_of(scene, parameter)
    states = [one.name for one in described.values() if one.initial == "exact" and one.causality in ("output", "local")]
    for given in ({}, values):
        found = fmpy.simulate_fmu(
            path, stop_time=SPAN, output_interval=0.01, relative_tolerance=1e-8, output=states, start_values=given
        )
        wanted = gauss.simulate(scene_of(scene, given), SPAN, progress=False)
        expected = np.concatenate([wanted.q[-1], wanted.v[-1]])
        np.testing.assert_allclose(list(found[-1])[1:], expected, rtol=0.0, atol=ACCURACY * np.abs(expected).max())


def welded():
    """A pendulum of two bodies, whose common centre of mass is no polynomial of a mass."""
    scene = gauss.load("pendulum")
    scene.fixed("weld", "rod", scene.body("bob", 1.0, position=(1.0, 0.0, 0.0)))
    return scene


@pytest.mark.parametrize(
    ("make", "parameter", "error", "words"),
    [
        (lambda: gauss.load("pendulum"), "rod.maß", SceneError, "rod"),
        (lambda: gauss.load("pendulum"), "A.position", ArgumentError, "start values"),
        (welded, "bob.mass", ArgumentError, "no polynomials of bob.mass"),
    ],
)
def test_what_is_no_parameter_is_named(make, parameter, error, words, tmp_path):
    with pytest.raises(error, match=words):
        export.to_fmu(make(), tmp_path, parameters=[parameter])


@pytest.mark.slow
def test_sources_are_within_the_unit_and_strict(tmp_path):
    path = export.to_fmu(cart(), tmp_path)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    sources = [str(tmp_path / "sources" / name) for name in ("unit.c", "model.c")]
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fPIC", "-shared"]
    subprocess.run([COMPILER, *flags, *sources, "-o", str(tmp_path / "unit.so"), "-lm"], check=True)


def with_stop():
    scene = gauss.load("pendulum")
    scene.stop("A", highest=1.0, name="buffer")
    return scene


def with_force_output():
    scene = gauss.load("pendulum")
    scene.output("bearing", "joint_force", of="A")
    return scene


@pytest.mark.parametrize(("make", "named"), [(with_stop, "buffer"), (with_force_output, "bearing")])
def test_what_no_unit_can_hold_is_named(make, named, tmp_path):
    with pytest.raises(SimulationError, match=f"cannot be exported: .*{named}"):
        export.to_fmu(make(), tmp_path)
    with pytest.raises(ArgumentError, match="no functions to choose"):
        export.save_as(gauss.load("pendulum"), "fmu", tmp_path, ["mass_matrix"])


@pytest.mark.slow
def test_files_of_units_have_the_parameters_that_are_asked(tmp_path):
    (path,) = export.save_as(gauss.load("pendulum"), "fmu", tmp_path, parameters=["rod.mass"])
    with zipfile.ZipFile(path) as unit:
        assert 'name="rod.mass"' in unit.read("modelDescription.xml").decode()
    with pytest.raises(ArgumentError, match="'c' has no tunable parameters"):
        export.save_as(gauss.load("pendulum"), "c", tmp_path, parameters=["rod.mass"])


@pytest.mark.slow
def test_the_command_writes_tunable_parameters(tmp_path):
    given = ["export", "pendulum", "--to", "fmu", "--parameter", "rod.mass", "--output", str(tmp_path)]
    assert call(*given).exit_code == 0
    with zipfile.ZipFile(tmp_path / "pendulum.fmu") as unit:
        assert 'name="rod.mass"' in unit.read("modelDescription.xml").decode()


def test_variables_have_names_of_their_own():
    """An input named after its joint, a joint called time, outputs named like rates and derivatives."""
    scene = gauss.load("double_pendulum")
    first, second = scene.joints
    scene.input(first, first)
    for name in (first, "time", f"{first} rate", f"der({second})", f"output {first}"):
        scene.output(name, "rate", second)
    system = gauss.compile_scene(scene)
    found = [one for kind in variables(system, system.initial_state(), {}).values() for one in kind]
    names, references = [one.name for one in found], [one.reference for one in found]
    assert len(set(names)) == len(names) and references == list(range(len(names)))
    scene.output("bell \x07", "rate", second)
    with pytest.raises(ArgumentError, match="letters"):
        variables(gauss.compile_scene(scene), system.initial_state(), {})
