"""Forward dynamics with care: where masses differ by many orders, and where rows all but fade, against 50 digits."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.backends.certificate import TOLERANCE
from gauss.backends.solution import Answer
from gauss.bench.reference import reference
from gauss.dynamics import traced_refinement
from gauss.dynamics.assemble import assemble
from gauss.dynamics.engines import refined, tiering
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.refined_dynamics import QR
from gauss.dynamics.traced_system import Program
from gauss.system import random_state
from tests.support import mechanisms

ROUNDING = 1e-12  # relative: below it an error is not looked at, nor is what frames of links were rounded to
RIGHT = 1e-9  # relative error of the answers here: what rounding leaves where a row has faded to 1e-6 is 1e-10
SEEDS = range(3)


def chain(*masses):
    return lambda rng: anywhere(mechanisms.chain(rng.permutation(masses)), rng)


def anywhere(scene, rng):
    system = gauss.compile_scene(scene)
    state = random_state(system, rng)
    return system, system.initial_state(state.q, state.v)


def flat(n, off):
    """Ladder of so many windows, so far from its flat posture [rad]."""

    def made(rng):
        system = gauss.compile_scene(gauss.load("n_four_bar", n=n))
        signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
        return system, system.state(-(np.pi / 2 - off) * signs, -rng.uniform(1.0, 3.0) * signs)

    return made


def uneven(name, factor):
    """Shipped mechanism with one body that much heavier."""

    def made(rng):
        scene = gauss.load(name)
        chosen = str(rng.choice(list(scene.bodies)))
        body = scene.bodies[chosen]
        inertia = tuple(factor * np.array(body.inertia))
        scene.bodies[chosen] = replace(body, mass=factor * body.mass, inertia=inertia)
        system = gauss.compile_scene(scene)
        return system, system.initial_state()

    return made


def driven():
    """Slider-crank whose crank is turned as time says."""
    scene = gauss.load("slider_crank")
    scene.starts.clear()
    scene.drive("A", angle=lambda t: 10.0 * t + 0.2 * np.sin(3.0 * t))
    system = gauss.compile_scene(scene)
    return system, system.initial_state(t=0.1)


def cross(rng):
    """Rods of masses that differ, on a cross without mass."""
    scene = gauss.Scene("cross")
    scene.body("one", 1e6, (1e4, 1e5, 1e5), com=(0.5, 0, 0))
    scene.body("cross", mass=0.0, position=(1, 0, 0))
    scene.body("other", 1.0, mechanisms.SLENDER, com=(1.5, 0, 0))
    scene.ball("A", "ground", "one", at=(0, 0, 0))
    scene.revolute("first", "one", "cross", at=(1, 0, 0), axis=(0, 0, 1))
    scene.revolute("second", "cross", "other", at=(1, 0, 0), axis=(0, 1, 0))
    return anywhere(scene, rng)


def pushed(rng):
    """Chain with springs, and a wind on its last rod."""
    scene = mechanisms.chain([1.0, 1e5, 1.0, 1e3])
    first, *_, last = scene.bodies
    scene.force("wind", last, force=(1.0, -2.0, 0.5))
    scene.spring("rope", first, last, stiffness=50.0, length=0.5, damping=0.3)
    return anywhere(scene, rng)


CASES = {
    "chain, even": chain(*[1.0] * 6),
    "chain, 1e6": chain(1.0, 1e6, 1.0, 1e6, 1.0),
    "chain, 1e9": chain(*[1.0] * 7, 1e9),
    "chain, 1e-9": chain(*[1.0] * 7, 1e-9),
    "chain, 1e12": chain(*[1.0] * 6, 1e12),
    "ball, free and screw": lambda rng: anywhere(
        gauss.load("random_tree", n=5, seed=2, kinds=("ball", "free", "screw")), rng
    ),
    "gears": lambda rng: anywhere(gauss.load("gear_pair"), rng),
    "planetary gears": lambda rng: anywhere(gauss.load("planetary_gears"), rng),
    "cardan": lambda rng: anywhere(gauss.load("cardan"), rng),
    "driven": lambda rng: driven(),
    "massless cross": lambda rng: cross(rng),
    "pushed": lambda rng: pushed(rng),
    "rolling disk": lambda rng: anywhere(gauss.load("rolling_disk"), rng),
    "ladder 1, 1e-4": flat(1, 1e-4),
    "ladder 3, 1e-6": flat(3, 1e-6),
    "ladder 3, flat": flat(3, 0.0),
    "four-bar, 1e9": uneven("four_bar", 1e9),
    "four-bar, 1e-9": uneven("four_bar", 1e-9),
    "slider-crank, 1e9": uneven("slider_crank", 1e9),
    "bricard, 1e9": uneven("bricard", 1e9),
    "stewart": uneven("stewart_platform", 1e3),
}


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", CASES)
def test_answers_are_right_and_their_error_is_no_more_than_they_say(name, seed):
    rng = np.random.default_rng(seed)
    system, state = CASES[name](rng)
    load = rng.standard_normal(system.n_v)
    rates, (error, gap, _) = traced_refinement.refined(
        Program(system, Laws(system)), state.q, state.v, load, np.array([state.t])
    )
    compulsion = assemble(system, state, load)
    expected = reference(compulsion)
    answer = Answer(expected.a, rates.astype(float), np.zeros(compulsion.D.size), np.zeros(0))
    assert expected.error(compulsion, answer) <= min(max(error, ROUNDING), RIGHT)
    assert error <= TOLERANCE and gap <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["chain, 1e9", "ladder 3, flat"])
def test_what_simple_machine_code_cannot_confirm_is_soon_found_by_refinement(name, monkeypatch):
    monkeypatch.setattr(tiering, "COMPILE_THRESHOLD", 2)
    rng = np.random.default_rng(0)
    system, state = CASES[name](rng)
    f, load, out = system.forward_dynamics, rng.standard_normal(system.n_v), np.zeros(system.n_v)
    expected = f(state.q, state.v, load)
    assert np.array_equal(expected, CertifiedEngine().rates(system, state, load).acceleration)
    monkeypatch.setattr(CertifiedEngine, "rates", lambda *_: pytest.fail("not by machine code"))
    for _ in range(2):
        assert f(state.q, state.v, load, out) is out
        assert np.abs(out - expected).max() <= RIGHT * np.abs(expected).max()


@pytest.mark.slow
def test_what_it_cannot_confirm_either_is_left_to_the_recursion(monkeypatch):
    """A gap of the state is none of its business: rows may contradict each other there."""
    monkeypatch.setattr(tiering, "COMPILE_THRESHOLD", 1)
    system = gauss.compile_scene(gauss.load("four_bar"))
    start = system.initial_state()
    state = system.state(start.q + [1e-7, 0.0, 0.0, 0.0], start.v)
    found = system.forward_dynamics(state.q, state.v, np.zeros(4))
    assert np.array_equal(found, CertifiedEngine().rates(system, state).acceleration)


@pytest.mark.parametrize("least", [1.0, 1e-3, 1e-6])
def test_small_singular_values_survive_where_products_lose_them(least):
    """WᵀW is known to rounding of its largest entry; its solution by QR is off by rounding over the least value of W."""
    rng = np.random.default_rng(1)
    U, Z = (np.linalg.qr(rng.standard_normal((8, 8)))[0] for _ in range(2))
    W = U[:, :4] * [1.0, 0.7, 0.4, least] @ Z[:4, :4]
    y = rng.standard_normal(4)
    b = W.T @ (W @ y)
    found = QR(W, least_length=0.0, cut=1e-9).solve(b).astype(float)
    assert np.abs(W @ (found - y)).max() <= 1e-15 / least**2
    assert np.abs(W.T @ (W @ found) - b).max() <= 1e-14


def test_columns_that_say_nothing_new_are_left_out():
    rng = np.random.default_rng(2)
    W = rng.standard_normal((6, 3))
    redundant = np.column_stack([W[:, 0], W[:, 1], W[:, 0] - 2.0 * W[:, 1], W[:, 2], 1e-12 * W[:, 0]])
    b = redundant.T @ rng.standard_normal(6)
    found = QR(redundant, least_length=1e-8, cut=1e-9).solve(b).astype(float)
    assert found[2] == found[4] == 0.0
    assert np.abs(redundant.T @ (redundant @ found) - b).max() <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["driven", "pushed", "chain, 1e9", "planetary gears"])
def test_power_of_loads_and_of_constraints_that_move(name, monkeypatch):
    monkeypatch.setattr(refined, "COMPILE_THRESHOLD", 0)
    rng = np.random.default_rng(3)
    system, state = CASES[name](rng)
    solver, load = refined.RefinedEngine(system, Laws(system)), rng.standard_normal(system.n_v)
    found, expected = solver.rates(system, state, load), CertifiedEngine().rates(system, state, load)
    assert solver.found == 1 and "1 times compiled iterative refinement" in solver.name
    for one, other in zip(found, expected, strict=True):
        assert np.abs(one - other).max() <= RIGHT * (1.0 + np.abs(other).max())


@pytest.mark.slow
def test_a_motion_goes_on_where_simple_machine_code_is_not_trusted(monkeypatch):
    monkeypatch.setattr(refined, "COMPILE_THRESHOLD", 5)
    system = gauss.compile_scene(mechanisms.chain([1.0] * 6 + [1e12]))
    state = system.state(np.linspace(0.1, 1.5, 7), np.linspace(-1.0, 1.0, 7))
    settings = {"state": state, "integrator": "rk4", "step": 1e-3}
    run = {backend: gauss.simulate(system, 0.01, backend=backend, **settings) for backend in ("auto", "recursion")}
    assert run["auto"].stats.plan.fallback == "refined" and run["auto"].stats.handed_over is not None
    assert np.abs(run["auto"].q[-1] - run["recursion"].q[-1]).max() <= 1e-10
    assert run["auto"].stats.worst_error <= TOLERANCE


def test_a_second_tier_that_another_thread_made_is_taken(monkeypatch):
    tiered = tiering.TieredFunction(lambda x: x, lambda: lambda x: 2.0 * x, 1)
    own = tiered.threshold.passed

    def passed():
        monkeypatch.setattr(tiered.threshold, "passed", own)
        tiered(1.0)  # another thread, between the look at the threshold and the making
        return own()

    monkeypatch.setattr(tiered.threshold, "passed", passed)
    assert tiered(3.0) == 6.0 and tiered.make is None
