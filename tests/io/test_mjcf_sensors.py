"""Sensors of MJCF files as outputs: values of MuJoCo at random states, after a round trip too; the rest is named."""

import mujoco
import numpy as np
import pytest

import gauss
from gauss import rotations
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.sensor_values import measured
from gauss.errors import NotImportedWarning
from gauss.io.mjcf.tree import depth_first, limb, mujoco_state, spanning_tree
from gauss.io.mjcf.write import to_mjcf
from gauss.system.manifold import retract
from tests.support.files import quietly

SAME = 1e-12  # of the largest value, of a sensor: rounding
REF = 0.3  # rad, of the joint h: coordinates count from the pose of the file
BODIES = f"""<site name="still" pos="1 2 3" euler="10 20 30"/><body name="a" pos="0 0 1" euler="5 6 7">
<joint name="h" axis="0 1 0" ref="{REF}"/><geom name="g" type="box" size="0.1 0.2 0.3" pos="0.4 0 0.1" euler="9 8 7"/>
<site name="a" pos="0.3 0 0.1" euler="20 30 40"/><body name="b" pos="0.5 0 0.1" quat="0.8 0.6 0 0">
<joint name="s" type="slide" axis="1 0 0.2"/><geom type="box" size="0.1 0.2 0.05" pos="0.1 0.1 0" euler="30 0 10"/>
<site name="r" pos="0.1 0.2 0" euler="20 10 0"/><body name="c" pos="0.2 0 0" euler="15 0 5"><joint name="B" type="ball"/>
<geom name="r" type="capsule" size="0.07 0.1" pos="0.1 0.2 0" euler="0 40 0"/></body></body></body>
<body name="f" pos="1 2 3" quat="0.8 0.6 0 0"><freejoint name="F"/><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0.2"/>
<site name="p" pos="0.1 0 0.3"/></body>"""
ACTUATORS = '<actuator><motor name="push" joint="s"/><motor name="geared" joint="s" gear="2"/></actuator>'
PLACES = {  # attributes of what is measured
    "a site that is turned": 'objtype="site" objname="r"',
    "a site of the name of a body": 'objtype="site" objname="a"',
    "a site of a free body": 'objtype="site" objname="p"',
    "a site of the ground": 'objtype="site" objname="still"',
    "a geom of the name of a site": 'objtype="geom" objname="r"',
    "a centre of mass": 'objtype="body" objname="b"',
    "a body": 'objtype="xbody" objname="c"',
}
AXES = ("framexaxis", "frameyaxis", "framezaxis")
KINDS = ("framepos", "framequat", "framelinvel", "frameangvel", *AXES, "framelinacc", "frameangacc")
BASES = {"a turned site": ("site", "a"), "a geom": ("geom", "g"), "a body": ("xbody", "b"), "the ground": ("site", "still")}
SUBTREES = ("subtreecom", "subtreelinvel", "subtreeangmom")
SENSORS = {f"{kind} of {place}": f"<{kind} {{}} {where}/>" for kind in KINDS for place, where in PLACES.items()}
SENSORS |= {
    f"{kind} of {place} from {base}": f'<{kind} {{}} {where} reftype="{what}" refname="{name}"/>'
    for kind in KINDS
    if not kind.endswith("acc")
    for place, where in PLACES.items()
    for base, (what, name) in BASES.items()
}
OWN = ("gyro", "accelerometer", "velocimeter")
SENSORS |= {f"{kind} at {site}": f'<{kind} {{}} site="{site}"/>' for kind in OWN for site in "arp"}
SENSORS |= {f"{kind} of {body}": f'<{kind} {{}} body="{body}"/>' for kind in SUBTREES for body in ("world", *"abcf")}
SENSORS |= {f"actuator{kind}": f'<actuator{kind} {{}} actuator="push"/>' for kind in ("pos", "vel")}
SENSORS |= {f"{kind} of {joint}": f'<{kind} {{}} joint="{joint}"/>' for kind in ("jointpos", "jointvel") for joint in "hs"}
SENSORS |= {kind: f'<{kind} {{}} joint="B"/>' for kind in ("ballquat", "ballangvel")}


