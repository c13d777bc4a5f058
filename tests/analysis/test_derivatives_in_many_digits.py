"""Derivatives against central differences in 50 digits: forward dynamics as an operation graph, evaluated by mpmath.

Rounding plays no part, so that a step of 1e-15 leaves a truncation of 1e-30. With loops both are taken along changes that
stay on the constraints to first order, K δq = 0 and K δv + (∂K/∂q δq) v = 0.
"""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.system import random_state
from tests.support import mechanisms
from tests.support.many_digits import InManyDigits, along, tangent

pytestmark = pytest.mark.slow

EXACT = 1e-11  # relative to the largest entry: rounding of the derivatives in double precision, times the condition of M
WIDE_STEP = 2.0**-8  # relative, of parameters: scenes hold doubles, whose rounding is divided by it


def sprung() -> gauss.Scene:
    scene = mechanisms.chain([1.0, 2.0, 0.5])
    scene.spring("rope", next(iter(scene.bodies)), "ground", other_at=(1, 1, 1), stiffness=30.0, damping=2.0)
    return scene


TREES = {
    "springs": sprung,
    "panda": lambda: gauss.load("robot:panda", mimic=False),
    "two kinds": lambda: gauss.load("random_tree", n=4, seed=3, kinds=("revolute", "prismatic")),
}
LOOPS = {
    "four-bar": lambda: gauss.load("four_bar"),
    "slider-crank": lambda: gauss.load("slider_crank"),
    "ladder": lambda: gauss.load("n_four_bar", n=2),
    "Cardan shaft": lambda: gauss.load("cardan"),
}


@pytest.mark.parametrize("name", TREES | LOOPS)
def test_changes_of_state_and_load(name):
    system, rng = gauss.compile_scene((TREES | LOOPS)[name]()), np.random.default_rng(5)
    state = random_state(system, rng)
    if system.has_closures:
        start = system.initial_state()
        state = system.initial_state(start.q, start.v + rng.standard_normal(system.n_v))
    load, function = rng.standard_normal(system.n_v), InManyDigits(system, "forward_dynamics")
    slopes = [np.array(one) for one in system.acceleration_derivatives(state.q, state.v, load)]
    found = gauss.derivatives(system, state, load)
    for _ in range(3):
        changes = tangent(system, state, rng)
        expected = along(function, state, load, changes)
        scale = max(np.abs(one).max() * np.abs(d).max() for one, d in zip(slopes, changes, strict=True))
        for three in (slopes, (found.q, found.v, found.load)):
            mine = sum(one @ d for one, d in zip(three, changes, strict=True))
            assert np.abs(mine - expected).max() <= EXACT * scale


def with_mass(scene: gauss.Scene, body: str, factor: float) -> gauss.Scene:
    """Scene whose body has another mass, and the same inertia."""
    one = scene.bodies[body]
    return replace(scene, bodies={**scene.bodies, body: replace(one, mass=one.mass * factor)})


@pytest.mark.parametrize("name", ["panda", "two kinds", "four-bar", "slider-crank"])
def test_changes_of_a_mass(name):
    """Richardson's extrapolation of three central differences: their error is of the sixth order."""
    scene, rng = (TREES | LOOPS)[name](), np.random.default_rng(6)
    system, body = gauss.compile_scene(scene), list(scene.bodies)[-1]
    state = random_state(system, rng) if not system.has_closures else system.initial_state()
    load = rng.standard_normal(system.n_v)

    def difference(h: float) -> np.ndarray:
        ends = [
            InManyDigits(gauss.compile_scene(with_mass(scene, body, 1.0 + sign * h)), "forward_dynamics") for sign in (1, -1)
        ]
        plus, minus = (np.array(end(state.q, state.v, load)[0], dtype=float) for end in ends)
        return (plus - minus) / (2.0 * h * scene.bodies[body].mass)

    first, second, third = (difference(WIDE_STEP / 2**k) for k in range(3))
    one, two = (4.0 * second - first) / 3.0, (4.0 * third - second) / 3.0
    expected = (16.0 * two - one) / 15.0
    found = np.ravel(system.parameter_derivatives(f"mass:{body}")(state.q, state.v, load))
    assert np.abs(found - expected).max() <= 1e-9 * max(np.abs(expected).max(), 1e-3)
