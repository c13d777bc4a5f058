"""Predictive control of mechanisms: least squares of states and inputs over a horizon, stage by stage.

    Σ ½ xᵀ Q x + ½ uᵀ R u → min   subject to   x⁺ = A x + B u,   bounds on states and inputs

The variables are u₀, x₁, u₁, x₂, … in this order: the equations are banded, as stage-wise solvers want them.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import expm

import gauss
from gauss.bench.suite.classes.mechanisms import loaded
from gauss.bench.suite.instance import SuiteInstance, programme

GRID = (
    2.0**40
)  # models are rounded to multiples of its inverse, so that they are the same with every library of linear algebra


class Plant(NamedTuple):
    """Linear model of a mechanism in discrete time, weights and bounds."""

    A: np.ndarray  # A (n_x, n_x), B (n_x, n_u): x⁺ = A x + B u
    B: np.ndarray
    Q: np.ndarray  # Q (n_x,), R (n_u,): diagonals of the weights
    R: np.ndarray
    x_max: np.ndarray  # x_max (n_x,), u_max (n_u,): bounds on the sizes; inf where there is none
    u_max: np.ndarray
    start: np.ndarray  # (n_x,) state at the beginning
    states: tuple  # states, inputs: names and units
    inputs: tuple
    story: str  # what it is


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for steps in (10, 30, 100):
        yield f"mpc cart and pole {steps}", partial(_horizon, "cart and pole", steps)
        yield f"mpc masses {steps}", partial(_horizon, "masses", steps)
        yield f"mpc crane {steps}", partial(_horizon, "crane", steps)
    for steps in (5, 20, 40):
        yield f"mpc panda {steps}", partial(_horizon, "panda", steps)
        yield f"mpc ur5 {steps}", partial(_horizon, "ur5", steps)


def _horizon(name: str, steps: int) -> SuiteInstance:
    return horizon(f"mpc {name} {steps}", "mpc", PLANTS[name](), steps)


def horizon(title: str, kind: str, plant: Plant, steps: int, start=None, sequence: str = "") -> SuiteInstance:
    """Instance of one horizon from a state."""
    start = plant.start if start is None else start
    n_x, n_u = plant.B.shape
    stage = sparse.hstack([-sparse.csr_array(plant.B), sparse.eye_array(n_x)])
    before = sparse.hstack([sparse.csr_array((n_x, n_u)), -sparse.csr_array(plant.A)])
    A = sparse.kron(sparse.eye_array(steps), stage) + sparse.kron(sparse.eye_array(steps, k=-1), before)
    b = np.zeros(steps * n_x)
    b[:n_x] = plant.A @ start
    bound = np.tile(np.concatenate([plant.u_max, plant.x_max]), steps)
    names = (*plant.inputs, *plant.states)
    return programme(
        title,
        kind,
        f"{plant.story} Horizon of {steps} steps, {n_x} states and {n_u} inputs.",
        sparse.diags_array(np.tile(np.concatenate([plant.R, plant.Q]), steps)),
        np.zeros(steps * (n_x + n_u)),
        A=A,
        b=b,
        lb=-bound,
        ub=bound,
        stages=(steps, n_x, n_u),
        sequence=sequence,
        variables=tuple(f"step{k + (i >= n_u)}.{name}" for k in range(steps) for i, (name, _) in enumerate(names)),
        units=tuple(unit for _, unit in names) * steps,
    )


def discrete(A: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Model over steps of h with inputs held, of ẋ = A x + B u."""
    n_x, n_u = B.shape
    both = np.round(expm(h * np.block([[A, B], [np.zeros((n_u, n_x + n_u))]])) * GRID) / GRID
    return both[:n_x, :n_x], both[:n_x, n_x:]


def second_order(K, C, F, h: float) -> tuple[np.ndarray, np.ndarray]:
    """The same of q̈ = K q + C q̇ + F u."""
    n = len(K)
    return discrete(np.block([[np.zeros((n, n)), np.eye(n)], [K, C]]), np.vstack([np.zeros_like(F), F]), h)


