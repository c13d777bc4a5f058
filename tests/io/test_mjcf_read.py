"""MJCF files through MuJoCo's compiler: MuJoCo's own accelerations, everything unsupported by name, nothing hostile."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest

import gauss
from gauss import rotations
from gauss.dynamics.kinematics import kinematics
from gauss.errors import NotImportedWarning
from tests.support.files import quietly

SAME = 1e-11  # relative: two exact engines, but for rounding
# MuJoCo's equalities give way by (1 − 0.9999) of their estimated compliance; the estimate is lowered by HARD for a check.
HARD = 1e-6
SOFT = 1e-6  # what is left then

ARM = """
<body name="a" pos="0 0 1"><joint name="h1" axis="0 1 0" damping="0.3" armature="0.05"/>
  <joint name="s1" type="slide" axis="1 0 0" stiffness="20" springref="0.1" armature="0.5"/>
  <geom type="capsule" fromto="0 0 0 0.5 0 0.1" size="0.05"/>
  <body name="b" pos="0.5 0 0.1" euler="0.1 0.2 0.3"><joint name="h2" axis="0 0 1" pos="0.02 0 0" ref="0.3"/>
    <geom type="box" size="0.1 0.2 0.05" pos="0.1 0 0"/>
    <body name="c" pos="0.2 0 0"><geom type="sphere" size="0.07"/></body></body></body>"""
SERVOS = '<actuator><motor name="m" joint="h1" gear="2"/><position name="p" joint="h2" kp="30" kv="2"/></actuator>'
FLYING = """
<body name="base" pos="0 0 2" quat="0.8 0.6 0 0"><freejoint name="F"/><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0"/>
  <body name="ball" pos="0 0 0.4"><joint name="B" type="ball" pos="0 0 -0.1"/>
    <geom type="ellipsoid" size="0.1 0.2 0.3"/></body></body>"""
CRANKS = """
<body name="left"><joint name="L" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.02"/>
  <body name="coupler" pos="0 0 0.5"><joint name="C" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 1 0 0" size="0.02"/></body></body>
<body name="right" pos="1 0 0"><joint name="R" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.03"/></body>"""
CLOSED = '<equality><connect name="pin" body1="coupler" body2="right" anchor="1 0 0"/></equality>'
WELDED = """
<body name="left"><joint name="L" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.02"/></body>
<body name="tip" pos="0 0 0.5"><freejoint/><geom type="sphere" size="0.1"/></body>"""
WELD = '<equality><weld name="glue" body1="left" body2="tip"/></equality>'
GEARED = '<equality><joint name="gear" joint1="L" joint2="R" polycoef="0 -2 0 0 0"/></equality>'
HELD = '<equality><joint name="held" joint1="L" polycoef="0 0 0 0 0"/></equality>'
DRY = '<body name="a"><joint name="h" axis="0 1 0" frictionloss="0.4"/><geom size="0.1" pos="0.3 0 0"/></body>'

MARKED = """
<site name="hook" pos="0.2 0.1 1.5" euler="0.3 0 0.1"/>
<body name="a" pos="0 0 1"><joint name="h1" axis="0 1 0" ref="0.2"/><geom size="0.1" pos="0.4 0 0.1"/>
  <site name="on_a" pos="0.3 0 0.1"/>
  <body name="b" pos="0.5 0 0.1"><joint name="s1" type="slide" axis="1 0 0.2"/><geom type="box" size="0.1 0.2 0.05"/>
    <site name="on_b" pos="0.1 0.2 0" euler="0.2 0.4 0.1"/>
    <body name="c" pos="0.2 0 0"><joint name="h2" axis="0 0 1"/><geom size="0.07" pos="0.1 0.2 0"/></body></body></body>"""
SUM = (
    '<fixed name="sum" {}><joint joint="h1" coef="1.5"/><joint joint="s1" coef="-2"/><joint joint="h2" coef="0.7"/></fixed>'
)
LINE = '<spatial name="line" {}><site site="hook"/><site site="on_b"/></spatial>'
SPRINGS = 'stiffness="20" damping="0.5" springlength="0.3"', 'stiffness="30" damping="2" springlength="0.4"'
PULLED = f"""<tendon>{SUM.format(SPRINGS[0])}{LINE.format(SPRINGS[1])}</tendon><actuator>
  <general name="pull" tendon="sum" gear="1.2" biastype="affine" biasprm="3 -2 -0.4"/>
  <general name="push" site="on_b" gear="1 2 3 0.4 0.5 0.6" biastype="affine" biasprm="1 0 0"/>
  <general name="lift" site="on_b" refsite="hook" gear="1 2 3 0.4 0.5 0.6" biastype="affine" biasprm="1 0 0"/>
  <position name="held" joint="h2" kp="300" kv="2" forcerange="-1.5 1.5"/></actuator>"""

TREES = {"arm": (ARM, SERVOS), "flying": (FLYING, ""), "tendons": (MARKED, PULLED)}


