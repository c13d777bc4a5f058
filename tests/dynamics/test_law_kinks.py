"""A law with a kink or a jump in a state leaves the accelerations without derivatives; beside it they are."""

import numpy as np
import pytest

import gauss
from gauss.analysis.derivatives import derivatives
from gauss.errors import SimulationError

pytestmark = pytest.mark.slow

CLOSE = 1e-9  # relative, of derivatives of simple laws

# law of (x, v), start (x, v), and its derivatives there; None where it has none
LAWS = {
    "sign at rest": (lambda x, v: -gauss.math.sign(v), (0.0, 0.0), None),
    "sign in motion": (lambda x, v: -gauss.math.sign(v) - v, (0.0, 1.0), (0.0, -1.0)),
    "clip at its limit": (lambda x, v: gauss.math.clip(v, -1.0, 0.0), (0.0, 0.0), None),
    "clip within": (lambda x, v: gauss.math.clip(-3.0 * x, -1.0, 1.0), (0.0, 0.0), (-3.0, 0.0)),
    "one-sided spring as it touches": (lambda x, v: -5.0 * gauss.math.maximum(x - 0.5, 0.0), (0.5, 0.0), None),
    "one-sided spring beside": (lambda x, v: -5.0 * gauss.math.maximum(x - 0.5, 0.0), (0.6, 0.0), (-5.0, 0.0)),
    "modulus": (lambda x, v: abs(x), (0.0, 0.0), None),
    "quadratic drag at rest": (lambda x, v: -2.0 * v * abs(v) - v, (0.0, 0.0), (0.0, -1.0)),
    "Hertz as it touches": (lambda x, v: -5.0 * gauss.math.maximum(x, 0.0) ** 2, (0.0, 0.0), (0.0, 0.0)),
    "dead zone within": (lambda x, v: gauss.math.where(abs(x) < 0.1, 0.0, x), (0.0, 0.0), (0.0, 0.0)),
    "steps of a stair": (lambda x, v: gauss.math.floor(x), (1.0, 0.0), None),
    "steps beside": (lambda x, v: gauss.math.floor(x) - x, (1.5, 0.0), (-1.0, 0.0)),
}


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_are_those_of_the_law_or_there_are_none(name):
    law, (x, v), expected = LAWS[name]
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    scene.drive("x", force=lambda t, motion: law(motion.coordinate("x"), motion.rate("x")))
    system = gauss.compile_scene(scene)
    state = system.state([x], [v])
    if expected is None:
        with pytest.raises(SimulationError, match="'drive of x' has a kink or a jump"):
            derivatives(system, state)
    else:
        found = derivatives(system, state)
        assert np.ravel([found.q, found.v]) == pytest.approx(expected, rel=CLOSE, abs=CLOSE)
