"""Limits, damping, friction and collision shapes of URDF files: what is read on request, and what is said of the rest."""

import numpy as np
import pytest
from typer.testing import CliRunner

import gauss
from gauss.cli import app
from gauss.errors import FileError, NotImportedWarning
from gauss.scene import Box, Capsule, Sphere
from tests.support.files import quietly

ARM = """<robot name="arm">
  <link name="base"><collision><origin xyz="0 0 -0.5"/><geometry><box size="2 2 1"/></geometry></collision></link>
  <link name="upper">
    <inertial><mass value="2"/><origin xyz="0 0 -0.5"/>
      <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.5" rpy="0 0.5 0"/><geometry><capsule radius="0.1" length="0.8"/></geometry></collision>
    <collision><geometry><mesh filename="upper.stl"/></geometry></collision>
  </link>
  <link name="tip">
    <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.2"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 2"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.8" effort="10" velocity="2"/><dynamics damping="0.7" friction="0.3"/></joint>
  <joint name="wrist" type="prismatic"><parent link="upper"/><child link="tip"/><origin xyz="0 0 -1"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0" effort="10" velocity="2"/></joint>
</robot>"""


@pytest.fixture
def arm(tmp_path):
    """Path of the file."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return path


def test_what_moves_the_robot_and_is_left_out_is_named(arm):
    with pytest.warns(NotImportedWarning, match=r"damping and friction of shoulder \(resistance=True"):
        scene = gauss.load(arm)
    assert not scene.loads
    assert not scene.set_valued
    assert not scene.contacts
    assert not scene.shapes
    assert scene.joints["shoulder"].limits is None


@pytest.mark.slow
def test_limits_hold_the_start_and_become_stops(arm):
    with pytest.warns(NotImportedWarning, match="limits that leave no motion, of wrist"):
        scene = gauss.load(arm, limits="start")
    assert scene.joints["shoulder"].limits == (-0.5, 0.8)
    assert not scene.contacts
    scene = quietly(arm, limits="stops")
    stop = scene.contacts["stop of shoulder"]
    assert (stop.lowest, stop.highest) == (-0.5, 0.8)
    scene.start("shoulder", position=2.0)
    assert gauss.compile_scene(scene).initial_state().q[0] == 0.8
    scene.start("shoulder", position=0.0, rate=5.0)
    motion = gauss.simulate(scene, 1.0, rtol=1e-9, progress=False)
    assert motion.coordinate("shoulder").max() <= 0.8 + 1e-9
    assert "stop of shoulder.highest" in {gap for event in motion.events for gap in event.gaps}


@pytest.mark.slow
def test_resistance_is_a_damper_and_friction(arm):
    scene = quietly(arm, resistance=True)
    assert scene.loads["damper of shoulder"].damping == 0.7
    assert scene.set_valued["friction of shoulder"].limit == 0.3
    motion = gauss.simulate(scene, 0.05, rtol=1e-9, progress=False)
    assert gauss.energy(motion).dissipated[-1] >= 0.0


@pytest.mark.slow
def test_shapes_are_those_of_the_file_and_touch(arm):
    with pytest.warns(NotImportedWarning, match=r"collision shapes that are not modelled: upper\.2 \(mesh\)"):
        scene = gauss.load(arm, collisions=True, resistance=True)
    base, upper, tip = (scene.shapes[name] for name in ("base", "upper", "tip"))
    assert (type(base), base.size, base.at) == (Box, (2.0, 2.0, 1.0), (0.0, 0.0, -0.5))
    assert (type(upper), upper.radius, upper.length) == (Capsule, 0.1, 0.8)
    assert upper.axis == pytest.approx((np.sin(0.5), 0, np.cos(0.5)))
    assert (type(tip), tip.radius) == (Sphere, 0.2)
    scene.set_valued.clear()
    scene.contact("lands", "tip", "base")
    motion = gauss.simulate(scene, 1.0, rtol=1e-8, progress=False)
    assert motion.body("tip").position[:, 2].min() >= 0.2 - 1e-8
    assert motion.events


MISTAKES = {
    "limits": ({"limits": "stop"}, "limits: expected 'start' or 'stops'.*Did you mean 'stops'"),
    "option": ({"resistence": True}, "unknown option 'resistence'.*resistance"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(arm, mistake):
    options, message = MISTAKES[mistake]
    with pytest.raises(FileError, match=message):
        gauss.load(arm, **options)


@pytest.mark.parametrize(("old", "new"), [('damping="0.7"', 'damping="much"'), ('radius="0.2"', 'size="0.2"')])
def test_broken_numbers_are_refused(arm, old, new):
    arm.write_text(ARM.replace(old, new))
    with pytest.raises(FileError, match="arm.urdf"):
        gauss.load(arm, resistance=True, collisions=True)


def test_the_command_line_reads_them_too(arm):
    result = CliRunner().invoke(app, ["explain", str(arm), "--read", "stops", "--read", "resistance"])
    assert result.exit_code == 0
    assert "stop of shoulder" in result.output
    result = CliRunner().invoke(app, ["explain", str(arm), "--read", "stop"])
    assert result.exit_code != 0


def _motor(
    kind="transmission_interface/SimpleTransmission",
    joint="shoulder",
    reduction="<mechanicalReduction>50</mechanicalReduction>",
):
    return ARM.replace(
        "</robot>",
        f"""<transmission name="t"><type>{kind}</type><joint name="{joint}"/><actuator name="motor">{reduction}</actuator>
        </transmission></robot>""",
    )


@pytest.mark.slow
@pytest.mark.parametrize(("reduction", "n"), [("", 1.0), ("<mechanicalReduction> -50 </mechanicalReduction>", -50.0)])
def test_a_motor_acts_on_its_joint_times_the_reduction(tmp_path, reduction, n):
    """τ = n u, within the effort of 10 N m of the joint."""
    path = tmp_path / "arm.urdf"
    path.write_text(_motor(reduction=reduction))
    scene = quietly(path, motors=True)
    assert list(scene.inputs) == ["motor"]
    for u in (0.01, 1e3):
        torque = min(max(n * u, -10.0), 10.0)
        driven = quietly(path)
        driven.drive("shoulder", torque=torque)
        simulated = gauss.simulate(scene, 0.01, control=lambda t, q, v, u=u: [u], rate=100, progress=False)
        expected = gauss.simulate(driven, 0.01, progress=False)
        assert simulated.q[-1] == pytest.approx(expected.q[-1], abs=1e-12)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"joint": "elbow"}, "elbow"),
        ({"reduction": "<mechanicalReduction>0</mechanicalReduction>"}, "mechanicalReduction"),
        ({"reduction": "<mechanicalReduction>1:50</mechanicalReduction>"}, "1:50"),
    ],
)
def test_a_motor_without_joint_or_reduction_is_refused_with_its_line(tmp_path, given, named):
    path = tmp_path / "arm.urdf"
    path.write_text(_motor(**given))
    with pytest.raises(FileError, match=rf"arm\.urdf:\d+.*{named}"):
        quietly(path, motors=True)


def test_other_transmissions_are_named(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(_motor(kind="transmission_interface/DifferentialTransmission"))
    with pytest.warns(NotImportedWarning, match="transmissions that are not modelled: t"):
        assert not gauss.load(path, motors=True).inputs
