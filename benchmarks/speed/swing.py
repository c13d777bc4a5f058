"""Contest of a free swing to a given drift of energy: each takes the loosest setting that meets it."""

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import gauss
from benchmarks.speed.arms import Arm, energy, in_mujoco
from gauss.bench.contest import OURS, Competitor, Contest, Goal
from gauss.system import random_state

SCIPY, MUJOCO = "pin.aba + SciPy DOP853", "MuJoCo RK4"
DURATION = 5.0  # s
DRIFT = 1e-11  # J
TOLERANCES = np.geomspace(1e-9, 1e-14, 26)
STEPS = 1.0 / np.arange(10_000, 80_001, 5_000)  # s
ATTEMPTS = 2  # last settings in a row that must meet the drift: one alone may do so by luck


def free_swing(arm: Arm, scipy_goal: float, mujoco_goal: float) -> Contest:
    """5 s from a random posture at rest, without drives."""
    system, model = arm.system, arm.model
    q0 = random_state(system, np.random.default_rng(0)).q
    start, none = system.state(q0), np.zeros(system.n_v)
    data = model.createData()
    before = energy(arm, q0, none)

    def ours(tolerance):
        run = {"rtol": tolerance, "atol": tolerance, "state": start, "progress": False}
        motion = gauss.simulate(system, DURATION, times=[DURATION], **run)
        return motion.q[-1], motion.v[-1]

    def rate(t, y):
        return np.concatenate([y[7:], pin.aba(model, data, y[:7], y[7:], none)])

    def scipys(tolerance):
        y0 = np.concatenate([q0, none])
        run = {"method": "DOP853", "t_eval": [DURATION], "rtol": max(tolerance, 2.3e-14), "atol": tolerance}
        return np.split(solve_ivp(rate, (0.0, DURATION), y0, **run).y[:, -1], 2)

    def mujocos(step):
        twin = in_mujoco(arm, step)
        there = mujoco.MjData(twin)
        there.qpos, there.qvel = q0, none
        mujoco.mj_step(twin, there, nstep=round(DURATION / step))
        return np.array(there.qpos), np.array(there.qvel)

    drift = lambda reached: abs(energy(arm, *reached) - before)  # noqa: E731
    tasks, found = {}, []
    for name, run, settings in ((OURS, ours, TOLERANCES), (SCIPY, scipys, TOLERANCES), (MUJOCO, mujocos, STEPS)):
        setting, reached = _loosest(lambda x, run=run: drift(run(x)), settings)
        tasks[name] = Competitor(lambda run=run, setting=setting: run(setting), is_short=False)
        found.append(f"{name}: {'step' if name == MUJOCO else 'tolerance'} {setting:.1e}, drift {reached:.1e} J")
    goals = (Goal(SCIPY, scipy_goal), Goal(MUJOCO, mujoco_goal))
    work = f"{DURATION:g} s free swing to an energy drift of {DRIFT:g} J, {arm.name}"
    return Contest(work, tasks, goals, _agreement(arm, q0), f"energy {before:.4g} J; " + "; ".join(found))


def _loosest(drift, settings) -> tuple[float, float]:
    """First setting that meets the drift together with the next one."""
    drifts = []
    for setting in settings:
        drifts.append(drift(setting))
        if len(drifts) >= ATTEMPTS and max(drifts[-ATTEMPTS:]) <= DRIFT:
            return float(settings[len(drifts) - ATTEMPTS]), drifts[-ATTEMPTS]
    best = int(np.argmin(drifts))
    return float(settings[best]), drifts[best]


def _agreement(arm: Arm, q0) -> float:
    """Motions of gauss and of Pinocchio with SciPy after 0.1 s; after 5 s no two agree, the motion is chaotic."""
    model, data, none, span = arm.model, arm.model.createData(), np.zeros(arm.model.nv), 0.1
    rate = lambda t, y: np.concatenate([y[7:], pin.aba(model, data, y[:7], y[7:], none)])  # noqa: E731
    y0 = np.concatenate([q0, none])
    theirs = solve_ivp(rate, (0.0, span), y0, method="DOP853", rtol=2.3e-14, atol=1e-14).y[:, -1]
    run: dict[str, Any] = {"rtol": 1e-14, "atol": 1e-14, "state": arm.system.state(q0), "progress": False}
    ours = gauss.simulate(arm.system, span, times=[span], **run)
    return float(np.abs(np.concatenate([ours.q[-1], ours.v[-1]]) - theirs).max() / np.abs(theirs).max())
