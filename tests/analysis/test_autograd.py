import numpy as np
import pytest

import gauss

pytestmark = pytest.mark.slow

DIFFERENCE, ACCURACY = 1e-5, 1e-8  # central differences, relative to the largest derivative
DURATION, STEP = 0.2, 0.01


def cart():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=(-50.0, 50.0))
    return scene


def stopped():
    scene = cart()
    scene.stop("rail", highest=0.05, restitution=0.8)
    return scene


def given(system, steps, seed=3):
    rng, start = np.random.default_rng(seed), system.initial_state()
    v = start.v + 0.1 * rng.normal(size=system.n_v)
    v[0] = 1.0
    return [start.q.copy(), v, rng.normal(size=(steps, len(system.scene.inputs)))]


def numeric(function, arguments):
    """Gradients of a number by all entries of its arguments."""
    found = []
    for k, one in enumerate(arguments):
        slopes = np.zeros(one.shape)
        for place in np.ndindex(one.shape):
            ends = []
            for sign in (1.0, -1.0):
                other = [part.copy() for part in arguments]
                other[k][place] += sign * DIFFERENCE
                ends.append(function(*other))
            slopes[place] = (ends[0] - ends[1]) / (2.0 * DIFFERENCE)
        found.append(slopes)
    return found


def close(found, wanted):
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=ACCURACY * max(1.0, np.abs(other).max()))


def through_torch(function, arguments, weights):
    torch = pytest.importorskip("torch")
    tensors = [torch.tensor(one, requires_grad=True) for one in arguments]
    (function(*tensors) * torch.tensor(weights)).sum().backward()
    return [tensor.grad.numpy() for tensor in tensors]


def through_jax(function, arguments, weights):
    jax = pytest.importorskip("jax")
    loss = lambda *x: (function(*x) * weights).sum()  # noqa: E731
    return [np.array(one) for one in jax.jit(jax.grad(loss, argnums=tuple(range(len(arguments)))))(*arguments)]


ROUTES = {"torch": (through_torch, "torch"), "jax": (through_jax, "jax")}


@pytest.fixture(params=ROUTES)
def route(request):
    library = pytest.importorskip(ROUTES[request.param][1])
    if request.param == "jax":
        library.config.update("jax_enable_x64", True)
    return request.param


@pytest.mark.peer
@pytest.mark.parametrize("make", [cart, lambda: gauss.load("four_bar")], ids=["cart-pole", "four-bar"])
def test_gradients_of_accelerations(route, make):
    system, rng = gauss.compile_scene(make()), np.random.default_rng(1)
    function = getattr(gauss, f"{route}_dynamics")(system)
    arguments = [system.initial_state().q, system.initial_state().v, rng.normal(size=system.n_v)]
    weights = rng.normal(size=system.n_v)
    found = ROUTES[route][0](function, arguments, weights)
    by_q, by_v, by_load = system.acceleration_derivatives(*arguments)
    close(found, [weights @ by_q, weights @ by_v, weights @ by_load])


@pytest.mark.peer
@pytest.mark.parametrize("make", [cart, stopped], ids=["smooth", "with an impact"])
def test_gradients_of_motions_are_those_of_motion_gradient(route, make):
    """Weights of the last state alone, along its directions that keep the constraints: all, without loops."""
    system, steps = gauss.compile_scene(make()), round(DURATION / STEP)
    function = getattr(gauss, f"{route}_motion")(system, DURATION, step=STEP)
    q, v, inputs = given(system, steps)
    inputs = inputs * (make is cart)  # between events, laws of inputs are called from Python: slow
    weights = np.zeros((steps + 1, system.n_q + system.n_v))
    weights[-1] = np.random.default_rng(2).normal(size=system.n_q + system.n_v)
    by_q, by_v, by_inputs = ROUTES[route][0](function, [q, v, inputs], weights)
    loss = lambda q, v: weights[-1, : system.n_q] @ q + weights[-1, system.n_q :] @ v  # noqa: E731
    wanted = gauss.motion_gradient(system, DURATION, loss, step=STEP, state=system.state(q, v), inputs=inputs)
    close([np.concatenate([by_q, by_v]), by_inputs], [wanted.start, wanted.inputs])


@pytest.mark.peer
def test_gradients_of_whole_motions(route):
    """Weights of all states, against differences of an input and of the start."""
    system, steps = gauss.compile_scene(cart()), 5
    function = getattr(gauss, f"{route}_motion")(system, steps * STEP, step=STEP)
    arguments = given(system, steps)
    weights = np.random.default_rng(2).normal(size=(steps + 1, system.n_q + system.n_v))
    value = lambda *x: float((np.array(function(*tensors(route, *x))) * weights).sum())  # noqa: E731
    close(ROUTES[route][0](function, arguments, weights), numeric(value, arguments))


def tensors(route, *arrays):
    return [pytest.importorskip("torch").tensor(one) for one in arrays] if route == "torch" else arrays