def cart_and_pole() -> Plant:
    """Cart of 1 kg with an upright pole of 0.1 kg and 0.5 m; the force and the track are limited."""
    g, m, M, length = 9.81, 0.1, 1.0, 0.5
    K = np.array([[0.0, -m * g / M], [0.0, (M + m) * g / (M * length)]])
    A, B = second_order(K, np.zeros((2, 2)), np.array([[1 / M], [-1 / (M * length)]]), 0.05)
    states = ("cart.x", "m"), ("pole.angle", "rad"), ("cart.v", "m/s"), ("pole.rate", "rad/s")
    limits = np.array([1.0, 0.5, np.inf, np.inf]), np.array([3.0])
    story = "Cart of 1 kg with an upright pole: it is caught from 0.2 rad, force up to 3 N, track of ± 1 m."
    return Plant(
        A,
        B,
        np.array([1.0, 10.0, 0.1, 0.1]),
        np.array([0.01]),
        *limits,
        np.array([0.5, 0.2, 0, 0]),
        states,
        (("force", "N"),),
        story,
    )


def masses(count: int = 6) -> Plant:
    """Masses between walls on springs, forces between some of them (Wang, Boyd 2010)."""
    K = -2.0 * np.eye(count) + np.eye(count, k=1) + np.eye(count, k=-1)
    F = np.zeros((count, count // 2))
    for i in range(count // 2):
        F[2 * i, i], F[2 * i + 1, i] = 1.0, -1.0
    A, B = second_order(K, np.zeros((count, count)), F, 0.5)
    states = tuple((f"mass{i}.x", "m") for i in range(count)) + tuple((f"mass{i}.v", "m/s") for i in range(count))
    start = np.concatenate([np.where(np.arange(count) % 3 == 0, 2.5, -1.0), np.zeros(count)])
    limits = np.concatenate([np.full(count, 4.0), np.full(count, np.inf)]), np.full(count // 2, 0.5)
    inputs = tuple((f"force{i}", "N") for i in range(count // 2))
    story = f"{count} masses of 1 kg on springs between walls, forces up to 0.5 N between neighbours."
    return Plant(A, B, np.ones(2 * count), np.ones(count // 2), *limits, start, states, inputs, story)


def crane() -> Plant:
    """Trolley of 500 kg with a load of 2000 kg on a rope of 10 m."""
    m, M, length, g = 2000.0, 500.0, 10.0, 9.81
    K = np.array([[0.0, m * g / M], [0.0, -(M + m) * g / (M * length)]])
    A, B = second_order(K, np.zeros((2, 2)), np.array([[1 / M], [-1 / (M * length)]]), 0.2)
    states = ("trolley.x", "m"), ("rope.angle", "rad"), ("trolley.v", "m/s"), ("rope.rate", "rad/s")
    limits = np.array([np.inf, 0.1, 2.0, np.inf]), np.array([1500.0])
    story = "Crane: trolley of 500 kg, load of 2 t on 10 m of rope, 6 m to go; 1.5 kN, 2 m/s and 0.1 rad at most."
    return Plant(
        A,
        B,
        np.array([1.0, 100.0, 1.0, 1.0]),
        np.array([1e-6]),
        *limits,
        np.array([-6.0, 0, 0, 0]),
        states,
        (("force", "N"),),
        story,
    )


def arm(name: str) -> Plant:
    """Robot arm about a pose, linearised by gauss: torques beside those that hold it."""
    system = gauss.compile_scene(loaded(f"robot:{name}"))
    state = system.state(0.3 * np.ones(system.n_v))
    inverse_torque = system.inverse_dynamics(state.q, state.v, np.zeros(system.n_v))
    found = gauss.derivatives(system, state, inverse_torque)
    free = [i for i, c in enumerate(system.coordinates) if "finger" not in c]
    part = np.ix_(free, free)
    K, C, F = found.q[part], found.v[part], found.load[part]
    A, B = second_order(K, C, F, 0.02)
    joints = [system.coordinates[i] for i in free]
    states = tuple((f"{j}.angle", "rad") for j in joints) + tuple((f"{j}.rate", "rad/s") for j in joints)
    k = len(free)
    start = np.concatenate([np.where(np.arange(k) % 2, 0.2, -0.2), np.zeros(k)])
    limits = np.concatenate([np.full(k, np.inf), np.full(k, 1.0)]), np.where(np.arange(k) < 4, 40.0, 6.0)
    story = f"Arm {name} about a pose, exactly linearised: back from ± 0.2 rad, rates to 1 rad/s, torques limited."
    Q = np.concatenate([np.full(k, 10.0), np.full(k, 0.1)])
    return Plant(A, B, Q, np.full(k, 1e-4), *limits, start, states, tuple((f"{j}.torque", "N m") for j in joints), story)


PLANTS: dict[str, Callable[[], Plant]] = {
    "cart and pole": cart_and_pole,
    "masses": masses,
    "crane": crane,
    "panda": partial(arm, "panda"),
    "ur5": partial(arm, "ur5"),
}
