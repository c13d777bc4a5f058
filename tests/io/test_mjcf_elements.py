"""Passive forces, tendons and actuators of MJCF files: accelerations of MuJoCo at random states, under random controls."""

import mujoco
import numpy as np
import pytest

import gauss
from benchmarks.foreign_accelerations import deviation
from gauss.codegen.content_digest import content_digest
from gauss.dynamics.kinematics import kinematics
from gauss.errors import FileError, NotImportedWarning
from gauss.simulation.held_inputs import driven_as
from tests.support.files import quietly

SAME = 1e-11  # relative: two exact engines, but for rounding
WITHIN = 1e-7  # relative: MuJoCo ends the search of a path through a geom at an angle of 1e-6

ARM = """<site name="hook" pos="0.2 0.1 1.5"/><body name="a" pos="0 0 1"{a}><joint name="h" axis="0 1 0"{h}/>
<geom size="0.1" pos="0.4 0 0.1"{g}/><site name="p" pos="0.3 0 0.1"/><site name="q" pos="0.1 0 0.3"/>
<body name="b" pos="0.5 0 0.1"{b}><joint name="s" type="slide" axis="1 0 0.2"/><geom type="box" size="0.1 0.2 0.05"/>
<site name="r" pos="0.1 0.2 0" euler="20 10 0"/><body name="c" pos="0.2 0 0"><joint name="k" axis="0 0 1"/>
<geom type="capsule" size="0.07 0.1" pos="0.1 0.2 0"{c}/><site name="o" pos="0 0.1 0.1"/></body></body></body>"""
FREE = """<body name="f" pos="1 2 3" quat="0.8 0.6 0 0"><joint name="F" type="free" {}/><geom type="box" size="0.1 0.2 0.3"
pos="0.1 0 0.2"/><body pos="0 0 0.5"><joint name="B" type="ball" {}/><geom type="ellipsoid" size="0.1 0.2 0.3"
pos="0.1 0.2 0.1"/></body></body>"""
BALL = (
    '<body name="f" pos="1 2 3"><joint name="B" type="ball" {}/><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0.2"/></body>'
)
SOFT = 'stiffness="3" damping="0.4"'
PATH = (
    '<tendon><spatial name="t" {}><site site="hook"/><site site="p"/><site site="q"/><site site="r"/>{}</spatial></tendon>'
)
PULLEY = '<pulley divisor="2"/><site site="o"/><site site="hook"/>'
SUM = '<tendon><fixed name="t" {}><joint joint="h" coef="0.5"/><joint joint="k" coef="-2"/></fixed></tendon>'
ROUND = '<geom name="{}" type="{}" size="{}" pos="{}" euler="20 -30 10" mass="0.3"/><site name="side" pos="{}"/>'
AROUND = (
    '<tendon><spatial stiffness="20" damping="0.5" springlength="0.1" {1}>'
    '<site site="hook"/><geom geom="w" {0}/><site site="r"/>'
    '<pulley divisor="2"/><site site="o"/><geom geom="w"/><site site="p"/></spatial></tendon>'
)
WIND = '<option density="1.2" viscosity="0.3" wind="1 0.5 -2"/>'


def wound(
    kind: str, size: str, side: str = "", at: str = "0.3 0.1 -0.1", where: str = "0.6 0 -0.4", more: str = ""
) -> tuple[str, str]:
    """Arm with a tendon around a geom of its middle body."""
    round_ = ROUND.format("w", kind, size, at, where)
    return arm(a="").replace('<site name="p"', round_ + '<site name="p"', 1), AROUND.format(
        side and f'sidesite="{side}"', more
    )


def arm(**more) -> str:
    return ARM.format(**{key: more.get(key, "") for key in "ahbgc"})


def acting(text: str, bodies: str = "", more: str = "") -> tuple[str, str]:
    return bodies or arm(), f"{more}<actuator>{text}</actuator>"


