"""Scenes in MuJoCo: poses and accelerations of an exported scene, and motions of its soft contacts."""

import mujoco
import numpy as np

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.io.mjcf.tree import limb, mujoco_state, spanning_tree
from gauss.io.mjcf.write import to_mjcf
from gauss.system import State, random_state, retract

# MuJoCo's equalities give way by (1 − 0.9999) of their estimated compliance; the estimate is lowered by HARD for a check.
HARD = 1e-6
SOFT = 1e-6  # what is left then
STEP = 1e-5  # s, of central differences


def in_mujoco(scene):
    """Model and data of the exported scene."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    model.opt.timestep, model.opt.tolerance, model.opt.iterations = 1e-6, 0.0, 100
    model.eq_solref[:] = (1e-4, 1.0)
    for weights in (model.dof_invweight0, model.body_invweight0, model.tendon_invweight0):
        weights *= HARD
    return model, mujoco.MjData(model)


def differences(scene, state=None, seed=0) -> tuple[float, float]:
    """Differences of poses [m, 1], and of accelerations relative to the largest, or to 1 rad/s²."""
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(seed)) if state is None else system.initial_state(*state)
    model, data = in_mujoco(scene)
    limbs = [limb(system, *edge) for edge in spanning_tree(scene)[0]]
    motion = kinematics(system, state)
    data.qpos, data.qvel = mujoco_state(system, limbs, motion)
    mujoco.mj_forward(model, data)
    acceleration = system.accelerations(state)

    def rates(h):
        q = retract(system, state.q, h * state.v + h * h / 2 * acceleration)
        return mujoco_state(system, limbs, kinematics(system, State(state.t, q, state.v + h * acceleration)))[1]

    expected = (rates(STEP) - rates(-STEP)) / (2 * STEP)
    poses = [
        max(
            np.abs(data.body(name).xpos - motion.position(name)).max(),
            np.abs(data.body(name).xmat.reshape(3, 3) - motion.rotation(name)).max(),
        )
        for name in scene.bodies
    ]
    return max(poses), np.abs(data.qacc - expected).max() / max(1.0, np.abs(expected).max())


# MuJoCo's contacts and limits are springs of some ms, and creep under friction: motions of some 0.1 s differ by this share.
GIVES_WAY = 2e-2
TIMESTEP = 2e-4


def mujoco_run(scene, duration):
    """Coordinates and rates in MuJoCo after a run from the start of the scene."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    model.opt.timestep = TIMESTEP
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(duration / TIMESTEP)):
        mujoco.mj_step(model, data)
    return data
