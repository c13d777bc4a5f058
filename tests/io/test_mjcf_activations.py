"""Actuators of MJCF files with states: forces and rates of activations as in MuJoCo, and friction of tendons."""

import mujoco
import numpy as np
import pytest

import gauss
from benchmarks.foreign_accelerations import deviation
from gauss.codegen.content_digest import content_digest
from gauss.dynamics.inputs import driven_scene
from gauss.errors import NotImportedWarning
from gauss.io.mjcf.actuators import state_name
from gauss.system import random_state
from tests.io.test_mjcf_elements import SUM, acting, wound
from tests.io.test_mjcf_elements import _file as written
from tests.support.files import quietly

SAME = 1e-11  # relative: two exact engines, but for rounding
FRICTION = 1e-5  # relative: a motion by events beside the closed form of the same force
MUSCLE = '<muscle name="m" {} lengthrange="0.2 1.5" timeconst="0.02 0.05" tausmooth="{}" force="{}" scale="120"/>'
ACTIVE = {
    "filter": acting('<general name="m" joint="h" dyntype="filter" dynprm="0.3" gainprm="2" gear="3"/>'),
    "exact filter, limited": acting(
        '<general name="m" joint="h" dyntype="filterexact" dynprm="0.3" actlimited="true" actrange="-0.4 0.5"/>'
    ),
    "integrator of a servo": acting('<intvelocity name="m" joint="h" kp="30" kv="2" actrange="-1 1"/>'),
    "filter of a servo": acting('<position name="m" joint="s" kp="30" timeconst="0.2" inheritrange="0"/>'),
    "muscle on a joint": acting(MUSCLE.format('joint="h"', "0", "50")),
    "muscle, smooth, of a scaled force": acting(MUSCLE.format('joint="h"', "0.4", "-1")),
    "muscle on a sum": acting(MUSCLE.format('tendon="t"', "0", "50"), more=SUM.format("")),
    "muscle around a sphere": acting(
        MUSCLE.format('tendon="t"', "0", "50"),
        wound("sphere", "0.2")[0],
        wound("sphere", "0.2")[1].replace("<spatial", '<spatial name="t"'),
    ),
    "muscle without activation": acting(
        '<general name="m" joint="h" gaintype="muscle" biastype="muscle" lengthrange="0.2 1.5" '
        'gainprm="0.75 1.05 30 200 0.5 1.6 1.5 1.3 1.2" biasprm="0.75 1.05 30 200 0.5 1.6 1.5 1.3 1.2"/>'
    ),
}


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", ACTIVE)
def test_forces_of_activations_are_those_of_mujoco(tmp_path, name):
    path = written(tmp_path, *ACTIVE[name])
    assert deviation(path, quietly(path)) < SAME


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", [name for name in ACTIVE if "without" not in name])
@pytest.mark.parametrize("control", [0.0, 0.6, -0.7])
def test_activations_change_as_in_mujoco(tmp_path, name, control):
    path = written(tmp_path, *ACTIVE[name])
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    system = gauss.compile_scene(driven_scene(quietly(path), {"m": lambda t: control}))
    rng, place = np.random.default_rng(1), system.joint(state_name(model, 0)).v
    for _ in range(4):
        state = random_state(system, rng)
        act = float(state.v[place][0]) * 0.3
        state.v[place] = act
        data.act[0], data.ctrl[0] = act, control
        mujoco.mj_forward(model, data)
        found = gauss.solve(gauss.assemble(system, state)).qdd[place][0]
        assert found == pytest.approx(data.act_dot[0], rel=SAME, abs=SAME)


@pytest.mark.parametrize("name", ACTIVE)
def test_machine_code_of_activations_is_kept_by_their_content(tmp_path, name):
    path = written(tmp_path, *ACTIVE[name])
    one, other = content_digest(quietly(path)), content_digest(quietly(path))
    assert one is not None and one == other


@pytest.mark.slow
def test_an_activation_stays_in_its_range(tmp_path):
    path = written(
        tmp_path, *acting('<general name="m" joint="h" dyntype="integrator" actlimited="true" actrange="-1 0.5"/>')
    )
    moved = gauss.simulate(quietly(path), 2.0, control=lambda t, q, v: [1.0], rate=100.0)
    system = moved.system
    found = moved.v[:, system.joint("m activation").v][:, 0]
    assert found == pytest.approx(np.minimum(moved.t, 0.5), abs=1e-3)


def test_activations_that_act_a_step_early_are_named(tmp_path):
    path = written(tmp_path, *acting('<general name="m" joint="h" dyntype="filter" dynprm="0.3" actearly="true"/>'))
    with pytest.warns(NotImportedWarning, match="actearly.*m"):
        gauss.load(path)


def test_a_key_frame_starts_activations(tmp_path):
    bodies, rest = ACTIVE["filter"]
    path = written(tmp_path, bodies, rest + '<keyframe><key name="start" qpos="0 0 0" act="0.7"/></keyframe>')
    system = gauss.compile_scene(quietly(path))
    assert system.initial_state().v[system.joint("m activation").v] == 0.7


@pytest.mark.slow
def test_friction_of_a_sum_acts_along_it(tmp_path):
    """Sliding, it is the constant force of its limit against the rate of the sum."""
    slides = '<body><joint name="{0}" type="slide" axis="{1}"/><geom size="0.1" mass="2"/></body>'
    bodies = slides.format("h", "1 0 0") + slides.format("k", "0 1 0")
    path = written(tmp_path, bodies, SUM.format('frictionloss="3"') + '<keyframe><key name="start" qvel="9 -4"/></keyframe>')
    moved = gauss.simulate(quietly(path), 0.5)
    system = moved.system
    rates = [moved.v[-1, system.joint(name).v][0] for name in "hk"]
    assert rates == pytest.approx([9 - 0.5 * 3 / 2 * 0.5, -4 + 2 * 3 / 2 * 0.5], rel=FRICTION)
