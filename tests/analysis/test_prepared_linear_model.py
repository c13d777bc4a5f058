"""Prepared linear models: the matrices of gauss.linearise, by another route, in every state."""

import pickle

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError
from gauss.system import retract
from models import families

pytestmark = pytest.mark.slow

AGREEMENT = 1e-12  # relative to the largest entry of a matrix: another order of operations
STEP, DIFFERENCES = 1e-5, 1e-6  # of central differences, and what they leave
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


def clocked():
    scene = gauss.load("pendulum")
    scene.drive("A", torque=lambda t: float(t))
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
    "many loops": lambda: families.stewart_platform(),
}


def moving(system, rng):
    start = system.initial_state()
    return system.initial_state(start.q, start.v + 0.3 * system.scale.rates * rng.normal(size=system.n_v))


@pytest.mark.parametrize("name", SCENES)
def test_matrices_are_those_of_linearise(name):
    system, rng = gauss.compile_scene(SCENES[name]()), np.random.default_rng(1)
    prepared, state = gauss.prepare_linear_model(system), moving(system, rng)
    load = rng.normal(size=system.n_v)
    names = [one.removesuffix(" rate") for one in prepared.states if one.endswith(" rate") or one in system.scene.states]
    model = gauss.linearise(system, state, independent=names, load=load)
    assert (prepared.states, prepared.inputs, prepared.outputs) == (model.states, model.inputs, model.outputs)
    for one, found in zip(MATRICES, prepared(state.q, state.v, load, state.t), strict=True):
        wanted = getattr(model, one)
        assert found.shape == wanted.shape
        assert np.abs(found - wanted).max(initial=0.0) <= AGREEMENT * max(1.0, np.abs(wanted).max(initial=0.0)), one


def test_a_batch_of_states_has_a_model_each():
    system, rng = gauss.compile_scene(gauss.load("four_bar")), np.random.default_rng(2)
    prepared = pickle.loads(pickle.dumps(gauss.prepare_linear_model(system)))
    states = [moving(system, rng) for _ in range(3)]
    together = prepared(np.array([one.q for one in states]), np.array([one.v for one in states]))
    for k, one in enumerate(states):
        for batch, alone in zip(together, prepared(one.q, one.v), strict=True):
            assert np.abs(batch[k] - alone).max(initial=0.0) <= AGREEMENT * max(1.0, np.abs(alone).max(initial=0.0))


def test_many_loops_are_modelled_state_by_state():
    """Of a moved platform, by differences of its accelerations along the constraints: not by linearise, which it calls."""
    system, rng = gauss.compile_scene(families.stewart_platform()), np.random.default_rng(3)
    prepared, state = gauss.prepare_linear_model(system), moving(system, rng)
    assert prepared.plan.driver == "Python loop"
    names = [one.removesuffix(" rate") for one in prepared.states if one.endswith(" rate")]
    free, n = [system.coordinates.index(name) for name in names], len(names)
    A = prepared(state.q, state.v)[0]
    N = gauss.linearise(system, state, independent=names).displacements

    def accelerations(e, k):
        moved = system.projected(system.state(retract(system, state.q, e * N[:, k]), state.v))
        turned = moved.v[free] - state.v[free]
        return system.accelerations(moved)[free] - A[n:, n:] @ turned

    for k in range(n):
        slope = (accelerations(STEP, k) - accelerations(-STEP, k)) / (2.0 * STEP)
        assert slope == pytest.approx(A[n:, k], abs=DIFFERENCES * np.abs(A).max())


@pytest.mark.parametrize(
    "make", [lambda: gauss.load("four_bar"), pytest.param(families.stewart_platform, marks=pytest.mark.slow)]
)
def test_states_off_the_constraints_are_refused(make):
    prepared = gauss.prepare_linear_model(make())
    start = prepared.system.initial_state()
    q = start.q.copy()
    q[prepared.system.joint(prepared.model.states[0]).q.start] += 1.0
    with pytest.raises(StateError, match="does not meet the constraints"):
        prepared(q, start.v)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: gauss.load("rolling_disk"), "rolls"),
        (lambda: gauss.load("double_pendulum_stops"), "linear model"),
        (lambda: clocked(), "cannot be prepared: .* law"),
    ],
)
def test_what_cannot_be_prepared_is_named(make, words):
    with pytest.raises(SimulationError, match=words):
        gauss.prepare_linear_model(make())