ELEMENTS = {
    "free and ball, soft": (FREE.format(SOFT, SOFT), ""),
    "free, damped": (FREE.format('damping="2"', ""), ""),
    "free, with armature": (FREE.format('armature="0.7"', ""), ""),
    "ball on the ground, with armature": (BALL.format(f'armature="0.7" {SOFT}'), ""),
    "ball with armature": (FREE.format("", 'armature="0.3"'), ""),
    "gravcomp": (arm(a=' gravcomp="1"', b=' gravcomp="0.3"'), ""),
    "a medium": (arm(), "", WIND),
    "a medium around ellipsoids": (arm(g=' fluidshape="ellipsoid"', c=' fluidshape="ellipsoid"'), "", WIND),
    "path": (arm(), PATH.format('stiffness="20" damping="0.5" springlength="0.3"', "")),
    "path with a pulley": (arm(), PATH.format('stiffness="20" damping="0.5" springlength="0.3"', PULLEY)),
    "path that is slack": (arm(), PATH.format('stiffness="20" springlength="0.3 1.5"', "")),
    "path around a sphere": wound("sphere", "0.25"),
    "path around a sphere, on a side": wound("sphere", "0.2", "side"),
    "path around a cylinder": wound("cylinder", "0.2 0.1"),
    "path around a cylinder, on a side": wound("cylinder", "0.15 0.1", "side"),
    "path around a sphere, a side on another body": wound("sphere", "0.1", "o"),
    "path in one body": (arm(), '<tendon><spatial stiffness="5"><site site="p"/><site site="q"/></spatial></tendon>'),
    "path with armature": (arm(), PATH.format('armature="0.3"', PULLEY)),
    "sum with armature": (arm(), SUM.format('armature="0.3"')),
    "sum that is slack": (arm(), SUM.format('stiffness="20" springlength="-0.1 0.4"')),
    "motor": acting('<motor name="m" joint="h" gear="3" ctrlrange="-1 2"/>'),
    "motor of limited force": acting('<motor name="m" joint="h" gear="-5" forcerange="-0.1 0.4"/>'),
    "motor of a limited joint": acting('<motor name="m" joint="h" gear="-5"/>', arm(h=' actuatorfrcrange="-0.2 3"')),
    "servo": acting('<position name="m" joint="s" kp="30" kv="2" gear="2"/>'),
    "servo of limited force": acting('<position name="m" joint="s" kp="30" kv="2" gear="2" forcerange="-1 2"/>'),
    "servo of a limited joint": acting('<position name="m" joint="h" kp="30"/>', arm(h=' actuatorfrcrange="-1 2"')),
    "servo of speed": acting('<velocity name="m" joint="k" kv="3" ctrlrange="0.5 1"/>'),
    "affine gain": acting(
        '<general name="m" joint="h" gaintype="affine" gainprm="2 3 4" biastype="affine" biasprm="1 2 3"/>'
    ),
    "damper": acting('<damper name="m" joint="h" kv="3" ctrlrange="0 1"/>'),
    "at a sum": acting('<position name="m" tendon="t" kp="7" gear="2"/>', more=SUM.format("")),
    "at a path around a sphere": acting(
        '<position name="m" tendon="t" kp="7" gear="2"/>',
        wound("sphere", "0.2")[0],
        wound("sphere", "0.2", more='name="t"')[1],
    ),
    "at a path": acting('<position name="m" tendon="t" kp="7" gear="2"/>', more=PATH.format("", PULLEY)),
    "at a path in one body": acting(
        '<motor name="m" tendon="t"/>', more='<tendon><spatial name="t"><site site="p"/><site site="q"/></spatial></tendon>'
    ),
    "at a ball, without gear": acting('<motor name="m" joint="B" gear="0 0 0"/>', FREE.format("", "")),
    "at a site": acting('<motor name="m" site="r" gear="1 2 3 0.1 0.2 0.3"/>'),
    "at a site, against the speed": acting('<velocity name="m" site="r" kv="2" gear="1 2 3 0.1 0.2 0.3"/>'),
    "at a free joint": acting('<motor name="m" joint="F" gear="1 2 3 0.1 0.2 0.3"/>', FREE.format("", "")),
    "at a ball": acting('<motor name="m" joint="B" gear="0.1 0.2 0.3"/>', FREE.format("", "")),
    "of the name of a tendon": acting('<motor name="t" joint="h"/>', more=PATH.format('stiffness="2"', "")),
    "two at one joint": acting('<motor name="m" joint="h"/><position name="n" joint="h" kp="2"/>'),
    "no passive forces": (
        arm(a=' gravcomp="1"', h=f" {SOFT}"),
        "",
        '<option density="1.2" wind="1 2 3"><flag spring="disable" damper="disable"/></option>',
    ),
    "gravcomp by actuators": (
        arm(a=' gravcomp="1"', b=' gravcomp="1"', h=' actuatorgravcomp="true"'),
        '<actuator><motor name="m" joint="h"/></actuator>',
    ),
    "a switch": (*acting('<motor name="m" joint="h"/>'), '<option><flag actuation="disable"/></option>'),
}
WELD = '<equality><weld body1="a" body2="w" {}/></equality>'
POINT = '<body name="w" pos="1 0 1"><freejoint/><geom size="0.1" pos="0.1 0 0"/></body>'
THROUGH = {
    "path through a sphere": wound("sphere", "0.2", "side", where="0.3 0.15 -0.1"),
    "path through a cylinder": wound("cylinder", "0.15 0.1", "side", where="0.3 0.15 -0.1"),
}
HELD = {
    "weld at another pose": (arm() + POINT, WELD.format('relpose="0.7 0.1 0.3 0.8 0.6 0 0" anchor="0.1 0.2 0"')),
    "weld of sites, at another pose": (
        arm() + POINT.replace("<freejoint", '<site name="e" pos="0 0 0.1" euler="10 0 0"/><freejoint'),
        '<equality><weld site1="r" site2="e"/></equality>',
    ),
    "weld without torque": (arm() + POINT, WELD.format('torquescale="0"')),
    "path": (arm(), PATH.format("", "") + '<equality><tendon tendon1="t" polycoef="0.05 0 0 0 0"/></equality>'),
    "path by a sum": (
        arm(),
        PATH.format("", "").replace("</tendon>", "")
        + SUM.format("").replace('<tendon><fixed name="t"', '<fixed name="u"')
        + '<equality><tendon tendon1="t" tendon2="u" polycoef="0 0.1 0.2 0 0"/></equality>',
    ),
    "sum by a parabola": (
        arm(),
        SUM.format("").replace("</tendon>", '<fixed name="u"><joint joint="s" coef="2"/></fixed></tendon>')
        + '<equality><tendon tendon1="t" tendon2="u" polycoef="0.01 0.1 0.2 0 0"/></equality>',
    ),
}


