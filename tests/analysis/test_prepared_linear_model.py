"""Prepared linear models: the matrices of gauss.linearise, by another route, in every state."""

import pickle

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError
from models import families

AGREEMENT = 1e-12  # relative to the largest entry of a matrix: another order of operations
NEAR_SINGULAR = 1e-7  # of Bricard's linkage, whose redundant rows leave pivots of about the root of round-off; 2e-8 is seen
MATRICES = "ABCD"


def measured_cart():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=(-5.0, 5.0))
    scene.input("servo", "pin", effort=lambda u, t, at: 3.0 * u - 0.1 * at.rate("pin"))
    scene.output("tip", "position", "pole", at=(0.0, 0.5, 0.0))
    scene.output("felt", "accelerometer", "pole")
    return scene


def body_in_flight():
    scene = gauss.Scene("body")
    scene.body("body", mass=1.0, inertia=(1.0, 2.0, 2.5))
    scene.free("flight", "ground", "body")
    return scene


def integrating():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail")
    scene.state("error", lambda t, at: at.coordinate("pin") - 0.1 * at.rate("error"))
    return scene


SCENES = {
    "cart-pole with sensors": measured_cart,
    "four-bar": lambda: gauss.load("four_bar"),
    "slider-crank": lambda: gauss.load("slider_crank"),
    "redundant loop": lambda: gauss.load("bricard"),
    "gears": lambda: gauss.load("gear_pair"),
    "governor": lambda: families.flyball_governor(),
    "quaternion": body_in_flight,
    "state of one's own": integrating,
}


def moving(system, rng):
    start = system.initial_state()
    return system.initial_state(start.q, start.v + 0.3 * system.scale.rates * rng.normal(size=system.n_v))


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_matrices_are_those_of_linearise(name):
    system, rng = gauss.compile_scene(SCENES[name]()), np.random.default_rng(1)
    prepared, state = gauss.prepare_linear_model(system), moving(system, rng)
    load = rng.normal(size=system.n_v)
    names = [one.removesuffix(" rate") for one in prepared.states if one.endswith(" rate") or one in system.scene.states]
    model = gauss.linearise(system, state, independent=names, load=load)
    assert (prepared.states, prepared.inputs, prepared.outputs) == (model.states, model.inputs, model.outputs)
    bound = NEAR_SINGULAR if name == "redundant loop" else AGREEMENT
    for one, found in zip(MATRICES, prepared(state.q, state.v, load, state.t), strict=True):
        wanted = getattr(model, one)
        assert found.shape == wanted.shape
        assert np.abs(found - wanted).max(initial=0.0) <= bound * max(1.0, np.abs(wanted).max(initial=0.0)), one


@pytest.mark.slow
def test_a_batch_of_states_has_a_model_each():
    system, rng = gauss.compile_scene(gauss.load("four_bar")), np.random.default_rng(2)
    prepared = pickle.loads(pickle.dumps(gauss.prepare_linear_model(system)))
    states = [moving(system, rng) for _ in range(3)]
    together = prepared(np.array([one.q for one in states]), np.array([one.v for one in states]))
    for k, one in enumerate(states):
        for batch, alone in zip(together, prepared(one.q, one.v), strict=True):
            assert np.abs(batch[k] - alone).max(initial=0.0) <= AGREEMENT * max(1.0, np.abs(alone).max(initial=0.0))


def test_states_off_the_constraints_are_refused():
    prepared = gauss.prepare_linear_model(gauss.load("four_bar"))
    start = prepared.system.initial_state()
    with pytest.raises(StateError, match="does not meet the constraints"):
        prepared(start.q + np.arange(start.q.size), start.v)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: gauss.load("rolling_disk"), "rolls"),
        (lambda: gauss.load("double_pendulum_stops"), "linear model"),
        (lambda: families.stewart_platform(), "15 loop constraints are more than"),
    ],
)
def test_what_cannot_be_prepared_is_named(make, words):
    with pytest.raises(SimulationError, match=words):
        gauss.prepare_linear_model(make())
