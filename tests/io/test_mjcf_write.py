"""Scenes written as MJCF: MuJoCo's own poses and accelerations are those of gauss."""

import mujoco
import numpy as np
import pytest

import gauss
from gauss.errors import FileError
from gauss.io.mjcf.tree import spanning_tree
from gauss.io.mjcf.write import to_mjcf
from gauss.system import retract
from tests.support.files import reversed_joints
from tests.support.in_mujoco import SOFT, differences
from tests.support.mechanisms import four_bar, two_bodies

KINDS = ("revolute", "prismatic", "free", "cylindrical", "universal", "ball", "planar")
SAME = 1e-9  # two engines that are exact but for rounding, and a map of accelerations by central differences


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("turned", [False, True], ids=["outward", "inward"])
@pytest.mark.parametrize("kind", KINDS)
def test_joints(kind, turned):
    scene = two_bodies(kind)
    poses, accelerations = differences(reversed_joints(scene) if turned else scene)
    assert poses < SAME
    assert accelerations < SAME


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("seed", range(3))
def test_trees(seed):
    poses, accelerations = differences(gauss.load("random_tree", n=9, seed=seed, kinds=(*KINDS, "fixed")), seed=seed)
    assert poses < SAME
    assert accelerations < SAME


@pytest.mark.peer
@pytest.mark.parametrize("turned", [False, True], ids=["outward", "inward"])
def test_screw_is_a_hinge_and_a_slide_tied(turned):
    scene = two_bodies("screw")
    poses, accelerations = differences(reversed_joints(scene) if turned else scene)
    assert poses < SAME
    assert accelerations < SOFT


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", ["robot:panda", "robot:talos"])
def test_robots(name):
    options = {"mimic": False} if name.endswith("panda") else {"root": "free"}
    poses, accelerations = differences(gauss.load(name, **options))
    assert poses < SAME
    assert accelerations < SAME


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("order", ["ABCD", "BCDA"])
def test_loops_of_hinges(order):
    poses, accelerations = differences(four_bar(order), state=())
    assert poses < SAME
    assert accelerations < SOFT


def loaded(kind: str):
    """Two bodies on joints of a kind, the second with its joint frame in its origin so that all rates agree."""
    scene = gauss.Scene("loaded", gravity=(0.3, -0.2, -9.0))
    scene.body("a", 1.3, (0.2, 0.3, 0.4), com=(0.1, 0.2, -0.1), rotation=(0.1, 0.2, 0.3))
    scene.body("b", 0.7, (0.1, 0.12, 0.2), com=(0.3, -0.1, 0.2), position=(0.5, 0.1, 0.2), rotation=(0.4, -0.2, 0.1))
    scene.frame("tip", "b", (0.2, 0.1, 0.3), (0.3, 0.1, 0.2))
    scene.joint("A", kind, "ground", "a", at=(0, 0, 0))
    scene.joint("B", "revolute", "a", "b", at=(0.5, 0.1, 0.2), axis=(0.2, 1.0, 0.3))
    return scene


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("kind", KINDS)
def test_drives(kind):
    scene = loaded(kind)
    count = scene.joints["A"].pair.n_v
    scene.drive("A", torque=tuple(1.0 + np.arange(count)) if count > 1 else 2.0)
    scene.drive("B", torque=-1.5)
    assert differences(scene)[1] < SAME


LOADS = {
    "force at the centre of mass": lambda s: s.force("push", "b", (1.0, 2.0, 3.0)),
    "force and moment beside it": lambda s: s.force("push", "b", (1.0, 2.0, 3.0), (0.3, -0.2, 0.5), at=(0.2, 0.1, 0.4)),
    "force that turns with the body": lambda s: s.force(
        "push", "b", (1, 2, 3), (0.3, -0.2, 0.5), at=(0, 0.1, 0), axes="body"
    ),
    "spring between points": lambda s: s.spring(
        "line", "b", "ground", (0.1, 0.2, 0.3), (1.0, 1.0, 0.5), stiffness=50.0, damping=3.0, length=0.4
    ),
    "spring of a joint": lambda s: s.joint_spring("twist", "B", stiffness=5.0, damping=0.7, rest=0.3),
    "springs of one joint": lambda s: [
        s.joint_spring("twist", "B", stiffness=5.0, rest=0.3),
        s.joint_spring("more", "B", stiffness=2.0, damping=0.1, rest=-0.4),
    ],
}


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", LOADS)
def test_loads(name):
    scene = loaded("ball")
    LOADS[name](scene)
    assert differences(scene)[1] < SAME


CONSTRAINTS = {
    "coincidence": lambda s: s.coincident("meet", "tip", "ground", (0.1, 0, 0), (0.8, 0.3, 0.6)),
    "distance": lambda s: s.distance("rod", "tip", "ground", other_at=(1.0, 2.0, 0.5), length=2.0),
    "distance of the reference": lambda s: s.distance("rod", "tip", "ground", other_at=(1.0, 2.0, 0.5)),
    "joint held": lambda s: s.drive("B", angle=0.4),
    "weld": lambda s: s.fixed("held", "ground", "b", at=(0.5, 0.1, 0.2)),
    "ball in a loop": lambda s: s.ball("pivot", "ground", "b", at=(0.6, 0.3, 0.4)),
}


TENDONS = {name for name in CONSTRAINTS if name.startswith("distance")}


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", CONSTRAINTS)
def test_constraints_at_rest_and_in_motion(name):
    """MuJoCo leaves out how a tendon's rows change in motion; only at rest are its accelerations those of a rod."""
    scene = loaded("free")
    CONSTRAINTS[name](scene)
    system = gauss.compile_scene(scene)
    rng = np.random.default_rng(1)
    q = retract(system, system.reference.q, 0.02 * rng.standard_normal(system.n_v))
    at_rest, moving = np.zeros(system.n_v), rng.standard_normal(system.n_v)
    for v in (at_rest,) if name in TENDONS else (at_rest, moving):
        poses, accelerations = differences(scene, state=(q, v))
        assert poses < SAME
        assert accelerations < SOFT