def _file(folder, bodies, rest="", head=""):
    path = folder / "model.xml"
    path.write_text(f"<mujoco>{head}\n<worldbody>\n{bodies}\n</worldbody>\n{rest}\n</mujoco>")
    return path


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", ELEMENTS)
def test_elements_accelerate_as_in_mujoco(tmp_path, name):
    path = _file(tmp_path, *ELEMENTS[name])
    assert deviation(path, quietly(path)) < SAME


@pytest.mark.peer
@pytest.mark.parametrize("name", THROUGH)
def test_paths_through_geoms_accelerate_as_in_mujoco(tmp_path, name):
    path = _file(tmp_path, *THROUGH[name])
    assert deviation(path, quietly(path)) < WITHIN


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", HELD)
def test_held_tendons_accelerate_as_in_mujoco(tmp_path, name):
    path = _file(tmp_path, *HELD[name])
    assert deviation(path, quietly(path)) < SAME


@pytest.mark.parametrize("name", ELEMENTS | THROUGH | HELD)
def test_machine_code_of_elements_is_kept_by_their_content(tmp_path, name):
    """Laws that hold the model of MuJoCo would have no digest, and be compiled in every process."""
    path = _file(tmp_path, *(ELEMENTS | THROUGH | HELD)[name])
    one, other = content_digest(quietly(path)), content_digest(quietly(path))
    assert one is not None and one == other


def test_friction_of_balls_and_free_joints_is_read(tmp_path):
    loss = 'frictionloss="0.4"'
    scene = quietly(_file(tmp_path, FREE.replace('quat="0.8 0.6 0 0"', "").format(loss, loss)))
    assert [element.limit for element in scene.set_valued.values()] == [0.4] * 9
    assert {element.joint for element in scene.set_valued.values()} >= {"F.x", "F.wz", "B.wx"}


