"""iLQR against Riccati's recursion, the adjoint gradient of another route, collocation, and the laws of its limits."""

import numpy as np
import pytest

import gauss
from gauss.analysis.optimal.box_qp import box_minimum
from gauss.errors import ArgumentError, GaussError, SimulationError

ROUNDING = 1e-9
STATIONARY = 1e-4  # change of an input, as a share of its range, at a relative reduction of the cost of 1e-9
HELD = 5e-3  # relative difference of costs: inputs held for 20 ms against inputs that are linear in time


def cart(limit=None):
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.prismatic("rail", "ground", scene.body("cart", 2.0, (0.1, 0.1, 0.1)), axis=(1, 0, 0))
    scene.start("rail", 1.0, 0.5)
    scene.input("push", "rail", limits=limit)
    return scene


def quadratic(t, q, v, u):
    return 3.0 * q[0] ** 2 + 0.5 * v[0] ** 2 + 0.1 * u @ u


def test_a_linear_problem_is_the_recursion_of_riccati():
    h, n = 0.1, 25
    motion = gauss.ilqr(cart(), n * h, step=h, cost=quadratic, final=lambda q, v: 20.0 * (q @ q) + v @ v)
    A, B = np.array([[1.0, h], [0.0, 1.0]]), np.array([[h * h / 4.0], [h / 2.0]])
    Q, R, W = 2 * h * np.diag([3.0, 0.5]), 2 * h * np.array([[0.1]]), np.diag([40.0, 2.0])
    gains = []
    for _ in range(n):
        gains.append(-np.linalg.solve(R + B.T @ W @ B, B.T @ W @ A))
        W = Q + A.T @ W @ A + A.T @ W @ B @ gains[-1]
    np.testing.assert_allclose(motion.gains, gains[::-1], atol=ROUNDING * np.abs(gains).max())
    x = np.array([1.0, 0.5])
    assert abs(motion.cost - x @ W @ x / 2.0) <= 1e-8 * motion.cost
    assert motion.iterations <= 3 and motion.gradient <= STATIONARY


@pytest.mark.slow
@pytest.mark.parametrize("limit", [None, 4.0])
def test_the_gradient_vanishes_but_at_limits(limit):
    scene = gauss.load("cart_pole")
    scene.start("pin", 0.3)
    scene.input("push", "rail", limits=limit)
    final, weight, h = (lambda q, v: 20.0 * (q @ q) + 5.0 * (v @ v)), 0.02, 0.02
    cost, second = (lambda t, q, v, u: weight * u @ u), {"second_order": True, "tolerance": 1e-13}
    motion = gauss.ilqr(scene, 0.8, step=h, cost=cost, final=final, **second)
    free = gauss.load("cart_pole")
    free.start("pin", 0.3)
    free.input("push", "rail")
    slope = gauss.motion_gradient(free, 0.8, final, step=h, inputs=motion.u).inputs + 2 * h * weight * motion.u
    size = 2 * h * weight * np.abs(motion.u).max()
    inside = np.abs(motion.u) < (np.inf if limit is None else limit)
    assert np.abs(slope[inside]).max() <= STATIONARY * size
    assert (slope[~inside] * motion.u[~inside] <= 0.0).all()  # more is wanted than the limits allow
    assert inside.all() == (limit is None)


@pytest.mark.slow
def test_a_linkage_as_by_collocation():
    pytest.importorskip("casadi")
    bar = gauss.load("four_bar")
    bar.starts.clear()
    bar.input("motor", "A", limits=50.0)
    wanted = lambda q, v: 1e5 * ((q[0] - 3.0) ** 2 + 0.1 * v[0] ** 2)  # noqa: E731
    motion = gauss.ilqr(bar, 0.6, step=0.02, cost=lambda t, q, v, u: u @ u, final=wanted)
    rest = {"A": 0.0, "A rate": 0.0}
    collocated = gauss.optimal_motion(bar, 0.6, start=rest, end=rest | {"A": 3.0})
    assert abs(motion.cost - collocated.cost) <= HELD * collocated.cost
    assert abs(motion.u).max() <= 50.0
    for q in motion.q[::10]:
        assert abs(motion.system.initial_state(q, keep=["A"]).q - q).max() <= 1e-8


