"""URDF: every robot of example-robot-data loads with masses and frames intact, or is refused by name."""

import importlib.metadata

import numpy as np
import pinocchio as pin
import pytest

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.errors import FileError, GaussError, NotImportedWarning
from gauss.system import random_state

FILES = {
    "/".join(file.with_suffix("").parts[-3:]): file
    for file in importlib.metadata.files("example-robot-data")
    if file.suffix == ".urdf"
}
REFUSED = {
    "alex_description/urdf/alex_psyonic_hands": "'Left_index_q2' mimics 'index_q1', a joint that does not exist",
    "romeo_description/urdf/romeo_laas_small": "'LHipPitch_link'.*negative principal moment",
    "romeo_description/urdf/romeo_small": "'RShoulderYawLink'.*triangle inequality",
    "ur_description/urdf/ur3": "no <link>",
}
UNDETERMINED = {"romeo_description/urdf/romeo": "'LFinger23Link'"}  # loads, but cannot move
FLOATING_ONLY = {"hector_description/robots/quadrotor_base", "iris_description/robots/iris_simple"}
PLACEMENT = 1e-12


def _path(name):
    return str(FILES[name].locate())


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", sorted(FILES))
def test_every_robot_loads_or_is_refused_by_name(name):
    if name in REFUSED:
        with pytest.raises(FileError, match=REFUSED[name]):
            gauss.load(_path(name))
        return
    if name in FLOATING_ONLY:
        with pytest.raises(FileError, match="root='free'"):
            gauss.load(_path(name))
    if name in UNDETERMINED:
        system = gauss.compile_scene(gauss.load(_path(name)))
        with pytest.raises(GaussError, match=UNDETERMINED[name]):
            system.accelerations(system.initial_state())
        return
    free = name in FLOATING_ONLY
    system = gauss.compile_scene(gauss.load(_path(name), root="free" if free else "fixed"))
    model = pin.buildModelFromUrdf(_path(name), *((pin.JointModelFreeFlyer(),) if free else ()))
    assert [joint.name for joint in system.joints] == list(model.names)[1:]
    assert system.n_v == model.nv
    mass = sum(inertia.mass for inertia in list(model.inertias)[1:])
    assert system.Phi[3::6].sum() == pytest.approx(mass, rel=1e-14)
    _compare_placements(system, model)


def _compare_placements(system, model):
    """Every link of the file, welded ones too, and every centre of mass where Pinocchio has them."""
    data, q = model.createData(), pin.neutral(model)
    pin.framesForwardKinematics(model, data, q)
    motion = kinematics(system, system.reference)
    for index, frame in enumerate(model.frames):
        if frame.type != pin.FrameType.BODY or frame.name == "ground":
            continue
        placement = data.oMf[index]
        if frame.name in system.structure.bodies:  # the body frame is the frame of the joint that moves it
            placement = data.oMi[frame.parentJoint]
        assert np.abs(motion.position(frame.name) - placement.translation).max() <= PLACEMENT
        assert np.abs(motion.rotation(frame.name) - placement.rotation).max() <= PLACEMENT
    for index in range(1, model.njoints):
        body = system.joints[index - 1].child
        com = data.oMi[index].act(model.inertias[index].lever)
        assert np.abs(motion.x[body] - com).max() <= PLACEMENT


def test_links_keep_their_names():
    scene = gauss.load("robot:panda")
    assert {"panda_link7", "panda_leftfinger"} <= set(scene.bodies)
    assert {"panda_link8", "panda_hand"} <= set(scene.frames)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "baxter", "tiago_pro"])
def test_mimic_joints_follow(name):
    system = gauss.compile_scene(gauss.load(f"robot:{name}"))
    free = gauss.compile_scene(gauss.load(f"robot:{name}", mimic=False))
    assert system.has_closures and not free.has_closures
    rng = np.random.default_rng(0)
    state = random_state(system, rng, spread=0.3, slide=0.01)
    state = system.initial_state(state.q, state.v)
    qdd = system.accelerations(state)
    for coupling in system.scene.couplings.values():
        driven, driver = (system.joint(j) for j in (coupling.driven, coupling.driver))
        expected = coupling.ratio * state.q[driver.q] + coupling.offset
        assert state.q[driven.q] == pytest.approx(expected, abs=1e-12)
        assert qdd[driven.v] == pytest.approx(coupling.ratio * qdd[driver.v], rel=1e-9, abs=1e-9)


def test_a_floating_base_is_a_free_joint():
    scene = gauss.load("robot:talos", root="free")
    assert scene.joints["root_joint"].kind == "free"
    assert gauss.compile_scene(scene).n_v == 38


