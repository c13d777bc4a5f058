"""Loads beside machine code, of all kinds and on scenes of all kinds, against the certified recursion."""

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.dynamics.conditions import LARGE_TREE_BODIES
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import ACCELERATIONS
from gauss.dynamics.rules import Plan, Question
from gauss.system import random_state
from tests.support import mechanisms

pytestmark = pytest.mark.slow

ROUNDING = 1e-10  # of accelerations, relative to the largest
SAME_MOTION = 1e-9  # of coordinates and work
CALLED = {("compiled loop", "compiled"): "callbacks"}  # dynamics whose machine code calls opaque laws
LARGE = LARGE_TREE_BODIES + 1
SCENES = {  # scene, and dynamics of its motions; single states of compiled loops have theirs embedded
    "four-bar": (mechanisms.four_bar, "compiled"),
    "tree of all kinds": (lambda: gauss.load("random_tree", n=8, seed=3), "compiled"),
    "large tree": (
        lambda: gauss.load("random_tree", n=LARGE, seed=1, kinds=("revolute", "prismatic", "ball")),
        "tree recursion",
    ),
    "many loops": (lambda: gauss.load("n_four_bar", n=50), "call graph"),
}


def _loaded(scene: gauss.Scene) -> gauss.Scene:
    """The scene with traced and opaque loads on bodies and coordinates, and laws of poses."""
    bodies, number = list(scene.bodies), len(scene.bodies)
    hinge = next(name for name, joint in scene.joints.items() if joint.kind == "revolute")
    middle, last = bodies[number // 2], bodies[-1]
    scene.spring("spring", last, "ground", at=(0.1, 0.0, 0.2), other_at=(3.0, 4.0, 5.0), stiffness=2.0, damping=0.1)
    scene.spring("between", middle, last, at=(0.0, 0.3, 0.1), other_at=(0.5, 0.0, 0.7), stiffness=1.0)
    scene.force("wind", middle, force=lambda t: (math.sin(t), 0.2, 0.0), at=(0.2, 0.1, 0.0))
    scene.force("jet", last, force=lambda t: (np.cos(float(t)), 0.0, 0.3), moment=(0.1, 0.2, 0.0), axes="body")
    slowed = lambda t, at: -0.1 * np.asarray(at.velocity(middle), dtype=float)  # noqa: E731
    scene.force("gust", middle, force=slowed, moment=lambda t: [0.0, 0.1 + float(t), 0.2], at=(0.1, 0.0, 0.3))
    scene.drive(hinge, torque=lambda t, at: 0.3 * float(at.position(last)[0]) - 0.1 * float(at.velocity(last)[1]))
    return scene


@pytest.fixture(scope="module", params=SCENES)
def case(request):
    make, dynamics = SCENES[request.param]
    return gauss.compile_scene(_loaded(make())), dynamics


def test_loads_beside_machine_code_have_the_accelerations_of_the_certified_recursion(case):
    system, dynamics = case
    of_states = "embedded loops" if system.has_closures and dynamics == "compiled" else dynamics
    assert ACCELERATIONS.plan(Question(system, Laws(system, trace=False))).dynamics == of_states
    state, rng = system.initial_state(), np.random.default_rng(0)
    states = [state] if system.has_closures else [state, random_state(system, rng)]
    for one in states:
        expected = gauss.solve(gauss.assemble(system, one)).qdd
        assert np.abs(system.accelerations(one) - expected).max() <= ROUNDING * np.abs(expected).max()


@pytest.mark.parametrize("driver", ["compiled loop", "Python loop"])
def test_a_motion_under_loads_beside_machine_code_is_the_certified_one(case, driver):
    system, dynamics = case
    dynamics = CALLED.get((driver, dynamics), dynamics)
    if dynamics == "call graph":
        pytest.skip("the certified motion takes minutes; single states are compared above")
    run = {"integrator": "rk4", "step": 5e-4, "progress": False}
    asked = {"plan": Plan(driver, dynamics)}, {"backend": "recursion"}
    fast, slow = (gauss.simulate(system, 1e-3, **how, **run) for how in asked)
    assert fast.stats.plan.driver == driver and fast.stats.plan.dynamics == dynamics and fast.stats.handed_over is None
    for name in ("q", "v", "work"):
        found, expected = getattr(fast, name)[-1], getattr(slow, name)[-1]
        assert np.abs(found - expected).max() <= SAME_MOTION * max(1.0, np.abs(expected).max())
