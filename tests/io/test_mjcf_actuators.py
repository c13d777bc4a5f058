"""Actuators that nobody controls act as in MuJoCo or are refused by name; what else of a file is not read is named."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning

mujoco = pytest.importorskip("mujoco")
SAME = 1e-9  # relative error of accelerations: rounding of two solvers
NEW = pytest.mark.skipif(not hasattr(mujoco.MjModel, "nactuator"), reason="actuators of many controls came with MuJoCo 4")
HINGE = """<body name="{0}" pos="0 {1} 0"><joint name="{0}" axis="1 0 0" ref="0.3"/>
<geom size="0.1" pos="0.1 0.2 0.3" mass="1"/><site name="{0}" pos="0 0.1 0" euler="0.1 0.2 0.3"/></body>"""
BODIES = HINGE.format("h", 0) + HINGE.format("k", 1)
SLIDE = '<body name="s" pos="0 2 0"><joint name="s" type="slide" axis="0 0 1"/><geom size="0.1" mass="2"/></body>'
TENDON = '<tendon><fixed name="t"><joint joint="h" coef="0.5"/><joint joint="k" coef="-2"/></fixed></tendon>'
ABOVE, BELOW = 'ctrllimited="true" ctrlrange="1 2"', 'ctrllimited="true" ctrlrange="-4 -2.5"'
ACTING = {
    "a motor above 0": f'<motor joint="h" gear="3" {ABOVE}/>',
    "a motor below 0": f'<motor joint="h" {BELOW}/>',
    "a motor around 0": '<motor joint="h" ctrllimited="true" ctrlrange="-1 2"/>',
    "a range that is not meant": '<motor joint="h" ctrllimited="false" ctrlrange="1 2"/>',
    "a motor of limited force": f'<motor joint="h" gear="5" {ABOVE} forcelimited="true" forcerange="-0.25 0.25"/>',
    "a servo of position": f'<position joint="h" kp="20" kv="3" {ABOVE}/>',
    "a servo of position, limited": f'<position joint="h" kp="20" {ABOVE} forcelimited="true" forcerange="-7 7"/>',
    "a servo of speed": f'<velocity joint="h" kv="3" {BELOW}/>',
    "a damper": '<damper joint="h" kv="3" ctrlrange="0.5 2"/>',
    "an affine gain": f'<general joint="h" gaintype="affine" gainprm="2 3 4" biastype="affine" biasprm="1 2 3" {BELOW}/>',
    "a gain that is not fixed, without a control": '<general joint="h" gaintype="affine" gainprm="2 3 4"/>',
    "a pull at a tendon": f'<position tendon="t" kp="7" {ABOVE}/>',
    "a jet": f'<motor site="h" gear="1 2 3 0.1 0.2 0.3" {BELOW}/>',
    "a cylinder without state": f'<general joint="h" gainprm="3" biastype="affine" biasprm="0 -1 -2" {ABOVE}/>',
    "several, in any order": f'<motor joint="k" {BELOW}/><position joint="h" kp="3" {ABOVE}/><motor joint="h" {ABOVE}/>',
    "one that is switched off": f'<motor joint="h" group="2" {ABOVE}/><motor joint="k" {ABOVE}/>',
}
HEADS = {"one that is switched off": '<option actuatorgroupdisable="2"/>'}


def _file(folder, bodies, actuators="", more="", head=""):
    path = folder / "model.xml"
    head = f'<compiler angle="radian"/>{head}'
    path.write_text(f"<mujoco>{head}<worldbody>{bodies}</worldbody>\n{more}\n<actuator>\n{actuators}</actuator></mujoco>")
    return path


def _ours(path, states) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        scene = gauss.load(path)
    for name, (position, rate) in states.items():
        scene.start(name, position=position, rate=rate)
    system = gauss.compile_scene(scene)
    found = system.accelerations(system.initial_state())
    return np.concatenate([found[system.joint(name).v] for name in states])


def _theirs(path, states) -> np.ndarray:
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    for name, (position, rate) in states.items():
        joint = model.joint(name)
        data.qpos[joint.qposadr] += position
        data.qvel[joint.dofadr] = rate
    mujoco.mj_forward(model, data)
    return np.array([data.qacc[model.joint(name).dofadr[0]] for name in states])


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("flag", ["", '<option><flag clampctrl="disable"/></option>'], ids=["clamped", "not clamped"])
@pytest.mark.parametrize("name", ACTING)
def test_actuators_that_nobody_controls_act_as_in_mujoco(tmp_path, name, flag):
    path = _file(tmp_path, BODIES + SLIDE, ACTING[name], TENDON, HEADS.get(name, "") + flag)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        states = {joint: (float(rng.normal()), float(rng.normal())) for joint in "hks"}
        expected = _theirs(path, states)
        assert _ours(path, states) == pytest.approx(expected, rel=SAME, abs=SAME * abs(expected).max())


BALL = '<body name="b"><joint name="b" type="ball"/><geom size="0.1"/></body>'
MOTOR = '<motor name="last" joint="h" ctrllimited="true" ctrlrange="1 2"/>'
REFUSED = {  # of MuJoCo 4: bodies, actuators, what is named with its line
    "no control": (BODIES, '<dcmotor name="m" joint="h" motorconst="1" resistance="0.5" input="none"/>', "actuator 'm'.*:6"),
    "three controls": (BODIES + BALL, '<orientation name="m" joint="b" kp="1"/>', "actuator 'm'.*:6"),
    "a delay": (BODIES, '<motor name="m" joint="h" delay="0.05" nsample="6"/>', "actuator 'm': its control is delayed.*:6"),
    "no name": (BODIES, '<dcmotor joint="h" motorconst="1" resistance="0.5"/>', "actuator 'actuator 0'.*:6"),
    "after others": (BODIES + BALL, f'{MOTOR}\n<orientation name="m" joint="b" kp="1"/>', "actuator 'm'.*:7"),
}


@pytest.mark.peer
@NEW
@pytest.mark.parametrize("name", REFUSED)
def test_actuators_of_any_number_of_controls_are_refused_by_name(tmp_path, name):
    bodies, actuators, words = REFUSED[name]
    with pytest.raises(FileError, match=f"not modelled: .*{words}"):
        gauss.load(_file(tmp_path, bodies, actuators))


LEFT = {  # actuators, the rest of the file, its head, what is named
    "key frames": ("", '<keyframe><key name="home" qpos="1 1"/><key name="start"/><key/></keyframe>', "", "home, key 2"),
    "equalities": ("", '<equality><joint name="e" joint1="h" joint2="k" active="false"/></equality>', "", "not active: e"),
    "actuators": ('<motor name="m" joint="h" group="3"/>', "", '<option actuatorgroupdisable="3"/>', "switched off: m"),
}


@pytest.mark.parametrize("name", LEFT)
def test_what_is_there_and_not_read_is_named(tmp_path, name):
    actuators, more, head, words = LEFT[name]
    with pytest.warns(NotImportedWarning, match=f"not read: .*{words}"):
        gauss.load(_file(tmp_path, BODIES, actuators, more, head))


def test_mocap_bodies_stand_still_and_are_named(tmp_path):
    with pytest.warns(NotImportedWarning, match="mocap.*: hand"):
        gauss.load(_file(tmp_path, BODIES + '<body name="hand" mocap="true" pos="0 0 2"/>'))


@pytest.mark.parametrize(
    "ranges, limits, ends",
    [("-inf inf", None, None), ("0 inf", (-0.3, 1e16), (-0.3, None)), ("-1e17 0.5", (-1e16, 0.2), (None, 0.2))],
)
def test_infinite_limits_are_none(tmp_path, ranges, limits, ends):
    """Coordinates count from the pose of the file, at 0.3 rad."""
    path = _file(tmp_path, BODIES.replace('name="h" axis', f'name="h" range="{ranges}" axis'))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        scene = gauss.load(path, limits="stops")
    assert scene.joints["h"].limits == (limits and pytest.approx(limits))
    stop = scene.contacts.get("stop of h")
    assert (stop and (stop.lowest, stop.highest)) == (ends and pytest.approx(ends))


@pytest.mark.parametrize("text", ["", " ", "nan", "NaN", "inf", "-inf"])
@pytest.mark.parametrize("key", ["mass", "pos"])
def test_numbers_that_mujoco_would_replace_are_refused_with_their_place(tmp_path, key, text):
    value = text if key == "mass" else f"0 0 {text}" if text.strip() else text
    bodies = f'<body><joint/><geom size="0.1" {key}="{value}"/></body>'
    with pytest.raises(FileError, match=f"model.xml:1: <geom> {key}: expected finite numbers"):
        gauss.load(_file(tmp_path, bodies))