def _off(switch: str) -> str:
    return f'<option><flag {switch}="disable"/></option>'


TREES |= {
    "no gravity": (ARM, SERVOS, _off("gravity")),
    "no springs": (MARKED, PULLED, _off("spring")),
    "no dampers": (MARKED, PULLED, _off("damper")),
    "no equalities": (CRANKS, CLOSED, _off("equality")),
    "no friction": (DRY, "", _off("frictionloss")),
    "no constraints": (CRANKS + DRY.replace('name="a"', 'name="a" pos="0 1 0"'), CLOSED, _off("constraint")),
}
CURVED = '<equality><joint name="curve" joint1="L" joint2="R" polycoef="0.1 -2 0.5 0.3 -0.2"/></equality>'
SITES = CRANKS.replace('<joint name="C"', '<site name="one" pos="1 0 0"/><joint name="C"').replace(
    '<joint name="R"', '<site name="two" pos="0 0 0.5"/><joint name="R"'
)
PINNED = '<equality><connect name="pin" site1="one" site2="two"/></equality>'


def _tied(first: str, more: str = "") -> str:
    return f'<tendon>{first}</tendon><equality><tendon name="tied" {more} polycoef="0.05 0.6 0 0 0"/></equality>'


HALF = '<fixed name="half"><joint joint="h1" coef="0.5"/></fixed>'
LOOPS = {
    "connect": (CRANKS, CLOSED, {"L": 0.3}),
    "weld": (WELDED, WELD, {"L": 0.3}),
    "gear": (CRANKS, GEARED, {"R": 0.3}),
    "held": (CRANKS, HELD, {"R": 0.3}),
    "curve": (CRANKS, CURVED, {"R": 0.3}),
    "sites": (SITES, PINNED, {"L": 0.3}),
    "sum of coordinates": (MARKED, _tied(SUM.format(""), 'tendon1="sum"'), {"h1": 0.2}),
    "two sums": (MARKED, _tied(SUM.format("") + HALF, 'tendon1="sum" tendon2="half"'), {"h1": 0.2}),
    "one coordinate": (MARKED, _tied(HALF, 'tendon1="half"'), {"s1": 0.2}),
    "rod": (MARKED, _tied(LINE.format(""), 'tendon1="line"'), {"h1": 0.2}),
}


def _file(folder, bodies, rest="", head=""):
    path = folder / "model.xml"
    text = f'<mujoco><compiler angle="radian"/>{head}<worldbody>{bodies}</worldbody>{rest}</mujoco>'
    path.write_text(text)
    return path


