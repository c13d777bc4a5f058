"""Contests of integration: RK4 steps of one trajectory and of many, beside MuJoCo."""

import mujoco
import numpy as np
import pinocchio as pin
from mujoco import rollout

import gauss
from benchmarks.speed.arms import Arm, in_mujoco
from gauss.bench.contest import OURS, Competitor, Contest, Goal, difference
from gauss.system import random_state

MUJOCO, MUJOCO_BATCH = "mujoco.mj_step, RK4", "mujoco.rollout, RK4"
STEP = 1e-3  # s
COMPARED = 100  # steps after which trajectories are compared
PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS


def single(arm: Arm, goal: float, steps: int = 10_000) -> Contest:
    """RK4 steps of one trajectory, the loop in machine code; a whole call each."""
    system, model = arm.system, in_mujoco(arm, STEP)
    start = random_state(system, np.random.default_rng(0))
    data = mujoco.MjData(model)

    def ours(count: int):
        run = {"integrator": "rk4", "step": STEP, "state": start, "progress": False}
        return gauss.simulate(system, count * STEP, times=[count * STEP], **run)

    def theirs(count: int):
        data.time, data.qpos, data.qvel = 0.0, start.q, start.v
        mujoco.mj_step(model, data, nstep=count)

    reached = ours(COMPARED)
    theirs(COMPARED)
    expected = rk4(arm, start.q, start.v, COMPARED)
    agreement = difference(np.concatenate([reached.q[-1], reached.v[-1]]), expected)
    off = difference(np.concatenate([data.qpos, data.qvel]), expected)
    tasks = {OURS: Competitor(lambda: ours(steps), steps, False), MUJOCO: Competitor(lambda: theirs(steps), steps, False)}
    remarks = f"{steps} steps of {STEP:g} s in one call, with the checks of gauss; {_compared(off)}"
    return Contest(f"RK4 step, one trajectory, {arm.name}", tasks, (Goal(MUJOCO, goal),), agreement, remarks)


def batch(arm: Arm, goal: float, count: int = 1024, steps: int = 50) -> Contest:
    """RK4 steps of many trajectories, all states kept."""
    system, model = arm.system, in_mujoco(arm, STEP)
    rng = np.random.default_rng(0)
    starts = [random_state(system, rng) for _ in range(count)]
    q0, v0 = np.array([s.q for s in starts]), np.array([s.v for s in starts])
    data = mujoco.MjData(model)
    states = np.concatenate([np.zeros((count, 1)), q0, v0], axis=1)
    kept = np.empty((count, steps, mujoco.mj_stateSize(model, PHYSICS)))
    nothing = np.empty((count, steps, model.nsensordata))

    def ours():
        return gauss.rollout(system, q0, v0, steps=steps, step=STEP, integrator="rk4")

    def theirs():
        rollout.rollout(model, data, states, nstep=steps, state=kept, sensordata=nothing)

    reached = ours()
    theirs()
    expected = rk4(arm, q0[0], v0[0], steps)
    agreement = difference(np.concatenate([reached.q[0, -1], reached.v[0, -1]]), expected)
    tasks = {OURS: Competitor(ours, count * steps, False), MUJOCO_BATCH: Competitor(theirs, count * steps, False)}
    remarks = f"{steps} steps of {STEP:g} s, all states kept; {_compared(difference(kept[0, -1, 1:], expected))}"
    return Contest(f"RK4 step, batch of {count}, {arm.name}", tasks, (Goal(MUJOCO_BATCH, goal),), agreement, remarks)


def rk4(arm: Arm, q, v, steps: int) -> np.ndarray:
    """The same steps with Pinocchio's accelerations: what both are compared with."""
    model, data, none, y, h = arm.model, arm.model.createData(), np.zeros(arm.model.nv), np.concatenate([q, v]), STEP

    def rate(y):
        here, velocity = np.split(y, 2)
        return np.concatenate([velocity, pin.aba(model, data, here, velocity, none)])

    for _ in range(steps):
        k1 = rate(y)
        k2 = rate(y + h / 2 * k1)
        k3 = rate(y + h / 2 * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3))
    return y


def _compared(difference: float) -> str:
    return f"MuJoCo differs from Pinocchio by {difference:.0e}"
