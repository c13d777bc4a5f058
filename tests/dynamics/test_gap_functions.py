"""Gap functions: their rows and biases against central differences, for every kind of unilateral constraint."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics
from gauss.system import random_state, retract
from tests.support.contacts import POINTS, touching, two_loose_bodies

pytestmark = pytest.mark.slow

CENTRAL_DIFFERENCE = 2e-7  # h² of a step 1e-5 times third derivatives, plus rounding/h
PAIRS = [(one, "half-space") for one in ("sphere", "points", "capsule", "box")]
PAIRS += [(one, two) for one in ("sphere", "points", "capsule") for two in ("sphere", "points", "capsule")]
PAIRS += [("sphere", "box"), ("box", "sphere"), ("half-space", "box"), ("points", "box"), ("capsule", "box"), ("box", "box")]
KINDS = {
    "stop": lambda s: s.stop("S", lowest=-0.3, highest=0.4),
    "rope": lambda s: s.rope("r", "a", "slider", length=2.0, **POINTS),
    "your own": lambda s: s.one_sided("r", lambda at: at.position("a")[2] - at.position("b")[0] ** 2 - at.t),
} | {f"{one} and {two}": touching(one, two) for one, two in PAIRS}


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_gaps_are_their_derivatives(kind):
    scene = two_loose_bodies()
    KINDS[kind](scene)
    system = gauss.compile_scene(scene)
    rng = np.random.default_rng(1)
    state, rate, h = random_state(system, rng), rng.standard_normal(system.n_v), 1e-5

    def moved(s):  # with constant accelerations of the coordinates
        theta = s * state.v + 0.5 * s * s * rate
        return gaps(kinematics(system, replace(state, t=s, q=retract(system, state.q, theta), v=state.v + s * rate)))

    here, before, after = moved(0.0), moved(-h), moved(h)
    assert here.rate == pytest.approx(
        (after.width - before.width) / (2 * h), abs=CENTRAL_DIFFERENCE * np.abs(here.rate).max()
    )
    motion = kinematics(system, replace(state, t=0.0))
    one, two = (
        kinematics(system, replace(state, q=retract(system, state.q, s * state.v), v=state.v + s * rate)) for s in (-h, h)
    )
    a = (two.quasi_velocities() - one.quasi_velocities()) / (2 * h)
    assert motion.state.v is not None and here.J.shape == (len(here.width), a.size + rate.size)
    acceleration = here.J @ np.concatenate([a, rate]) - here.D
    assert acceleration == pytest.approx((after.rate - before.rate) / (2 * h), abs=CENTRAL_DIFFERENCE * 100)