@pytest.mark.peer
def test_coupled_joints():
    scene = loaded("revolute")
    scene.couple("belt", "B", "A", 2.5, 0.3)
    assert differences(scene, state=())[1] < SOFT


def test_the_loop_is_cut_where_mujoco_can_close_it():
    """A slider that the scene names last is kept, and a hinge is cut."""
    scene = gauss.load("slider_crank")
    assert [joint.kind for joint in spanning_tree(scene)[1]] == ["revolute"]


@pytest.mark.peer
def test_start_becomes_a_key_frame():
    scene = four_bar()
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    assert model.key(0).name == "start"
    assert model.key(0).qvel[model.joint("A").dofadr[0]] == pytest.approx(10.0, rel=1e-12)


@pytest.mark.peer
def test_names_that_xml_must_escape(tmp_path):
    scene = gauss.Scene('<"&>')
    scene.body("a <b> & 'c' — ü", 1.0, (1, 1, 1))
    scene.revolute('"hinge"', "ground", "a <b> & 'c' — ü")
    path = gauss.save(scene, tmp_path / "x.xml")
    assert mujoco.MjModel.from_xml_path(str(path)).body(1).name == "a <b> & 'c' — ü"


def planar_link(*rates):
    scene = gauss.Scene("link")
    scene.body("link", 1.0, (0, 0, 0.2))
    scene.joint("J", *rates)
    return scene


REFUSED = {
    "a law in Python": (lambda s: s.drive("B", torque=lambda t: t), "drive of B"),
    "springs that cancel": (
        lambda s: [s.joint_spring(f"k{k}", "B", stiffness=k, rest=0.1 * k) for k in (30.0, -30.0)],
        "'k-30.0': the springs of joint 'B' cancel",
    ),
    "a plane": (lambda s: s.on_plane("floor", "b", "ground"), "floor"),
    "a prescribed speed": (lambda s: s.drive("B", speed=1.0), "drive of B"),
    "a loop of cylindrical joints": (
        lambda s: [s.drive("A", torque=1.0), s.drive("B", torque=1.0), s.cylindrical("C", "ground", "b")],
        "'C': a cylindrical joint closes a loop",
    ),
    "unprintable names": (lambda s: s.frame("a\x07b", "b"), "a\\\\x07b"),
    "names that clash": (lambda s: [s.frame("meet: b", "b"), s.coincident("meet", "b", "ground")], "meet: b"),
    "the name of the world": (
        lambda s: [s.body("world", 1.0, (1, 1, 1)), s.free("F", "ground", "world")],
        "keeps this name",
    ),
    "a spatial body with a planar inertia": (
        lambda s: [s.body("flat", 1.0, (0, 0, 1.0)), s.ball("F", "b", "flat")],
        "body 'flat'",
    ),
    "a body without mass at the end": (lambda s: [s.body("dot", 0.0), s.fixed("F", "b", "dot")], "dot"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_mujoco_lacks_is_refused_by_name(name):
    add, said = REFUSED[name]
    scene = loaded("revolute")
    add(scene)
    with pytest.raises(FileError, match=said):
        to_mjcf(scene)


LIGHT = {  # scale of lengths and masses, and what of a link without moment about its axis MuJoCo cannot take
    "metres": (1.0, 1.0, None),
    "millimetres": (1e-3, 1e-6, "moment of inertia, 0 kg m²"),
    "micrometres": (1e-6, 1e-15, "mass, 7e-16 kg"),
    "small moments": (1e-5, 1e-6, "moment of inertia, 3.5e-17 kg m²"),
}


@pytest.mark.parametrize("name", LIGHT)
def test_bodies_too_light_for_mujoco_are_refused_and_not_made_heavier(name):
    length, mass, said = LIGHT[name]
    scene, unit = gauss.Scene("light"), mass * length**2
    scene.body("a", 0.7 * mass, (0.5 * unit, 0.0 if name == "millimetres" else 0.35 * unit, 0.5 * unit), com=(0, length, 0))
    scene.revolute("A", "ground", "a", axis=(1, 0, 0))
    if said is None:
        assert differences(scene)[1] < SAME
        return
    with pytest.raises(FileError, match=f"body 'a': its (least )?{said}"):
        to_mjcf(scene)


def test_limits_that_mujoco_would_enforce_are_named_in_the_file():
    scene = gauss.Scene("limits")
    scene.body("a", 1.0, (1, 1, 1))
    scene.revolute("A--", "ground", "a", axis=(1, 0, 0), limits=(-1.0, 1.0))
    text = to_mjcf(scene)
    assert "limits of joint 'A- -'" in text and mujoco.MjModel.from_xml_string(text).jnt_limited[0] == 0


@pytest.mark.parametrize("bodies, fits", [(496, True), (497, False)])
def test_chains_that_mujoco_would_not_open_are_refused_by_name(tmp_path, bodies, fits):
    scene = gauss.Scene("chain")
    for k in range(bodies):
        scene.body(f"link {k}", 1.0, (0.1, 0.1, 0.1), position=(0.2 * k, 0.0, 0.0))
        scene.revolute(f"hinge {k}", f"link {k - 1}" if k else "ground", f"link {k}", frame=f"link {k}")
    if fits:
        assert mujoco.MjModel.from_xml_string(to_mjcf(scene)).nv == bodies
    else:
        with pytest.raises(FileError, match="body 'link 496'"):
            to_mjcf(scene)
