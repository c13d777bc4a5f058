"""Contest of many motions with steps of their own: DOP853 in lanes, beside the same motions one after the other."""

from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import gauss
from benchmarks.speed.arms import Arm
from gauss.bench.contest import OURS, Competitor, Contest, Goal, difference
from gauss.system import random_state

ALONE, SCIPY = "gauss.simulate, one by one", "pin.aba + SciPy DOP853"
DURATION, TOLERANCE = 1.0, 1e-10  # s, both of rtol and atol
FEW, FEWEST = 16, 2  # motions that the others make in a round
COMPARED, FINEST = 0.1, 2.3e-14  # s, and the tolerance with which results are compared


def own_steps(arm: Arm, alone_goal: float, scipy_goal: float, count: int = 512) -> Contest:
    """Free swings from random postures to one tolerance, the last state of each; per motion."""
    system, model = arm.system, arm.model
    rng, none, data = np.random.default_rng(0), np.zeros(arm.system.n_v), arm.model.createData()
    starts = [random_state(system, rng) for _ in range(count)]
    q0, v0 = np.array([s.q for s in starts]), np.array([s.v for s in starts])

    def ours(duration=DURATION, tolerance=TOLERANCE):
        run: dict[str, Any] = {"integrator": "dop853", "times": [duration], "rtol": tolerance, "atol": tolerance}
        return gauss.rollout(system, q0, v0, **run)

    def alone():
        for start in starts[:FEW]:
            run: dict[str, Any] = {"times": [DURATION], "rtol": TOLERANCE, "atol": TOLERANCE, "progress": False}
            gauss.simulate(system, DURATION, state=start, **run)

    def rate(t, y):
        q, v = np.split(y, 2)
        return np.concatenate([v, pin.aba(model, data, q, v, none)])

    def theirs(start, duration=DURATION, tolerance=TOLERANCE):
        run = {"method": "DOP853", "t_eval": [duration], "rtol": tolerance, "atol": tolerance}
        return solve_ivp(rate, (0.0, duration), np.concatenate([start.q, start.v]), **run).y[:, -1]

    alone()  # compiled once
    made, early = ours(), ours(COMPARED, FINEST)
    agreement = difference(np.concatenate([early.q[0, -1], early.v[0, -1]]), theirs(starts[0], COMPARED, FINEST))
    tasks = {
        OURS: Competitor(ours, count, False),
        ALONE: Competitor(alone, FEW, False),
        SCIPY: Competitor(lambda: [theirs(start) for start in starts[:FEWEST]], FEWEST, False),
    }
    tried = np.median(made.steps + made.rejected)
    remarks = f"rtol = atol = {TOLERANCE:g}, about {tried:.0f} steps tried; compared after {COMPARED:g} s with {FINEST:g}"
    work = f"{DURATION:g} s by DOP853, steps of each motion its own, batch of {count}, {arm.name}"
    return Contest(work, tasks, (Goal(ALONE, alone_goal), Goal(SCIPY, scipy_goal)), agreement, remarks)