BAD = {
    "not xml": ("nonsense", "not XML"),
    "no robot": ('<robot name="r"/>', "no <link>.*xacro"),
    "no name": ('<robot><link name="base"/></robot>', "without a name"),
    "two roots": ('<robot name="r"><link name="base"/><link name="arm"/></robot>', "'base', 'arm' are children of no joint"),
    "no joint": ('<robot name="r"><link name="base"/></robot>', "no link moves"),
    "bad inertia": (
        '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="0.1" '
        'izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="arm"/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint></robot>',
        "'arm'.*triangle",
    ),
    "mimic of nothing": (
        '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="revolute"><parent link="base"/><child link="arm"/>'
        '<axis xyz="0 0 1"/><limit effort="1" velocity="1"/><mimic joint="k"/></joint></robot>',
        "'j' mimics 'k'",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_with_the_reason(case, tmp_path):
    text, words = BAD[case]
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(FileError, match=words) as caught:
        gauss.load(path)
    assert "robot.urdf" in str(caught.value)


ARM = """<robot name="r">
<link name="base"/>
<link name="arm">{inertial}</link>
<joint name="j" type="revolute">
<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/>
{inside}</joint>
{more}
</robot>"""
INERTIAL = '<inertial><mass value="1"/><inertia ixx="{}" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/></joint>'
CIRCLE = {"one": ("one", "other"), "other": ("other", "one")}  # names of joints and of the links at their ends
LINES = {
    "inertia": ({"inertial": INERTIAL.format(5)}, r"robot.urdf:3: body 'arm'.*triangle"),
    "moment": ({"inertial": INERTIAL.format(-1e-4)}, r"robot.urdf:3: body 'arm'.*negative principal moment"),
    "mimic": ({"inside": '<mimic joint="k"/>'}, r"robot.urdf:4: joint 'j' mimics 'k'"),
    "a name twice": ({"more": '<link name="arm"/>'}, r"robot.urdf:7: link 'arm' stands in .*robot.urdf:3 already"),
    "a joint twice": (
        {"more": JOINT.format("j", "fixed", "arm", "hand")},
        r":7: joint 'j' stands in .*:4 already",
    ),
    "no name": ({"more": "<link/>"}, r"robot.urdf:7: <link> has no name"),
    "a type": ({"more": JOINT.format("k", "hinge", "arm", "hand")}, r"robot.urdf:7: joint 'k': .*'hinge'"),
    "no parent": ({"more": JOINT.format("k", "fixed", "arn", "hand")}, r"robot.urdf:7: joint 'k': .*<parent>.*'arn'.*'arm'"),
    "a tree": ({"more": JOINT.format("k", "fixed", "base", "arm")}, r"robot.urdf:7: joint 'k': link 'arm' is .* joint 'j'"),
    "a circle, which the parser drops": (
        {"more": "".join(f'<link name="{name}"/>{JOINT.format(name, "fixed", *ends)}' for name, ends in CIRCLE.items())},
        r"robot.urdf:7: links 'one', 'other' hang on one another",
    ),
}


@pytest.mark.parametrize("case", LINES)
def test_what_is_refused_is_told_with_its_line(case, tmp_path):
    given, words = LINES[case]
    path = tmp_path / "robot.urdf"
    path.write_text(ARM.format(**{"inertial": INERTIAL.format(1), "inside": "", "more": ""} | given))
    with pytest.raises(FileError, match=words):
        gauss.load(path)


@pytest.mark.slow
@pytest.mark.parametrize("rest", [-(2.0**-64), 2.0**-64, 0.0, -1e-17])
def test_what_rounding_leaves_of_a_point_mass_is_no_inertia(rest, tmp_path):
    path = tmp_path / "robot.urdf"
    moments = f'<inertia ixx="{rest}" iyy="{rest}" izz="0" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><origin xyz="0.3 0 0"/><mass value="0.5"/>{moments}</inertial>'
    path.write_text(ARM.format(inertial=inertial, inside="", more=""))
    scene = gauss.load(path)
    assert not scene.bodies["arm"].principal()[0].any()
    assert gauss.crosscheck(scene).passed


def test_what_urdf_does_not_know_is_named_with_its_line(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(ARM.format(inertial=INERTIAL.format(1), inside="<spring k='3'/>", more='<plugin name="p"/>'))
    with pytest.warns(NotImportedWarning, match=r"no URDF, and not read: <plugin> 'p' \(.*:7\), <spring> \(.*:6\)\."):
        gauss.load(path)