def _file(folder, sensors):
    path = folder / "model.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><worldbody>{BODIES}</worldbody>{ACTUATORS}<sensor>{sensors}</sensor></mujoco>'
    )
    return path


def _limbs(system):
    return [limb(system, *edge) for edge in spanning_tree(system.scene)[0]]


def _same(path, system, state, shift: float = 0.0) -> dict[str, bool]:
    """Whether outputs have the values of MuJoCo's sensors in a state, by their names."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data, motion, same = mujoco.MjData(model), kinematics(system, state), {}
    data.qpos, data.qvel = mujoco_state(system, depth_first(_limbs(system)), motion)
    data.qpos[model.joint("h").qposadr] += shift
    mujoco.mj_forward(model, data)
    acceleration = system.accelerations(state)
    for name, output in system.scene.outputs.items():
        found, expected = np.ravel(measured(output, motion, acceleration)), data.sensor(name).data
        if output.kind == "rotation":
            expected = np.ravel(rotations.from_quaternion(expected))
        if name == "jointpos of h":
            expected = expected - shift
        same[name] = found == pytest.approx(expected, abs=SAME * max(1.0, abs(expected).max()))
    return same


@pytest.mark.slow
def test_outputs_have_the_values_of_sensors(tmp_path):
    sensors = "".join(text.format(f'name="{name}"') for name, text in SENSORS.items())
    path = _file(tmp_path, sensors)
    system = gauss.compile_scene(quietly(path))
    again = tmp_path / "again.xml"
    again.write_text(to_mjcf(system.scene), encoding="utf-8")
    returned = gauss.compile_scene(quietly(again))
    assert list(system.scene.outputs) == list(returned.scene.outputs) == list(SENSORS)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        state = system.state(
            retract(system, system.initial_state().q, rng.normal(size=system.n_v)), rng.normal(size=system.n_v)
        )
        for file, one, shift in ((path, system, REF), (again, returned, 0.0)):
            assert [name for name, same in _same(file, one, state, shift).items() if not same] == []


LEFT = {  # sensors, and what is named
    "a kind": ('<touch name="t" site="a"/><clock/>', "touch, .*: t; .*clock, .*: sensor 1"),
    "a reference": (
        '<framepos name="t" objtype="site" objname="a" reftype="camera" refname="e"/>',
        "framepos relative to a camera: t",
    ),
    "a gear": ('<actuatorpos name="t" actuator="geared"/>', "actuatorpos of a tendon, a site or a gear: t"),
    "a cutoff": ('<jointvel name="t" joint="h" cutoff="0.1"/>', "jointvel with a cutoff: t"),
    "a camera": ('<framepos name="t" objtype="camera" objname="e"/>', "framepos of a camera: t"),
    "a force": ('<force name="t" site="a"/>', "force, .*: t"),
}


@pytest.mark.parametrize("name", LEFT)
def test_sensors_without_a_counterpart_are_named(tmp_path, name):
    sensors, words = LEFT[name]
    path = _file(tmp_path, sensors + '<jointpos name="angle" joint="h"/>')
    path.write_text(path.read_text().replace('<site name="a"', '<camera name="e"/><site name="a"'))
    with pytest.warns(NotImportedWarning, match=f"not read: .*sensors of the kind {words}"):
        assert list(gauss.load(path).outputs) == ["angle"]


MASSES = {  # what makes the masses that hang on a body others than in MuJoCo, and what is named
    "armature of a free joint": ('<freejoint name="F"/>', '<joint name="F" type="free" armature="0.1"/>', "f", "armature"),
    "a loop": ("<actuator>", '<equality><connect body1="c" body2="f" anchor="0 0 0"/></equality><actuator>', "a", "loops"),
    "no mass": ("<camera", '<body name="n"><body name="m"/></body><camera', "n", "without mass"),
}


@pytest.mark.parametrize("case", MASSES)
def test_subtrees_of_other_masses_are_named(tmp_path, case):
    old, new, body, words = MASSES[case]
    path = _file(tmp_path, f'<subtreecom name="t" body="{body}"/>')
    path.write_text(path.read_text().replace('<site name="a"', '<camera name="e"/><site name="a"').replace(old, new))
    with pytest.warns(NotImportedWarning, match=f"subtreecom .*{words}: t"):
        assert not gauss.load(path).outputs
