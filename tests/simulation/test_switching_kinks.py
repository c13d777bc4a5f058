"""A kink of a law on the state is resolved to the tolerance wherever it lies in a step, in every motion of a batch.

The bilinear oscillator x¨ = −x − 3 max(x, 0) has half periods π and π/2. A single motion may be right by luck, as an error
estimate misses a kink at few places of a step only: here the kinks of some hundred motions lie at random places.
"""

import math

import numpy as np
import pytest

import gauss
from gauss import math as gm
from tests.support.switching import slider

pytestmark = pytest.mark.slow

STARTS = 300
DURATION = 14.0  # three periods: six kinks in each motion
STIFFER = 2.0  # angular frequency at x > 0, of x¨ = −x − 3 max(x, 0)
GLOBAL = 60.0  # error at the end over the tolerance of a step: a hundred steps and more, each with its share
SINGLE = {"dop853": 20, "radau5": 8, "recursion": 1}  # motions made one at a time, the last by the certified engine


def oscillator():
    return slider(lambda t, motion: -motion.coordinate("x") - (STIFFER**2 - 1.0) * gm.maximum(motion.coordinate("x"), 0.0))


def exact(x, v, t):
    """Coordinate and rate after a time, from one passage through x = 0 to the next."""
    while True:
        w = STIFFER if x > 0.0 or (x == 0.0 and v > 0.0) else 1.0
        phase = math.atan2(w * x, v)  # x = A sin(phase) / w, v = A cos(phase)
        size, left = math.hypot(w * x, v), (-phase if phase < 0.0 else math.pi - phase) / w
        if left >= t:
            return size * math.sin(phase + w * t) / w, size * math.cos(phase + w * t)
        t, x, v = (t - left, 0.0, size) if phase < 0.0 else (t - left, -0.0, -size)  # -0.0: the phase is -pi


def starts(count):
    angles = np.random.default_rng(7).uniform(0.0, 2.0 * math.pi, count)
    return np.cos(angles)[:, None], np.sin(angles)[:, None]


@pytest.mark.parametrize("rtol", (1e-6, 1e-8, 1e-10))
@pytest.mark.parametrize("method", ("dop853", "dopri5"))
def test_every_motion_of_a_batch_resolves_its_kinks(method, rtol):
    q, v = starts(STARTS)
    found = gauss.rollout(gauss.compile_scene(oscillator()), q, v, integrator=method, times=[DURATION], rtol=rtol, atol=rtol)
    ends = np.array([exact(float(x), float(u), DURATION) for x, u in zip(q[:, 0], v[:, 0], strict=True)])
    assert np.abs(np.hstack([found.q[:, -1], found.v[:, -1]]) - ends).max() <= GLOBAL * rtol


@pytest.mark.parametrize("rtol", (1e-6, 1e-8))
@pytest.mark.parametrize("which", SINGLE)
def test_single_motions_resolve_their_kinks(which, rtol):
    system, chosen = gauss.compile_scene(oscillator()), {"backend" if which == "recursion" else "integrator": which}
    for x, v in np.hstack(starts(SINGLE[which])):
        start = system.state([x], [v])
        motion = gauss.simulate(system, DURATION, state=start, rtol=rtol, atol=rtol, progress=False, **chosen)
        assert np.abs(np.array(exact(x, v, DURATION)) - [motion.q[-1, 0], motion.v[-1, 0]]).max() <= GLOBAL * rtol
