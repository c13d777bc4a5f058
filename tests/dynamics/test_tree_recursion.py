"""Sweeps along large trees against the certified recursion, and what is said of them."""

import numpy as np
import pytest

import gauss
from gauss.codegen import Kernel
from gauss.dynamics.conditions import LARGE_TREE_BODIES, is_large, obstacles
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.tree_recursion import forward_tree_recursion, inverse_tree_recursion
from gauss.errors import SimulationError, StateError
from gauss.system import random_state
from tests.support import mechanisms

ROUNDING = 1e-12  # relative to the largest acceleration
BACKWARD = 1e-9  # of generalised forces in a chain of 60 links that whirls at random
SCENES = {
    "planar chain": lambda: gauss.load("n_pendulum", n=3),
    "chain": lambda: gauss.load("spatial_chain", n=60),
    "tree of hinges and slides": lambda: gauss.load("random_tree", n=25, kinds=("revolute", "prismatic", "fixed")),
    "tree of all kinds": lambda: gauss.load("random_tree", n=12, seed=0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_sweep_agrees_with_the_recursion_and_its_inverse(name):
    system = gauss.compile_scene(SCENES[name]())
    rng = np.random.default_rng(0)
    ground = np.concatenate([np.zeros(3), -np.array(system.scene.gravity)])
    states, efforts = [random_state(system, rng) for _ in range(9)], rng.standard_normal((9, system.n_v))
    columns = np.array([[*s.q, *s.v, *effort, *ground] for s, effort in zip(states, efforts, strict=True)]).T
    found = Kernel(forward_tree_recursion(system))(columns).T
    for state, effort, rates in zip(states, efforts, found, strict=True):
        expected = gauss.solve(gauss.assemble(system, state, effort)).qdd
        assert np.abs(rates - expected).max() <= ROUNDING * np.abs(expected).max()
    columns[system.n_q + system.n_v : -6] = found.T
    back = Kernel(inverse_tree_recursion(system), batch=False)(columns).T
    assert np.abs(back - efforts).max() <= BACKWARD * max(1.0, np.abs(found).max())


def _large():
    scene = gauss.load("n_pendulum", n=LARGE_TREE_BODIES + 10)
    scene.joint_spring("stiff", "J3", stiffness=1.0, damping=0.1)
    scene.drive("J1", torque=lambda t: 20.0 * np.sin(t))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("integrator, options", [("dop853", {}), ("rk4", {"step": 0.002})])
def test_large_trees_move_like_certified_ones(integrator, options):
    system = gauss.compile_scene(_large())
    assert is_large(system) and not obstacles(system)
    fast, slow = (
        gauss.simulate(system, 0.02, integrator=integrator, backend=backend, **options) for backend in ("auto", "recursion")
    )
    assert fast.stats.plan.dynamics == "tree recursion" and fast.stats.handed_over is None
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-10
    assert np.abs(fast.work[-1] - slow.work[-1]).max() <= 1e-10


@pytest.mark.slow
def test_a_sweep_that_loses_digits_is_replaced_in_flight():
    """At a mass ratio of 1e10 compiled accelerations are off; the motion goes on with certified ones, and says so."""
    scene, rng = mechanisms.chain([1.0] * (LARGE_TREE_BODIES + 1) + [1e10]), np.random.default_rng(2)
    for joint in scene.joints:
        scene.start(joint, rng.uniform(-1, 1), rng.uniform(-1, 1))
    fast, slow = (gauss.simulate(scene, 2e-4, integrator="rk4", step=1e-4, backend=b) for b in ("auto", "recursion"))
    assert fast.stats.handed_over is not None
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-10


def test_a_batch_of_a_large_tree_is_refused():
    with pytest.raises(SimulationError, match=f"more than {LARGE_TREE_BODIES} bodies"):
        system = gauss.compile_scene(_large())
        gauss.rollout(system, [system.reference.q], [system.reference.v], steps=1, step=1e-3)


def test_forces_are_answered_one_by_one():
    system = gauss.compile_scene(gauss.load("n_pendulum", n=LARGE_TREE_BODIES + 1))
    responses, state = ForceResponses(system), system.initial_state()
    forces = np.random.default_rng(0).standard_normal((3, system.n_v))
    free = gauss.solve(gauss.assemble(system, state)).qdd
    expected = np.array([gauss.solve(gauss.assemble(system, state, force)).qdd - free for force in forces])
    assert responses.compiled
    assert np.abs(responses.of(state, forces) - expected).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.slow
def test_a_large_tree_takes_unit_quaternions_and_numbers_only():
    system = gauss.compile_scene(gauss.load("random_tree", n=LARGE_TREE_BODIES + 1, kinds=("ball", "revolute")))
    f, state, still = system.forward_dynamics, random_state(system, np.random.default_rng(0)), np.zeros(system.n_v)
    assert is_large(system) and np.isfinite(f(state.q, state.v, still)).all()
    place = next(iter(system.quaternions.values()))
    longer = state.q.copy()
    longer[place] *= 2.0
    with pytest.raises(StateError, match="has length 2, not 1"):
        f(longer, state.v, still)
    for given in ((state.q * np.nan, state.v), (state.q, state.v * np.inf)):
        with pytest.raises(StateError, match="finite numbers"):
            f(*given, still)


@pytest.mark.slow
def test_laws_of_a_large_tree_are_called_as_they_are_now():
    strength = [1.0]
    scene = _large()
    scene.drive("J2", torque=lambda t: strength[0] * np.cos(t))
    system = gauss.compile_scene(scene)
    f, state, load = system.forward_dynamics, system.initial_state(), np.ones(system.n_v)
    for strength[0] in (1.0, -20.0):
        expected = gauss.solve(gauss.assemble(system, state, load)).qdd
        for found in (f(state.q, state.v, load, None, state.t), system.accelerations(state, load)):
            assert np.abs(found - expected).max() <= ROUNDING * np.abs(expected).max()
