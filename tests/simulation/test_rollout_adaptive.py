"""Many motions at once, each with steps of its own: the same motions to the last bit, whoever makes them."""

import time

import numpy as np
import pytest

import gauss
from gauss.codegen.kernels import AdaptiveBatchLoop
from gauss.errors import SimulationError, StateError
from gauss.system import random_state
from tests.support import mechanisms

TOLERANCE = {"rtol": 1e-9, "atol": 1e-9}
TIMES = np.array([0.0, 0.013, 0.5, 0.500001, 1.0])


def _four_bar() -> gauss.Scene:
    scene = mechanisms.four_bar()
    scene.drive("A", torque=lambda t: 3.0 * np.sin(5.0 * t))
    return scene


SCENES = {
    "arm": lambda: mechanisms.chain([1.0, 2.0, 0.5]),
    "ball": lambda: mechanisms.two_bodies("ball", 3),
    "floating": lambda: gauss.load("free_body"),
    "coupled": lambda: gauss.load("gear_pair"),
    "damped": lambda: gauss.load("cart_pole"),
    "loop": _four_bar,
    "ladder": lambda: gauss.load("n_four_bar", n=1),  # through flat configurations, where its closing rows fade
}


def _starts(system, count: int, spread: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Starts (count, n_q), (count, n_v) that meet the constraints; one rests, one is a hundred times as fast as another."""
    rng = np.random.default_rng(0)
    if system.has_closures:
        start = system.initial_state()
        found = [system.initial_state(start.q, rng.uniform(-1.0, 1.0) * start.v) for _ in range(count)]
    else:
        found = [random_state(system, rng, spread=spread) for _ in range(count)]
        found = [system.initial_state(s.q, 10.0 ** rng.uniform(-1, 1) * s.v) for s in found]
    found[count // 2] = system.initial_state(found[count // 2].q, np.zeros(system.n_v))
    return np.array([s.q for s in found]), np.array([s.v for s in found])


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "dopri5"])
@pytest.mark.parametrize("name", SCENES)
def test_every_motion_of_a_batch_is_the_motion_alone(name, integrator):
    system = gauss.compile_scene(SCENES[name]())
    q0, v0 = _starts(system, 11)
    run, alone = {"integrator": integrator, "times": TIMES} | TOLERANCE, {}
    for k in (0, 1, 5, 10):
        alone[k] = gauss.simulate(system, 1.0, state=system.state(q0[k], v0[k]), **run)
        q0[k], v0[k] = alone[k].q[0], alone[k].v[0]  # a state that is given to it is projected onto the constraints first
    many = gauss.rollout(system, q0, v0, **run)
    assert many.repeated == () and np.array_equal(many.t, TIMES)
    assert np.array_equal(many.q[:, 0], q0) and np.array_equal(many.v[:, 0], v0)
    for k, motion in alone.items():
        assert np.array_equal(many.q[k], motion.q) and np.array_equal(many.v[k], motion.v)
        assert (many.steps[k], many.rejected[k]) == (motion.stats.steps, motion.stats.rejected)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2, 5, None])
@pytest.mark.parametrize("count", [1, 7, 8, 60])
def test_a_motion_does_not_depend_on_who_makes_it_nor_on_the_others(count, threads, monkeypatch):
    system = gauss.compile_scene(SCENES["ball"]())
    q0, v0 = _starts(system, 60)
    run, some = {"integrator": "dop853", "times": TIMES} | TOLERANCE, slice(60 - count, 60)
    all_at_once = gauss.rollout(system, q0, v0, **run)
    monkeypatch.setattr("gauss.simulation.batch.adaptive_batch.BUDGET", 7)  # spans that join
    shared = gauss.rollout(system, q0[some], v0[some], threads=threads, **run)
    for part in ("q", "v", "steps", "rejected"):
        assert np.array_equal(getattr(shared, part), getattr(all_at_once, part)[some])


@pytest.mark.slow
def test_lanes_are_refilled():
    """Motions of very different length share lanes: no more turns are made than the longest queue needs."""
    turns, loop = [], AdaptiveBatchLoop.__call__

    class Counted(AdaptiveBatchLoop):
        def __call__(self, queue, *arrays):
            before = queue.turns
            loop(self, queue, *arrays)
            turns.append(queue.turns - before)

    system = gauss.compile_scene(mechanisms.rods(1))
    v0 = np.where(np.arange(160) % 16 == 0, 300.0, 0.1)[:, None]  # every sixteenth needs many steps
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AdaptiveBatchLoop, "__call__", Counted.__call__)
        many = gauss.rollout(system, np.full((160, 1), 0.3), v0, integrator="dop853", times=[1.0], **TOLERANCE)
    tried = many.steps + many.rejected
    assert tried.max() > 5 * np.median(tried)
    width = gauss.codegen.processor.width()
    assert sum(turns) <= tried.sum() / width + 2 * tried.max() < 0.5 * tried.max() * len(tried) / width


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
def test_an_interrupt_ends_all_threads(threads, monkeypatch):
    calls, loop = [], AdaptiveBatchLoop.__call__

    def interrupted(self, queue, *arrays):
        calls.append(queue)
        if len(calls) == 4:
            raise KeyboardInterrupt
        time.sleep(0.005)
        loop(self, queue, *arrays)

    system = gauss.compile_scene(mechanisms.rods(1))
    monkeypatch.setattr("gauss.simulation.batch.adaptive_batch.BUDGET", 2)
    monkeypatch.setattr(AdaptiveBatchLoop, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        gauss.rollout(system, [[0.3]] * 100, [[0.0]] * 100, times=[1.0], integrator="dop853", threads=threads)
    assert len(calls) < 10


@pytest.mark.slow
def test_motions_that_are_not_confirmed_are_made_by_simulate():
    heavy = [1.0] * 9 + [1e12]  # joint coordinates lose too many digits when the chain is bent
    system = gauss.compile_scene(mechanisms.chain(heavy))
    q0 = np.array([np.zeros(10), np.linspace(0.1, 1.5, 10)])
    run = {"integrator": "dop853", "times": [1e-4, 2e-4], "rtol": 1e-6, "atol": 1e-6}
    many = gauss.rollout(system, q0, np.zeros((2, 10)), **run)
    assert 1 in many.repeated
    for k in many.repeated:
        alone = gauss.simulate(system, 2e-4, state=system.state(q0[k]), **run)
        assert np.array_equal(many.q[k], alone.q) and np.array_equal(many.v[k], alone.v)


@pytest.mark.slow
def test_starts_off_their_constraints_are_refused():
    system = gauss.compile_scene(gauss.load("gear_pair"))
    with pytest.raises(StateError, match="start number 0 has a constraint residual of .*'mesh' off by 0.5"):
        gauss.rollout(system, [[3.0, -1.0]], [[3.0, -1.5]], integrator="dop853", times=[0.1])


@pytest.mark.parametrize(
    "options, words",
    [
        ({}, r"integrator 'dop853' chooses its steps: give times="),
        ({"times": [1.0], "steps": 5}, "steps: integrator 'dop853' chooses its steps"),
        ({"times": [1.0], "every": 5}, "every: integrator 'dop853' chooses its steps"),
        ({"times": [1.0, 0.5]}, "times: expected increasing times"),
        ({"times": []}, "times: expected increasing times"),
        ({"times": [np.nan]}, "times: expected increasing times"),
        ({"times": [0.0]}, "times: expected the last one to be after the start"),
        ({"times": [1.0], "rtol": 0.0}, "rtol: expected a positive number, got 0.0"),
        ({"times": [1.0], "atol": (1.0, 2.0, 3.0)}, "atol: expected a number, or a pair"),
        ({"times": [1.0], "step": -1.0}, "step: expected a positive number, got -1.0"),
    ],
)
def test_wrong_settings_are_refused(options, words):
    system = gauss.compile_scene(mechanisms.rods(1))
    with pytest.raises(SimulationError, match=words):
        gauss.rollout(system, [[0.3]], [[0.0]], integrator="dop853", **options)
