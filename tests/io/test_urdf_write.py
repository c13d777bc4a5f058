"""Scenes written as URDF and a file beside it: read again they move alike; Pinocchio and MuJoCo open them."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import gauss
from gauss.errors import FileError
from gauss.io.catalog import shipped
from gauss.io.urdf.side import side_file
from gauss.io.urdf.write import roll_pitch_yaw, to_urdf
from gauss.rotations import from_rpy
from gauss.system import random_state
from tests.support.files import linear, reversed_joints
from tests.support.mechanisms import four_bar, two_bodies

SAME = 1e-9  # relative: the same mechanism, cut at other joints, with frames moved and poses turned into angles
ENGINES = 1e-9  # two exact engines, but for rounding
STEPS = {"integrator": "time_stepping", "step": 1e-3, "progress": False}
KINDS = ("revolute", "prismatic", "cylindrical", "universal", "planar", "screw", "ball", "free")


def again(scene, folder):
    """The scene, written and read."""
    return gauss.load(gauss.save(scene, folder / "scene.urdf"))


def assert_alike(one, two):
    """Bodies that fixed joints do not weld to others, and that chains of joints do not add, accelerate alike."""
    expected, found = linear(one), linear(two)
    common = expected.keys() & found.keys()
    assert common >= {name for name in expected if one.bodies[name].mass and name in two.bodies} and common
    size = max(1.0, max(np.abs(a).max() for a in expected.values()))
    for name in common:
        assert found[name] == pytest.approx(expected[name], rel=SAME, abs=SAME * size)


def started(scene, seed=0):
    """The scene in a random state."""
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(seed), spread=0.4)
    for joint in system.joints:
        if joint.pair.n_v:
            scene.start(joint.name, position=tuple(state.q[joint.q]), rate=tuple(state.v[joint.v]))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True], ids=["outward", "inward"])
@pytest.mark.parametrize("kind", KINDS)
def test_joints_of_every_kind(tmp_path, kind, turned):
    scene = two_bodies(kind)
    scene = started(reversed_joints(scene) if turned else scene)
    assert_alike(scene, again(scene, tmp_path))


@pytest.mark.parametrize("parent, child", ["ab", "ba"])
def test_welded_bodies_become_one(tmp_path, parent, child):
    bodies, scene = two_bodies("fixed").bodies, gauss.Scene("welded")
    for body in bodies.values():
        scene.add(body)
    scene.revolute("A", "ground", "a", at=(0.3, 0.2, 0.1), axis=(0.3, 0.5, 1.0))
    scene.fixed("B", parent, child)
    read = again(scene, tmp_path)
    assert list(read.bodies) == ["a"] and "b" in read.frames
    one, two = (gauss.compile_scene(each) for each in (scene, read))
    state = one.state([0.4], [0.7])
    assert two.accelerations(two.state([0.4], [0.7])) == pytest.approx(one.accelerations(state), rel=SAME)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.PainleveWarning")
@pytest.mark.parametrize("name", shipped())
def test_shipped_scenes(tmp_path, name):
    scene = gauss.load(name)
    read = again(scene, tmp_path)
    slides = any(getattr(contact, "friction", 0.0) for contact in scene.contacts.values())
    if not slides and not scene.set_valued:
        assert_alike(scene, read)
        return
    settings = STEPS if slides else {}
    loops = [gauss.compile_scene(one).closes for one in (scene, read)]
    alike = loops[0] == loops[1] or not slides
    for body in scene.bodies:
        ends = [_end(one, body, settings) for one in (scene, read)]
        if not alike:  # loops are stepped by a rule of order 1, trees by another: what both tend to is compared
            halves = [_end(one, body, settings | {"step": settings["step"] / 2}) for one in (scene, read)]
            ends = [2.0 * half - end for half, end in zip(halves, ends, strict=True)]
        assert ends[1] == pytest.approx(ends[0], abs=SAME if alike else settings["step"] ** 2)


def _end(scene, body, settings):
    return gauss.simulate(scene, 0.01, **settings).body(body).com[-1]


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("seed", range(3))
def test_trees_in_pinocchio_and_mujoco(tmp_path, seed):
    scene = gauss.load("random_tree", n=7, seed=seed, kinds=("revolute", "prismatic"))
    scene = gauss.Scene(scene.name, bodies=scene.bodies, joints=scene.joints)  # URDF has the gravity of the Earth
    path = gauss.save(scene, tmp_path / "tree.urdf")
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(seed), spread=1.0)
    expected = system.accelerations(state)
    model, robot = mujoco.MjModel.from_xml_path(str(path)), pin.buildModelFromUrdf(str(path))
    data = mujoco.MjData(model)
    q, v = pin.neutral(robot), np.zeros(robot.nv)
    for joint in system.joints:
        own, theirs = model.joint(joint.name), robot.joints[robot.getJointId(joint.name)]
        angle = state.q[joint.q.start]
        data.qpos[own.qposadr], data.qvel[own.dofadr] = angle, state.v[joint.v]
        q[theirs.idx_q : theirs.idx_q + theirs.nq] = angle if theirs.nq == 1 else (np.cos(angle), np.sin(angle))
        v[theirs.idx_v] = state.v[joint.v.start]
    mujoco.mj_forward(model, data)
    found = pin.aba(robot, robot.createData(), q, v, np.zeros(robot.nv))
    for joint in system.joints:
        a, index = expected[joint.v.start], robot.joints[robot.getJointId(joint.name)].idx_v
        size = np.abs(expected).max()
        assert found[index] == pytest.approx(a, abs=ENGINES * size)
        assert data.qacc[model.joint(joint.name).dofadr[0]] == pytest.approx(a, abs=ENGINES * size)


def test_what_urdf_cannot_say_is_listed_in_it():
    scene = four_bar()
    scene.force("wind", "rocker")
    text, beside = to_urdf(scene)
    assert "Not in this file, but in the one beside it: load 'wind', start 'A'" in text
    assert 'name = "wind"' in beside and 'name = "D"' not in beside and '<loop name="D"' in text


def test_a_tree_needs_no_file_beside_it(tmp_path):
    scene = gauss.Scene("door")
    scene.body("door", 1.0, (1, 1, 1), com=(0.5, 0, 0))
    scene.revolute("hinge", "ground", "door", limits=(-1.0, 1.0))
    path = gauss.save(scene, tmp_path / "door.urdf")
    assert not side_file(path).exists()
    side_file(path).write_text('[[stop]]\njoint = "hinge"\nlowest = -1')
    gauss.save(scene, path)
    assert gauss.load(path).contacts == {}  # one that was there belongs to another scene


def test_couplings_are_mimic_joints(tmp_path):
    scene = two_bodies("revolute")
    scene.couple("belt", "B", "A", 2.0, 0.1)
    text, beside = to_urdf(scene)
    assert '<mimic joint="A" multiplier="2.0" offset="0.1" />' in text and not beside
    assert_alike(scene, again(scene, tmp_path))


@pytest.mark.slow
def test_loads_and_contacts_go_beside(tmp_path):
    scene = two_bodies("universal")
    scene.frame("tip", "b", (0.1, 0.2, 0.3), (0.3, 0.2, 0.1))
    scene.drive("A", torque=(1.0, -2.0))
    scene.spring("line", "b", "ground", (0.1, 0.2, 0.3), (1.0, 1.0, 0.5), stiffness=50.0, damping=3.0, length=0.4)
    scene.force("push", "a", (1.0, 2.0, 3.0), at=(0.2, 0.1, 0.4), axes="body")
    scene.distance("rod", "tip", "ground", other_at=(3.0, 2.0, 0.5))
    assert_alike(started(scene), again(scene, tmp_path))


@pytest.mark.parametrize("pitch", [0.3, -1.2, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_angles_of_a_rotation_are_exact_even_where_they_are_not_unique(pitch):
    R = from_rpy(0.4, pitch, -2.0)
    assert from_rpy(*roll_pitch_yaw(R)) == pytest.approx(R, abs=4e-16)


REFUSED = {
    "a law in Python": (lambda s: s.drive("A", torque=lambda t: t), "Python function"),
    "a constraint in Python": (lambda s: s.constrain("c", lambda at: at.coordinate("A")), "Python functions"),
    "unprintable names": (lambda s: s.frame("a\x07b", "b"), "a\\\\x07b"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_written_is_refused_by_name(name):
    add, said = REFUSED[name]
    scene = two_bodies("revolute")
    add(scene)
    with pytest.raises(FileError, match=said):
        to_urdf(scene)


INERTIAL = '<inertial><origin xyz="0.2 0 0"/><mass value="1"/>' + (
    '<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)
LIMIT = '<limit effort="1" velocity="1" lower="-3" upper="3"/>'


def _hinge(name, parent, child, xyz):
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
    return f'<joint name="{name}" type="revolute">{ends}<axis xyz="0 1 0"/>{LIMIT}</joint>'


PARALLELOGRAM = f"""<robot name="parallelogram"><link name="base"/><link name="left">{INERTIAL}</link>
<link name="right">{INERTIAL}</link><link name="coupler">{INERTIAL}</link><link name="eye"/>
{_hinge("A", "base", "left", "0 0 0")}{_hinge("B", "left", "coupler", "0.4 0 0")}{_hinge("D", "base", "right", "0 0 1")}
<joint name="weld" type="fixed"><parent link="coupler"/><child link="eye"/>
<origin xyz="0 0 1" rpy="0 0.3 0"/></joint></robot>"""


def test_a_loop_is_closed_by_the_file_beside(tmp_path):
    """The loop is closed at a link that is welded to another, in whose frame the joint is given."""
    path = tmp_path / "bars.urdf"
    path.write_text(PARALLELOGRAM)
    side_file(path).write_text(
        '[[joint]]\nname = "C"\ntype = "revolute"\nparent = "eye"\nchild = "right"\nframe = "eye"\naxis = [0, 1, 0]\n'
        '[[start]]\njoint = "A"\nrate = 1.0\n'
    )
    system = gauss.compile_scene(gauss.load(path))
    state = system.initial_state()
    assert gauss.mobility(system).freedoms == 1
    assert dict(zip(system.coordinates, state.v, strict=True)) == pytest.approx({"A": 1, "B": -1, "D": 1, "C": 1}, abs=1e-9)


MISTAKES = {
    "an unknown link": ('[[joint]]\nname = "C"\ntype = "ball"\nparent = "eyes"\nchild = "right"', "no body 'eyes'"),
    "an unknown table": ("[[loop]]", "unknown section 'loop'"),
    "a name twice": ('[[joint]]\nname = "A"\ntype = "ball"\nparent = "eye"\nchild = "right"', "'A': the name is taken"),
    "no table": ("C =", "not a TOML file"),
    "endless brackets": ("x = " + "[" * 100_000, "nested too deep"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_in_the_file_beside_are_told(tmp_path, name):
    content, words = MISTAKES[name]
    path = tmp_path / "bars.urdf"
    path.write_text(PARALLELOGRAM)
    side_file(path).write_text(content)
    with pytest.raises(FileError, match=f"bars.loops.toml: .*{words}"):
        gauss.load(path)


def controlled():
    """Two links whose frames URDF moves, an input and outputs of every kind but contacts."""
    scene = two_bodies("revolute")
    joint, body = list(scene.joints)[-1], list(scene.bodies)[-1]
    scene.frame("tip", body, (0.1, 0.2, 0.3), (0.3, 0.2, 0.1))
    scene.input("motor", {joint: 2.0}, limits=(-1.0, 3.0))
    for kind in ("coordinate", "rate", "joint_force", "joint_moment"):
        scene.output(kind, kind, joint)
    for kind in ("position", "velocity", "angular_velocity", "acceleration", "accelerometer", "gyroscope"):
        scene.output(f"{kind} of a body", kind, body)
        scene.output(f"{kind} of a point", kind, "tip", at=(0.2, 0.1, 0.0))
    scene.output("seen from the tip", "velocity", list(scene.bodies)[0], at=(0.2, 0.1, 0.0), relative_to="tip")
    scene.output("momentum", "angular_momentum", list(scene.bodies)[0])
    return scene


@pytest.mark.slow
def test_inputs_act_and_outputs_measure_the_same(tmp_path):
    scene = controlled()
    read = again(scene, tmp_path)
    assert read.inputs == scene.inputs and list(read.outputs) == list(scene.outputs)
    motions = [gauss.simulate(one, 0.1, progress=False) for one in (scene, read)]
    for name in scene.outputs:
        expected, found = (motion.output(name)[-1] for motion in motions)
        assert found == pytest.approx(expected, rel=1e-7, abs=1e-7), name  # two motions of relative accuracy 1e-12


def test_outputs_seen_from_a_frame_that_moves_in_urdf_are_refused(tmp_path):
    scene = two_bodies("revolute")
    for body in scene.bodies:
        scene.output(f"from {body}", "position", "ground", relative_to=body)
    with pytest.raises(FileError, match="measure from a named frame"):
        again(scene, tmp_path)


AMBIGUOUS = {
    "the joint of a frame": lambda scene: [
        scene.frame("eye", "b"),
        scene.body("c", 1.0, (1, 1, 1)),
        scene.ball("eye is fixed", "b", "c"),
        scene.coincident("shut", "b", "c"),
    ],
    "the link of a chain": lambda scene: [
        scene.body("c", 1.0, (1, 1, 1)),
        scene.universal("U", "b", "c"),
        scene.frame("c before U.angle2", "b"),
    ],
    "an output of a chain": lambda scene: [
        scene.body("c", 1.0, (1, 1, 1)),
        scene.universal("U", "b", "c"),
        scene.output("angles", "coordinate", "U"),
    ],
}


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_what_another_name_would_change_is_refused(name):
    scene = gauss.Scene("names")
    scene.body("b", 1.0, (1, 1, 1))
    scene.revolute("A", "ground", "b", axis=(0, 1, 0))
    AMBIGUOUS[name](scene)
    with pytest.raises(FileError, match="get this name in URDF|chain of joints in URDF"):
        to_urdf(scene)


PARTLY = {  # joints that become loops in the file, and a start of them alone
    "screw": ({"pitch": 0.3, "axis": (1, 1, 0)}, (0.2, 1.0)),
    "ball": ({}, ((0.5, 0.5, 0.5, 0.5), (1.0, 2.0, 3.0))),
    "free": ({}, ((0.1, 0.2, 0.3, 0.6, 0.0, 0.8, 0.0), (1.0, 2.0, 3.0, 3.0, 2.0, 1.0))),
    "cylindrical": ({"axis": (1, 1, 0)}, ((0.1, 0.2), (0.3, 0.4))),
}


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True], ids=["outward", "inward"])
@pytest.mark.parametrize("kind", PARTLY)
def test_starts_of_some_joints_leave_the_others_where_they_were(tmp_path, kind, turned):
    """The loops that URDF needs for a joint do not move the joints that the scene gives no start."""
    options, (position, rate) = PARTLY[kind]
    scene = two_bodies("revolute")
    scene.body("c", 1.0, (0.1, 0.2, 0.2), position=(0.5, 0.5, 0.5), rotation=(0.3, 0.1, 0.2))
    ends = ("c", "b") if turned else ("b", "c")
    scene.joint("P", kind, *ends, at=(0.2, 0.1, 0.3), **options)
    scene.start("P", position, rate)
    read = again(scene, tmp_path)
    instants = [gauss.Kinematics(system, system.initial_state()) for system in map(gauss.compile_scene, (scene, read))]
    for body in scene.bodies:
        expected, found = (
            np.concatenate([one.position(body, com), one.velocity(body, com), one.angular_velocity(body)])
            for one, com in zip(instants, (scene.bodies[body].com, read.bodies[body].com), strict=True)
        )
        assert found == pytest.approx(expected, rel=SAME, abs=SAME)
