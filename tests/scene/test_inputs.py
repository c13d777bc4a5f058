"""Inputs of a scene: on several joints, by a law, by forces on bodies; what is none is refused by name."""

import tomllib

import numpy as np
import pytest

import gauss
from gauss.dynamics.inputs import InputForces, driven_scene
from gauss.errors import FileError, SceneError
from gauss.scene.toml import from_tables, toml_text
from tests.support.files import linear

SAME = 1e-12  # relative: sums in another order
STEP = 5e-3


def arm() -> gauss.Scene:
    scene = gauss.Scene("arm")
    scene.body("a", 1.0, (0.1, 0.2, 0.25), com=(0.3, 0.1, 0))
    scene.body("b", 2.0, (0.1, 0.2, 0.25), com=(0.2, 0.1, 0.1), position=(1, 0, 0))
    scene.revolute("A", "ground", "a", axis=(0, 1, 0))
    scene.universal("U", "a", "b", at=(1, 0, 0), axis=(0, 1, 0), second_axis=(0, 0, 1))
    scene.start("A", 0.3, 0.5)
    return scene


WRENCH = gauss.Force("jet", "b", (1, 2, 3), (0.1, 0.2, 0.3), at=(0, 0.1, 0), axes="body")
SERVO = {"effort": lambda u, t, at: 3.0 * (u - at.coordinate("A")) - 0.5 * at.rate("A")}
KINDS = {
    "several joints": ({"A": 0.5, "U.angle2": -2.0}, {"limits": 1.0}),
    "a servo": ("A", SERVO),
    "a servo of several": ({"A": 0.5, "U.angle1": 2.0}, SERVO),
    "forces": ((), {"forces": [WRENCH], "limits": (-1.0, 0.5)}),
    "forces that turn": ((), {"forces": [gauss.Force("f", "a", lambda t, at: at.rotation("a")[:, 0])], **SERVO}),
    "both": ({"A": 2.0}, {"forces": [WRENCH]}),
}


@pytest.mark.parametrize("name", KINDS)
def test_inputs_are_loads_of_their_values(name):
    joint, options = KINDS[name]
    scene, value = arm(), 0.8
    scene.input("u", joint, **options)
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    load = InputForces(system).forces(np.array([value]), state)
    expected = gauss.solve(gauss.assemble(system, state, load)).qdd
    driven = gauss.compile_scene(driven_scene(scene, {"u": lambda t: value}))
    assert gauss.solve(gauss.assemble(driven, state)).qdd == pytest.approx(expected, rel=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_inputs_are_held_in_machine_code(name):
    joint, options = KINDS[name]
    scene = arm()
    scene.input("u", joint, **options)
    table = [0.8, -0.3]
    held = gauss.simulate(scene, 2 * STEP, control=table, rate=1 / STEP, integrator="rk4", step=STEP / 5, progress=False)
    first = gauss.simulate(driven_scene(scene, {"u": lambda t: 0.8}), STEP, integrator="rk4", step=STEP / 5, progress=False)
    end = first.state(-1)
    second = gauss.compile_scene(driven_scene(scene, {"u": lambda t: -0.3}))
    end = gauss.simulate(second, STEP, state=type(end)(0.0, end.q, end.v), integrator="rk4", step=STEP / 5, progress=False)
    assert held.q[-1] == pytest.approx(end.q[-1], rel=1e-10)


def test_inputs_of_several_joints_are_kept_in_files():
    scene = arm()
    scene.input("u", {"A": 0.5, "U.angle2": -2.0}, limits=(-1, 2))
    text = toml_text(scene)
    assert from_tables(tomllib.loads(text)).inputs == scene.inputs
    table = text.replace('[["A", 0.5], ["U.angle2", -2.0]]', '{A = 0.5, "U.angle2" = -2.0}')
    assert table != text and from_tables(tomllib.loads(table)).inputs == scene.inputs


@pytest.mark.parametrize("options", [SERVO, {"forces": [WRENCH]}])
def test_laws_and_forces_of_inputs_are_no_text(options):
    scene = arm()
    scene.input("u", "A", **options)
    with pytest.raises(FileError, match="input 'u'.*cannot hold"):
        toml_text(scene)


REFUSED = {
    "no joint": ((), {}, "name a joint"),
    "another joint": ({"A": 1.0, "B": 1.0}, {}, "no joint 'B'"),
    "a joint of two freedoms": ({"U": 1.0}, {}, "has 2 freedoms"),
    "a factor that is none": ({"A": "two"}, {}, "joint"),
    "no pairs": (7, {}, "expected a name, or"),
    "another body": ((), {"forces": [gauss.Force("f", "c", (1, 0, 0))]}, "no body 'c'"),
    "no forces": ((), {"forces": [(1, 0, 0)]}, "expected Force elements"),
    "a law of two": ("A", {"effort": lambda u, t: u}, "function of .u, t, motion."),
    "a constant law": ("A", {"effort": 3.0}, "function of .u, t, motion."),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_input_is_refused_by_name(name):
    joint, options, words = REFUSED[name]
    with pytest.raises(SceneError, match=f"input 'u'.*{words}"):
        arm().input("u", joint, **options)


def test_inputs_do_nothing_without_control():
    scene, plain = arm(), arm()
    scene.input("u", "A", **SERVO)
    assert all(np.array_equal(one, other) for one, other in zip(linear(scene).values(), linear(plain).values(), strict=True))
