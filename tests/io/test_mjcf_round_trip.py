"""Scenes written as MJCF and read again: the same mechanism, inputs act the same, outputs become sensors."""

import mujoco
import numpy as np
import pytest

import gauss
from gauss.dynamics.inputs import driven_scene
from gauss.errors import FileError
from gauss.io.catalog import shipped
from gauss.io.mjcf.write import to_mjcf
from tests.support.files import linear, quietly
from tests.support.mechanisms import two_bodies

SAME = 1e-9  # relative, of bodies whose frames, and moments of inertia that do not show, may be others
WITHOUT = {  # shipped models, and what MuJoCo has no counterpart of
    "box_on_plane_4": "no points",
    "double_pendulum_stops": "no restitution",
    "newtons_cradle": "no restitution",
    "painleve_rod": "no points",
    "planetary_gears": "gear 'sun mesh 1'",
    "rolling_disk": "rolling contact 'contact'",
}


def _again(folder, scene, **options) -> gauss.Scene:
    path = folder / "again.xml"
    path.write_text(to_mjcf(scene), encoding="utf-8")
    return quietly(path, **options)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped().keys() - WITHOUT))
def test_shipped_models_are_read_as_they_were_written(tmp_path, name):
    scene = gauss.load(name)
    again = _again(tmp_path, scene, limits="stops", contacts=True)
    assert len(again.contacts) == len(scene.contacts) and len(again.set_valued) == len(scene.set_valued)
    for one in (scene, again):
        one.set_valued.clear()  # accelerations are found without friction
        for contact in list(one.contacts):
            del one.contacts[contact]
    expected, found = linear(scene), linear(again)
    for body, acceleration in expected.items():
        assert found[body] == pytest.approx(acceleration, rel=SAME, abs=SAME * (1 + abs(acceleration).max()))


@pytest.mark.parametrize("name", WITHOUT)
def test_what_mujoco_has_no_counterpart_of_is_named(name):
    with pytest.raises(FileError, match=WITHOUT[name]):
        to_mjcf(gauss.load(name))


def _with_inputs() -> gauss.Scene:
    scene = gauss.Scene("inputs")
    for name, place in (("a", (0, 0, 0)), ("b", (1, 0, 0)), ("c", (2, 0, 0)), ("d", (5, 0, 0))):
        scene.body(name, 1.0, (0.1, 0.2, 0.25), com=(0.3, 0.1, 0), position=place)
    scene.revolute("A", "ground", "a", axis=(0, 1, 0))
    scene.prismatic("B", "a", "b", at=(1, 0, 0), axis=(1, 0, 1))
    scene.universal("U", "b", "c", at=(2, 0, 0), axis=(0, 1, 0), second_axis=(0, 0, 1))
    scene.ball("S", "ground", "d", at=(5, 0, 0))
    scene.input("u", "A", limits=(-1.0, 2.0))
    scene.input("geared", {"B": -3.0})
    scene.input("sum", {"A": 0.5, "B": 2.0})
    scene.input("second", "U.angle2", limits=4.0)
    scene.input("about", {"S.wx": 0.5})
    scene.input("jet", (), forces=[gauss.Force("jet", "c", (1, 2, 3), (0.1, 0.2, 0.3), at=(0, 0.1, 0), axes="body")])
    scene.input("push", (), forces=[gauss.Force("push", "b", (1, 2, 3), (0.1, 0.2, 0.3))], limits=2.0)
    return scene


def test_inputs_are_read_as_they_were_written(tmp_path):
    scene = _with_inputs()
    again = _again(tmp_path, scene)
    assert list(again.inputs) == list(scene.inputs)
    assert [one.limits for one in again.inputs.values()] == [
        (-4.0, 4.0) if one.limits == 4.0 else (-2.0, 2.0) if one.limits == 2.0 else one.limits
        for one in scene.inputs.values()
    ]
    values = dict(zip(scene.inputs, np.random.default_rng(1).normal(size=len(scene.inputs)), strict=True))
    laws = {name: lambda t, u=u: u for name, u in values.items()}
    expected, found = linear(driven_scene(scene, laws)), linear(driven_scene(again, laws))
    for body, acceleration in expected.items():
        assert found[body] == pytest.approx(acceleration, rel=SAME, abs=SAME)


REFUSED = {
    "a law": ({"joint": "A", "effort": lambda u, t, motion: 2.0 * u}, "its effort is a Python function"),
    "two bodies": ({"joint": (), "forces": [gauss.Force("f", body, (1, 0, 0)) for body in "ab"]}, "several bodies"),
    "a force that turns": ({"joint": (), "forces": [gauss.Force("f", "a", lambda t: (t, 0, 0))]}, "Python function"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_inputs_without_a_counterpart_are_refused_by_name(name):
    options, words = REFUSED[name]
    scene = _with_inputs()
    scene.input("extra", **options)
    with pytest.raises(FileError, match=f"input 'extra': .*{words}"):
        to_mjcf(scene)


def test_outputs_are_sensors(tmp_path):
    scene = two_bodies("revolute")
    joint, body = next(iter(scene.joints)), list(scene.bodies)[-1]
    for kind in ("coordinate", "rate"):
        scene.output(kind, kind, joint)
    for kind in ("position", "velocity", "angular_velocity", "gyroscope", "accelerometer", "acceleration"):
        scene.output(kind, kind, body, at=(0.1, 0.2, 0.3))
    path = tmp_path / "sensors.xml"
    path.write_text(to_mjcf(scene))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    mujoco.mj_forward(model, data)
    assert [model.sensor(k).name for k in range(model.nsensor)] == list(scene.outputs)[:-1]
    assert "output 'acceleration'" in path.read_text()
    system = gauss.compile_scene(scene)
    motion = gauss.dynamics.kinematics.kinematics(system, system.state(v=np.ones(system.n_v)))
    at = (0.1, 0.2, 0.3)
    assert data.sensor("position").data == pytest.approx(motion.position(body, at))
    assert data.sensor("velocity").data == pytest.approx(motion.velocity(body, at))
    assert data.sensor("gyroscope").data == pytest.approx(motion.rotation(body).T @ motion.angular_velocity(body))