def _model(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model, mujoco.MjData(model)


def _matched(system, model):
    """Pairs of places of rates, gauss and MuJoCo, joint by joint."""
    pairs = []
    for j in range(model.njnt):
        joint = system.joint(model.joint(j).name or f"joint {j}")
        pairs += [(joint.v.start + k, model.jnt_dofadr[j] + k) for k in range(joint.pair.n_v)]
    return np.array(pairs).T


def _turned(joint, model) -> np.ndarray:
    """From MuJoCo's rates to those of gauss: of a free joint ω is along the body's axes there, here along the world's."""
    turn = np.eye(joint.pair.n_v)
    if joint.pair.kind == "free":
        turn[3:, 3:] = rotations.from_quaternion(model.body_quat[model.joint(joint.name).bodyid[0]])
    return turn


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", TREES)
@pytest.mark.parametrize("seed", [0, 1])
def test_trees_accelerate_as_in_mujoco(tmp_path, name, seed):
    path = _file(tmp_path, *TREES[name])
    system = gauss.compile_scene(quietly(path))
    model, data = _model(path)
    rng = np.random.default_rng(seed)
    ours, theirs = _matched(system, model)
    data.qvel[theirs] = rng.normal(size=model.nv)
    scene = system.scene
    for j in range(model.njnt):
        joint = system.joint(model.joint(j).name)
        rate = data.qvel[model.jnt_dofadr[j] :][: joint.pair.n_v]
        if joint.pair.n_q == 1:
            data.qpos[model.jnt_qposadr[j]] += (angle := rng.normal())
            scene.start(joint.name, position=angle, rate=float(rate[0]))
        else:
            scene.start(joint.name, rate=tuple(_turned(joint, model) @ rate))
    mujoco.mj_forward(model, data)
    system = gauss.compile_scene(scene)
    found = system.accelerations(system.initial_state())
    for joint in system.joints:
        if joint.pair.kind == "free":
            found[joint.v] = _turned(joint, model).T @ found[joint.v]
    assert found[ours] == pytest.approx(data.qacc[theirs], rel=SAME, abs=SAME * abs(data.qacc).max())


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", LOOPS)
def test_loops_accelerate_as_in_mujoco(tmp_path, name):
    bodies, equalities, starts = LOOPS[name]
    path = _file(tmp_path, bodies, equalities)
    scene = quietly(path)
    for joint, angle in starts.items():
        scene.start(joint, position=angle)
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    model, data = _model(path)
    model.opt.timestep, model.opt.tolerance, model.opt.iterations = 1e-6, 0.0, 100
    model.eq_solref[:], model.eq_solimp[:, :2] = (1e-4, 1.0), 0.9999
    for weights in (model.dof_invweight0, model.body_invweight0, model.tendon_invweight0):
        weights *= HARD
    for j in range(model.njnt):
        joint = system.joint(model.joint(j).name or f"joint {j}")
        if joint.pair.n_q == 1:
            data.qpos[model.jnt_qposadr[j]] += state.q[joint.q][0]
        else:
            motion, place = kinematics(system, state), model.jnt_qposadr[j]
            data.qpos[place : place + 3] = motion.position("tip")
            data.qpos[place + 3 : place + 7] = rotations.to_quaternion(motion.rotation("tip"))
    mujoco.mj_forward(model, data)
    ours, theirs = _matched(system, model)
    found = system.accelerations(state)
    assert found[ours] == pytest.approx(data.qacc[theirs], abs=SOFT * abs(data.qacc).max())


LINK = """<body name="{0}" pos="0.3 0 0">
  <joint name="{0}" type="{1}" axis="{2}" armature="{3}" stiffness="20" damping="0.5"/>
  <geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.03"/>{4}</body>"""
AXES = {"hinge": "0 1 0", "slide": "1 0 0.2"}


@pytest.mark.slow
@pytest.mark.parametrize("armature", [1e-3, 1.0])
@pytest.mark.parametrize("chain", [("hinge", "slide"), ("hinge", "slide", "hinge")])
def test_armature_leaves_the_motion_of_an_arm_to_machine_code(tmp_path, chain, armature):
    bodies = ""
    for number, kind in reversed(list(enumerate(chain))):
        bodies = LINK.format(f"link{number}", kind, AXES[kind], armature, bodies)
    scene = quietly(_file(tmp_path, bodies))
    scene.start("link0", position=0.5, rate=1.0)
    motion = gauss.simulate(scene, 1.0)
    plan = motion.stats.plan
    assert (plan.driver, plan.dynamics) == ("compiled loop", "embedded loops") and motion.stats.handed_over is None
    assert motion.t[-1] == 1.0


def test_inertia_comes_from_geometry(tmp_path):
    box = '<body name="a"><joint name="h"/><geom type="box" size="0.1 0.2 0.3" density="500"/></body>'
    scene = quietly(_file(tmp_path, box))
    body = scene.bodies["a"]
    mass = 500 * 0.2 * 0.4 * 0.6
    assert body.mass == pytest.approx(mass)
    assert sorted(body.inertia) == pytest.approx(sorted(mass / 12 * s for s in (0.16 + 0.36, 0.04 + 0.36, 0.04 + 0.16)))


def test_what_does_not_move_by_itself_is_warned_of(tmp_path):
    path = _file(tmp_path, '<body name="a"><joint name="h" range="-1 1" limited="true"/><geom name="g" size="0.1"/></body>')
    with pytest.warns(NotImportedWarning, match=r"contacts of geoms g; limits, .* of joints h"):
        scene = gauss.load(path)
    assert scene.joints["h"].limits == (-1.0, 1.0)


def test_a_tendon_of_limited_length_is_a_rope(tmp_path):
    limited = LINE.format('limited="true" range="0 0.9"')
    scene = quietly(_file(tmp_path, MARKED, f"<tendon>{limited}</tendon>"))
    rope = scene.contacts["line"]
    assert (rope.body, rope.other, rope.length, rope.at) == ("ground", "b", 0.9, (0.2, 0.1, 1.5))


def test_dry_friction_of_joints_is_read(tmp_path):
    scene = quietly(_file(tmp_path, DRY))
    assert [element.limit for element in scene.set_valued.values()] == [0.4]


def test_names_that_only_mujoco_tells_apart(tmp_path):
    bodies = '<body name="ground"><joint name="h"/><geom size="0.1" pos="0.2 0 0"/></body>'
    rest = '<equality><joint name="h" joint1="h" polycoef="0 0 0 0 0"/></equality>'
    rest += '<actuator><motor name="h" joint="h"/></actuator>'
    scene = quietly(_file(tmp_path, bodies, rest))
    assert list(scene.bodies) == ["body ground"] and list(scene.relations) == ["equality h"] and list(scene.inputs) == ["h"]


@pytest.mark.slow
def test_the_command_line_warns_in_one_line(tmp_path):
    path = _file(tmp_path, '<body name="a"><joint name="h"/><geom name="g" size="0.1" pos="0.1 0 0"/></body>')
    ran = subprocess.run([sys.executable, "-m", "gauss", "explain", str(path)], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr.splitlines() == [f"warning: {path}: not read: contacts of geoms g."]
