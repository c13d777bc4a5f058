"""Derivatives of accelerations against central differences, against Pinocchio, and along motions of loops."""

import numpy as np
import pinocchio as pin
import pytest

import gauss
from gauss.analysis.crosscheck import random_states
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.analysis.derivatives import derivatives
from gauss.dynamics.conditions import LARGE_TREE_BODIES
from gauss.errors import SimulationError
from gauss.system import State, random_state, retract
from tests.support import mechanisms
from tests.support.welded import Welded

CENTRAL_DIFFERENCE = 1e-7  # relative to the largest entry: h² of a step 1e-5 times third derivatives, plus rounding/h
PINOCCHIO = 1e-10  # relative to the largest entry


def _springs():
    scene = mechanisms.chain([1.0, 2.0, 0.5])
    scene.spring("rope", next(iter(scene.bodies)), "ground", other_at=(1, 1, 1), stiffness=30.0, damping=2.0)
    scene.drive(next(iter(scene.joints)), torque=lambda t, motion: -0.3 * motion.rate(next(iter(scene.joints))))
    return scene


TREES = {
    "chain with springs and a law": _springs,
    "ball and universal joints": lambda: gauss.load("random_tree", n=3, seed=3, kinds=("ball", "universal")),
    "tree of all kinds": lambda: gauss.load("random_tree", n=4, seed=1),
    "panda": lambda: gauss.load("robot:panda", mimic=False),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES)
def test_open_chains_against_central_differences(name):
    system, rng = gauss.compile_scene(TREES[name]()), np.random.default_rng(0)
    state, load, h = random_state(system, rng), rng.standard_normal(system.n_v), 1e-5
    found = derivatives(system, state, load)
    rates = lambda q, v, load: gauss.solve(gauss.assemble(system, State(0.0, q, v), load)).qdd  # noqa: E731
    units = h * np.eye(system.n_v)
    cases = {
        "q": lambda u: rates(retract(system, state.q, u), state.v, load),
        "v": lambda u: rates(state.q, state.v + u, load),
        "load": lambda u: rates(state.q, state.v, load + u),
    }
    for which, at in cases.items():
        expected = np.array([at(u) - at(-u) for u in units]).T / (2 * h)
        assert np.abs(getattr(found, which) - expected).max() <= CENTRAL_DIFFERENCE * max(1.0, np.abs(expected).max()), which


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", ["panda", "ur5", "talos_left_arm"])
def test_robots_against_pinocchio(name):
    scene = gauss.load(f"robot:{name}", **({"mimic": False} if name == "panda" else {}))
    system, model = gauss.compile_scene(scene), twin(gauss.compile_scene(scene)).model
    state, load = random_state(system, np.random.default_rng(1)), np.random.default_rng(2).standard_normal(system.n_v)
    found = derivatives(system, state, load)
    data = model.createData()  # what is returned lies in its memory
    expected = pin.computeABADerivatives(model, data, state.q, state.v, load)
    for one, two in zip((found.q, found.v, found.load), expected, strict=True):
        assert np.abs(one - two).max() <= PINOCCHIO * np.abs(two).max()


LOOPS = {
    "four-bar": mechanisms.four_bar,
    "Cardan shaft": lambda: gauss.load("cardan"),
    "slider-crank": lambda: gauss.load("slider_crank"),
    "gear pair": lambda: gauss.load("gear_pair"),
    "Bricard": lambda: gauss.load("bricard"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_loops_change_their_accelerations_along_a_motion_as_derivatives_say(name):
    """d/dt q̈(q, q̇) = ∂q̈/∂q q̇ + ∂q̈/∂q̇ v̇ along a motion under other forces v̇ = q̈(q, q̇, τ), which keeps the constraints."""
    system, rng = gauss.compile_scene(LOOPS[name]()), np.random.default_rng(0)
    start, h = system.initial_state(), 1e-5
    state = system.initial_state(start.q, start.v + rng.standard_normal(system.n_v))
    load = 5.0 * rng.standard_normal(system.n_v)
    found = derivatives(system, state)
    moving = gauss.solve(gauss.assemble(system, state, load)).qdd

    def at(h):
        q = retract(system, state.q, h * state.v + h * h / 2 * moving)
        nearby = system.initial_state(q, state.v + h * moving)  # off by h³ and h², put back on the constraints
        return gauss.solve(gauss.assemble(system, nearby)).qdd

    expected = (at(h) - at(-h)) / (2 * h)
    change = found.q @ state.v + found.v @ moving
    assert np.abs(change - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max())  # h², and rounding over h
    units = np.eye(system.n_v)
    loaded = [
        gauss.solve(gauss.assemble(system, state, u)).qdd - gauss.solve(gauss.assemble(system, state)).qdd for u in units
    ]
    assert np.abs(found.load - np.array(loaded).T).max() <= 1e-9 * np.abs(loaded).max()


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("scene", [mechanisms.four_bar, lambda: gauss.load("n_four_bar", n=3)], ids=["four-bar", "ladder"])
def test_loops_against_pinocchio(scene):
    """Redundant rows it meets with a regularisation that its derivatives feel, ball joints in several loops not at all."""
    model = Welded(scene())
    for state in random_states(model.system, 5, seed=1):
        found, (by_q, by_v, by_load) = derivatives(model.system, state), model.derivatives(state)
        acceleration = model.system.accelerations(state)
        ours, theirs = (a @ state.v + b @ acceleration for a, b in ((found.q, found.v), (by_q, by_v)))  # along the motion
        assert np.abs(ours - theirs).max() <= PINOCCHIO * np.abs(theirs).max()
        assert np.abs(found.load - by_load).max() <= PINOCCHIO * np.abs(by_load).max()


def test_what_cannot_be_differentiated_says_why():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 1.0 else 0.0)
    system = gauss.compile_scene(scene)
    with pytest.raises(SimulationError, match="cannot be traced"):
        derivatives(system, system.initial_state())
    system = gauss.compile_scene(mechanisms.rods(LARGE_TREE_BODIES + 1))
    with pytest.raises(SimulationError, match=f"more than {LARGE_TREE_BODIES} bodies"):
        derivatives(system, system.initial_state())