def test_names_of_actuators_are_those_of_inputs(tmp_path):
    actuators = (
        '<motor name="m" joint="h" gear="3" ctrlrange="-1 2"/><position name="p" joint="s" kp="30"/><motor joint="k"/>'
    )
    scene = quietly(_file(tmp_path, *acting(actuators)))
    assert list(scene.inputs) == ["m", "p", "actuator 2"] and list(scene.loads) == ["feedback of p"]
    assert scene.inputs["m"].limits == (-1.0, 2.0) and scene.inputs["m"].acts_on == {"h": 3.0}
    assert scene.inputs["actuator 2"].joint == "k" and scene.inputs["p"].acts_on == {"s": 30.0}


STEP, SAMPLES, COMPARED = 2e-3, 40, 4  # of a scene for each sample, which takes long


@pytest.mark.slow
@pytest.mark.parametrize("name", ["servo of limited force", "at a path", "at a site", "at a free joint", "affine gain"])
def test_a_held_input_moves_as_a_load_of_its_law(tmp_path, name):
    scene = quietly(_file(tmp_path, *ELEMENTS[name]))
    table = np.random.default_rng(0).normal(size=SAMPLES)
    held = gauss.simulate(scene, SAMPLES * STEP, control=table, rate=1 / STEP, integrator="rk4", step=STEP, progress=False)
    state = gauss.compile_scene(scene).initial_state()
    for k, u in enumerate(table[:COMPARED]):
        system = driven_as(gauss.compile_scene(scene), {"m": lambda t, u=u: u})
        state = state if k else system.initial_state()
        moved = gauss.simulate(
            system, STEP, state=type(state)(0.0, state.q, state.v), integrator="rk4", step=STEP, progress=False
        )
        state = moved.state(-1)
    assert np.abs(held.q[COMPARED] - state.q).max() <= SAME * max(1.0, np.abs(state.q).max())


LIMITED = '<fixed name="t" range="-1 0.5"><joint joint="h" coef="0.5"/><joint joint="k" coef="-2"/></fixed>'


def test_limits_of_a_sum_are_read_where_stops_are(tmp_path):
    path = _file(tmp_path, arm(), f"<tendon>{LIMITED}</tendon>")
    with pytest.warns(NotImportedWarning, match="limits of tendons t"):
        assert not gauss.load(path).contacts
    scene = quietly(path, limits="stops")
    assert list(scene.contacts) == ["t taut", "t at its shortest"]
    system = gauss.compile_scene(scene)
    q = np.zeros(3)
    for joint, value in (("h", 0.4), ("k", 0.1)):
        q[system.joint(joint).q] = value
    motion = kinematics(system, system.state(q))
    gaps = [contact.gaps(motion)[0] for contact in scene.contacts.values()]
    assert gaps == pytest.approx([0.5, 1.0])  # of a length of 0


def test_paths_are_limited_by_one_sided_constraints(tmp_path):
    scene = quietly(_file(tmp_path, arm(), PATH.format('limited="true" range="0.1 9"', "")))
    assert list(scene.contacts) == ["t taut", "t at its shortest"]


KEYS = '<keyframe><key name="home" qpos="0.1 0.2 0.3" qvel="1 2 3"/><key qpos="0.4 0 0"/></keyframe>'


@pytest.mark.parametrize("asked, expected", [("home", (0.1, 1.0)), (0, (0.1, 1.0)), (1, (0.4, 0.0)), (None, None)])
def test_a_scene_starts_from_the_key_frame_that_is_asked_for(tmp_path, asked, expected):
    scene = quietly(_file(tmp_path, arm(), KEYS), keyframe=asked)
    start = scene.starts.get("h")
    assert (start and (start.position, start.rate)) == expected


@pytest.mark.parametrize("asked", ["hone", 2, -1, 1.5])
def test_a_key_frame_that_is_not_there_is_refused(tmp_path, asked):
    with pytest.raises(FileError, match="keyframe: no key frame .* among 2"):
        quietly(_file(tmp_path, arm(), KEYS), keyframe=asked)


def test_every_control_of_mujoco_has_its_place(tmp_path):
    path = _file(tmp_path, *ELEMENTS["two at one joint"])
    assert list(quietly(path).inputs) == [mujoco.MjModel.from_xml_path(str(path)).actuator(k).name for k in range(2)]
