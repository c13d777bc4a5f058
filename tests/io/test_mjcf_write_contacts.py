"""Contacts, stops, ropes and joint friction written as MJCF: MuJoCo's soft ones move about like the rigid ones of gauss."""

import mujoco
import numpy as np
import pytest

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.errors import FileError
from gauss.io.mjcf.write import to_mjcf
from tests.support.in_mujoco import GIVES_WAY, mujoco_run


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_a_ball_slides_and_begins_to_turn(friction):
    scene = gauss.load("rolling_ball")
    scene.contacts.clear()
    scene.contact("C", "round", "table", friction=friction)
    ours = gauss.simulate(scene, 0.3, integrator="time_stepping", step=1e-2)
    data = mujoco_run(scene, 0.3)
    assert ours.v[-1, 0] == pytest.approx(3.0 - friction * 9.81 * 0.3, abs=1e-8)
    assert data.qvel[0] == pytest.approx(ours.v[-1, 0], rel=GIVES_WAY)
    assert data.qvel[4] == pytest.approx(ours.v[-1, 4], rel=GIVES_WAY, abs=1e-6)


@pytest.mark.slow
@pytest.mark.peer
def test_a_box_on_its_corners_is_pulled():
    scene = gauss.load("box_on_plane_8")
    scene.loads["pull"] = gauss.Force("pull", "box", force=(10.0, 0, 0), at=(0, 0, 0.2))
    scene.start("box moves")
    ours, data = gauss.simulate(scene, 0.3), mujoco_run(scene, 0.3)
    assert data.qpos[:2] == pytest.approx(ours.q[-1, :2], abs=GIVES_WAY * 0.225)


@pytest.mark.slow
@pytest.mark.peer
def test_stops_and_joint_friction():
    scene = gauss.load("double_pendulum_stops")
    scene.contacts.clear()
    scene.stop("B", highest=0.5)
    scene.joint_friction("A", 0.5)
    ours, data = gauss.simulate(scene, 0.5, rtol=1e-8), mujoco_run(scene, 0.5)
    assert any(event.kind == "impact" for event in ours.events)
    assert data.qpos == pytest.approx(ours.q[-1], abs=GIVES_WAY)


@pytest.mark.slow
@pytest.mark.peer
def test_a_rope_that_is_taut():
    rope = gauss.load("slack_rope")
    ours, data = gauss.simulate(rope, 0.3, rtol=1e-8), mujoco_run(rope, 0.3)
    position = ours.body("bob").position[-1]
    assert data.body("bob").xpos == pytest.approx(position, abs=GIVES_WAY)


@pytest.mark.slow
@pytest.mark.peer
def test_every_kind_of_shape_and_pair_is_taken_by_mujoco():
    scene = gauss.Scene("shapes")
    for name in "ab":
        scene.body(name, 1.0, (0.1, 0.1, 0.1), position=(0, 0, 1))
        scene.free(name.upper(), "ground", name, at=(0, 0, 1))
    scene.frame("tip", "b", (0.1, 0.2, 0.3), (0.1, 0.2, 0.3))
    scene.sphere("ball", "a", 0.1, at=(1, 0, 0))
    scene.capsule("rod", "tip", 0.1, 0.5, axis=(1, 2, 3))
    scene.box("crate", "b", (0.1, 0.2, 0.3), rotation=(0.1, 0.2, 0.3))
    scene.points("feet", "a", [(0, 0, 0.1), (0, 0.1, 0)], radius=0.02)
    scene.half_space("wall", normal=(1, 1, 0), at=(-5, 0, 0))
    pairs = [("ball", "rod"), ("ball", "crate"), ("feet", "rod"), ("crate", "wall"), ("rod", "wall"), ("feet", "wall")]
    for one, other in pairs:
        scene.contact(f"{one} on {other}", one, other, friction=0.3)
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    system = gauss.compile_scene(scene)
    motion = kinematics(system, system.initial_state())
    for name in ("ball", "rod", "crate"):
        shape = scene.shapes[name]
        assert data.geom(name).xpos == pytest.approx(motion.position(shape.body, shape.at), abs=1e-12)
    assert model.npair == 8
    assert data.geom("rod").xmat.reshape(3, 3)[:, 2] == pytest.approx(
        motion.rotation("tip") @ np.array([1, 2, 3]) / np.sqrt(14), abs=1e-12
    )


def _refused(scene):
    scene.body("b", 1.0, (1, 1, 1))
    scene.revolute("A", "ground", "b")
    scene.half_space("floor")
    scene.sphere("ball", "b", 0.1)
    return scene


REFUSED = {
    "restitution": (lambda s: s.contact("C", "ball", "floor", restitution=0.5), "'C': MuJoCo has no restitution"),
    "restitution of a stop": (lambda s: s.stop("A", 0.0, restitution=0.1), "'stop of A': MuJoCo has no restitution"),
    "points": (lambda s: (s.points("p", "b", [(0, 0, 0)]), s.contact("C", "p", "floor")), "'p': MuJoCo has no points"),
    "a plane that moves": (
        lambda s: (s.half_space("h", "b"), s.sphere("g", "ground", 0.1), s.contact("C", "g", "h")),
        "'h': planes of MuJoCo do not move",
    ),
    "two stops": (lambda s: (s.stop("A", lowest=0.0), s.stop("A", highest=1.0)), "give the lowest and the highest together"),
    "a limit in Python": (lambda s: s.joint_friction("A", lambda t: 1.0 + t), "friction of A.*Python function"),
    "a limited drive": (lambda s: s.drive("A", speed=1.0, limit=2.0), "'drive of A': MuJoCo has no counterpart"),
    "a gap in Python": (lambda s: s.one_sided("mine", lambda at: at.position("b")[0]), "'mine': MuJoCo has no counterpart"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_mujoco_lacks_is_refused_by_name(name):
    add, said = REFUSED[name]
    scene = _refused(gauss.Scene("refused"))
    add(scene)
    with pytest.raises(FileError, match=said):
        to_mjcf(scene)