@pytest.mark.slow
def test_feedback_holds_against_a_disturbance():
    scene = gauss.load("cart_pole")
    scene.start("pin", 0.2)
    scene.input("push", "rail", limits=30.0)
    cost = lambda t, q, v, u: q @ q + 0.1 * (v @ v) + 0.05 * u @ u  # noqa: E731
    motion = gauss.ilqr(scene, 2.0, step=0.02, cost=cost, final=lambda q, v: 5.0 * (q @ q + v @ v), tolerance=1e-6)
    disturbed = motion.system.state(motion.q[0] + [0.05, 0.05], motion.v[0])
    settings = {"rate": 50, "state": disturbed, "integrator": "rk4", "step": 0.01}
    closed = gauss.simulate(motion.system, 2.0, control=motion.control, **settings)
    opened = gauss.simulate(motion.system, 2.0, control=lambda t, q, v: motion.control(t, *_at(motion, t)), **settings)
    left = [np.abs(found.q[-1] - motion.q[-1]).max() for found in (closed, opened)]
    assert left[0] < 0.02 and left[0] < 0.05 * left[1]
    assert len(motion.trajectory()) == 101


def _at(motion, t):
    """State of the motion at a sample."""
    k = min(round(t / 0.02), len(motion.u) - 1)
    return motion.q[k], motion.v[k]


def test_least_values_in_a_box():
    rng = np.random.default_rng(1)
    for n in (1, 2, 5):
        for _ in range(20):
            root = rng.normal(size=(n, n))
            H, g = root @ root.T + 0.1 * np.eye(n), rng.normal(size=n)
            low, high = -rng.uniform(0.0, 0.5, n), rng.uniform(0.0, 0.5, n)
            x, free = box_minimum(H, g, low, high)
            slope = H @ x + g
            assert (x >= low).all() and (x <= high).all() and np.abs(slope[free]).max(initial=0.0) <= 1e-9
            assert ((slope[~free] >= 0.0) == (x[~free] == low[~free])).all()


def cart_pole():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail")
    return scene


def effort(t, q, v, u):
    return u @ u


REFUSED = {
    "no inputs": (lambda: gauss.ilqr(gauss.load("pendulum"), 1.0, step=0.1, cost=effort), SimulationError, "scene.input"),
    "duration": (lambda: gauss.ilqr(cart(), 1.0, step=0.3, cost=effort), ArgumentError, "whole number"),
    "not a number": (lambda: gauss.ilqr(cart(), np.nan, step=0.1, cost=effort), GaussError, "duration"),
    "cost": (lambda: gauss.ilqr(cart(), 1.0, step=0.1, cost="effort"), ArgumentError, "cost"),
    "untraced": (lambda: gauss.ilqr(cart(), 1.0, step=0.1, cost=lambda t, q, v, u: float(u[0])), ArgumentError, "cost"),
    "final": (lambda: gauss.ilqr(cart(), 1.0, step=0.1, cost=effort, final=3.0), ArgumentError, "final"),
    "vector": (lambda: gauss.ilqr(cart_pole(), 1.0, step=0.1, cost=effort, final=lambda q, v: q), ArgumentError, "final"),
    "shape": (lambda: gauss.ilqr(cart(), 1.0, step=0.1, cost=effort, inputs=np.zeros(3)), ArgumentError, "shape"),
    "NaN inputs": (lambda: gauss.ilqr(cart(), 0.1, step=0.1, cost=effort, inputs=[[np.nan]]), ArgumentError, "finite"),
    "no effort": (lambda: gauss.ilqr(cart(), 1.0, step=0.1, cost=lambda t, q, v, u: 1.0), SimulationError, "inputs"),
    "integrator": (lambda: gauss.ilqr(cart(), 1.0, step=0.1, cost=effort, integrator="rk5"), ArgumentError, "rk4"),
    "iterations": (
        lambda: gauss.ilqr(cart(3.0), 1.0, step=0.1, cost=effort, final=lambda q, v: 1e3 * q @ q, iterations=1),
        SimulationError,
        "iterations",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_by_name(what):
    call, error, words = REFUSED[what]
    with pytest.raises(error, match=words):
        call()
