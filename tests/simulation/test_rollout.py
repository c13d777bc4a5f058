"""Many motions at once are the same motions."""

import time

import numpy as np
import pytest

import gauss
from gauss.codegen.kernels import FixedStepBatchLoop
from gauss.errors import DivergenceWarning, SimulationError, StateError
from gauss.system import random_state
from tests.support import mechanisms

ROUNDING = 1e-11  # of 50 steps, compiled against certified
LARGEST = 0.35  # rad, of a law that raises beyond
SCENES = {
    "arm": lambda: mechanisms.chain([1.0, 2.0, 0.5]),
    "ball": lambda: mechanisms.two_bodies("ball", 3),
    "floating": lambda: gauss.load("free_body"),
    "coupled": lambda: gauss.load("gear_pair"),
    "damped": lambda: gauss.load("cart_pole"),
}


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["rk4", "semi_implicit_euler"])
@pytest.mark.parametrize("name", SCENES)
def test_every_motion_of_a_batch_is_the_motion_alone(name, integrator):
    system = gauss.compile_scene(SCENES[name]())
    rng = np.random.default_rng(0)
    starts = [random_state(system, rng, spread=0.5) for _ in range(11)]
    starts = [system.initial_state(s.q, s.v) for s in starts]
    q0, v0 = np.array([s.q for s in starts]), np.array([s.v for s in starts])
    many = gauss.rollout(system, q0, v0, steps=50, step=1e-3, integrator=integrator, every=25)
    assert many.t == pytest.approx([0.0, 0.025, 0.05])
    assert np.array_equal(many.q[:, 0], q0) and np.array_equal(many.v[:, 0], v0)
    for k in (0, 7, 10):
        alone = gauss.simulate(
            system, 0.05, integrator=integrator, step=1e-3, times=many.t, state=starts[k], backend="recursion"
        )
        assert np.abs(many.q[k] - alone.q).max() <= ROUNDING
        assert np.abs(many.v[k] - alone.v).max() <= ROUNDING * max(1.0, np.abs(alone.v).max())


@pytest.mark.slow
@pytest.mark.parametrize("threads", [2, 5, None])
@pytest.mark.parametrize("count", [1, 7, 8, 100])
def test_a_motion_does_not_depend_on_who_makes_it_nor_on_the_others(count, threads):
    system = gauss.compile_scene(SCENES["ball"]())
    rng = np.random.default_rng(0)
    starts = [random_state(system, rng, spread=0.5) for _ in range(100)]
    q0, v0 = np.array([s.q for s in starts]), np.array([s.v for s in starts])
    run = {"steps": 300, "step": 1e-3, "every": 7}
    all_at_once, some = gauss.rollout(system, q0, v0, **run), slice(100 - count, 100)
    shared = gauss.rollout(system, q0[some], v0[some], threads=threads, **run)
    assert np.array_equal(shared.q, all_at_once.q[some]) and np.array_equal(shared.v, all_at_once.v[some])


def test_long_motions_are_made_in_spans_that_join(monkeypatch):
    system = gauss.compile_scene(mechanisms.rods(1))
    at_once = gauss.rollout(system, [[0.3]], [[0.0]], steps=500, step=1e-3, every=100)
    monkeypatch.setattr("gauss.simulation.batch.fixed_step_batch.BUDGET", 37)
    in_spans = gauss.rollout(system, [[0.3]], [[0.0]], steps=500, step=1e-3, every=100)
    assert np.array_equal(at_once.q, in_spans.q) and np.array_equal(at_once.v, in_spans.v)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
def test_an_interrupt_ends_all_threads(threads, monkeypatch):
    calls, loop = [], FixedStepBatchLoop.__call__

    def interrupted(self, span, *arrays):
        calls.append(span)
        if len(calls) == 4:
            raise KeyboardInterrupt
        time.sleep(0.005)
        loop(self, span, *arrays)

    system = gauss.compile_scene(mechanisms.rods(1))
    monkeypatch.setattr("gauss.simulation.batch.fixed_step_batch.BUDGET", 10)
    monkeypatch.setattr(FixedStepBatchLoop, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        gauss.rollout(system, [[0.3]] * 100, [[0.0]] * 100, steps=100, step=1e-3, threads=threads)
    assert len(calls) < 65  # of 130


@pytest.mark.slow
def test_motions_that_are_not_confirmed_are_made_by_simulate():
    heavy = [1.0] * 9 + [1e12]  # joint coordinates lose too many digits when the chain is bent
    system = gauss.compile_scene(mechanisms.chain(heavy))
    q0 = np.array([np.zeros(10), np.linspace(0.1, 1.5, 10)])
    many = gauss.rollout(system, q0, np.zeros((2, 10)), steps=20, step=1e-4, every=10)
    assert 1 in many.repeated
    for k in many.repeated:
        alone = gauss.simulate(system, 2e-3, integrator="rk4", step=1e-4, times=many.t, state=system.state(q0[k]))
        assert np.array_equal(many.q[k], alone.q) and np.array_equal(many.v[k], alone.v)


@pytest.mark.slow
def test_loops_stay_closed_and_laws_are_compiled():
    scene = mechanisms.four_bar()
    scene.drive("A", torque=lambda t: 3.0 * np.sin(5.0 * t))
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    # where a loop is cut is felt as much as the method errs: the step is short enough for that to be rounding
    many = gauss.rollout(system, [start.q] * 3, [start.v] * 3, steps=400, step=2.5e-4, every=100)
    alone = gauss.simulate(system, 0.1, integrator="rk4", step=2.5e-4, times=many.t, backend="recursion")
    assert np.abs(many.q[1] - alone.q).max() <= ROUNDING
    gaps = [gauss.assemble(system, system.state(q)).constraint_residual for q in many.q[0]]
    assert np.abs(gaps).max() <= 1e-13


def test_what_cannot_be_rolled_out_says_why():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.1 else 0.0)
    with pytest.raises(SimulationError, match="'drive of J1' cannot be traced"):
        gauss.rollout(gauss.compile_scene(scene), [[0.0]], [[0.0]], steps=1, step=1e-3, device="lanes")


@pytest.mark.parametrize(
    "q0, v0, options, words",
    [
        ([0.0], [[0.0]], {}, r"q0: expected finite numbers of shape \(batch, 1\)"),
        ([[0.0], [0.0]], [[0.0], [np.inf]], {}, r"v0: expected finite numbers .*, got shape \(2, 1\) with inf in row 1"),
        ([[0.0]], [[0.0], [1.0]], {}, "as many starts"),
        ([[np.nan]], [[0.0]], {}, "q0: expected finite"),
        ([[0.0]], [[0.0]], {"steps": 0}, "steps: expected a positive whole number, got 0"),
        ([[0.0]], [[0.0]], {"steps": 1.5}, "steps: expected a positive whole number, got 1.5"),
        ([[0.0]], [[0.0]], {"steps": 10**12}, "steps: the samples of 1000000000000 steps"),
        ([[0.0]], [[0.0]], {"step": np.inf}, "step: expected a positive number, got inf"),
        ([[0.0]], [[0.0]], {"threads": 0}, "threads: expected a positive whole number, got 0"),
        (np.zeros((0, 1)), np.zeros((0, 1)), {}, r"q0: expected finite numbers of shape \(batch, 1\)"),
        ([[0.0]], [[0.0]], {"integrator": "radau5"}, "no integrator 'radau5' for many motions"),
        ([[0.0]], [[0.0]], {"steps": None}, "steps: expected a positive whole number, got None"),
        ([[0.0]], [[0.0]], {"step": None}, "step: expected a positive number, got None"),
        ([[0.0]], [[0.0]], {"times": [1.0]}, "times: integrator 'rk4' has a fixed step"),
    ],
)
def test_wrong_starts_are_refused(q0, v0, options, words):
    system = gauss.compile_scene(mechanisms.rods(1))
    with pytest.raises((StateError, SimulationError), match=words):
        gauss.rollout(system, q0, v0, **({"steps": 1, "step": 1e-3} | options))


def test_quaternions_are_made_unit_or_refused():
    system = gauss.compile_scene(gauss.load("free_body"))
    q, v = system.reference.q, np.full(6, 0.5)
    nearly = np.concatenate([q[:3], (1.0 + 4e-7) * q[3:]])
    run = {"steps": 3, "step": 1e-3}
    assert np.array_equal(gauss.rollout(system, [nearly], [v], **run).q, gauss.rollout(system, [q], [v], **run).q)
    with pytest.raises(StateError, match=r"quaternion \(w, x, y, z\) of joint .* in start number 1 has length 2"):
        gauss.rollout(system, [q, np.concatenate([q[:3], 2.0 * q[3:]])], [v, v], **run)


def _braked() -> gauss.Scene:
    scene = mechanisms.rods(2)
    scene.couple("brake", "J2", "J1", 0.0, 0.4)
    return scene


@pytest.mark.parametrize(
    "build, q, v, words",
    [
        (lambda: gauss.load("gear_pair"), [3.0, -1.0], [3.0, -1.5], "'mesh' off by 0.5 in its rates"),
        (_braked, [0.1, 0.3], [1.0, 0.0], "'brake' off by 0.1"),
        (_braked, [0.1, 0.4], [1.0, 0.2], "'brake' off by 0.2 in its rates"),
    ],
)
def test_starts_that_contradict_what_is_not_stepped_are_refused(build, q, v, words):
    system = gauss.compile_scene(build())
    good = system.initial_state(q, v)
    gauss.rollout(system, [good.q], [good.v], steps=2, step=1e-3)
    with pytest.raises(StateError, match=f"start number 1 has a constraint residual of .*{words}"):
        gauss.rollout(system, [good.q, q], [good.v, v], steps=2, step=1e-3)


DIVERGING = {
    "rk4": {"steps": 5, "step": 1e-3},
    "time_stepping": {"steps": 5, "step": 1e-3},
    "dop853": {"times": [0.0, 1e-3, 5e-3]},
}


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("integrator", DIVERGING)
def test_motions_that_diverge_are_marked_and_the_others_are_not_affected(integrator, threads):
    system, which, rng = gauss.compile_scene(mechanisms.rods(2)), (1, 6), np.random.default_rng(0)
    q, v = rng.normal(size=(2, 9, 2))
    run = {"integrator": integrator, "threads": threads} | DIVERGING[integrator]
    right = gauss.rollout(system, q, v, **run)
    v[which, :] = 1e200
    with np.errstate(all="ignore"), pytest.warns(DivergenceWarning, match="2 of 9 motions .*: 1, 6. Number 1: "):
        found = gauss.rollout(system, q, v, **run)
    assert found.diverged == which and sorted(found.reasons) == list(which)
    for part, of_right in ((found.q, right.q), (found.v, right.v)):
        np.testing.assert_array_equal(np.delete(part, which, axis=0), np.delete(of_right, which, axis=0))
    for k in which:
        assert np.isnan(found.q[k, -1]).any()
        so_far = found.trajectory(k)
        assert so_far.t[0] == 0.0 and np.isfinite(so_far.q).all() and so_far.t[-1] < right.t[-1]


@pytest.mark.slow
@pytest.mark.parametrize("integrator", DIVERGING)
def test_no_motion_that_reaches_the_end_is_an_error(integrator):
    system = gauss.compile_scene(mechanisms.rods(2))
    with np.errstate(all="ignore"), pytest.raises(SimulationError, match="motion 0: "):
        gauss.rollout(system, np.zeros((3, 2)), np.full((3, 2), 1e200), integrator=integrator, **DIVERGING[integrator])


def test_a_motion_whose_law_ends_keeps_its_samples_so_far():
    def law(t, motion):
        if float(motion.coordinate("J")) > LARGEST:
            raise ValueError("out of range")
        return 0.0

    scene = gauss.Scene("ends", gravity=(0, 0, 0))
    scene.revolute("J", "ground", scene.body("arm", 1.0, (0.1, 0.1, 0.1)))
    scene.drive("J", torque=law)
    run = {"steps": 10, "step": 0.1}
    with pytest.warns(DivergenceWarning, match="1 of 2 motions .*out of range"):
        found = gauss.rollout(gauss.compile_scene(scene), np.zeros((2, 1)), [[0.0], [1.0]], **run)
    assert found.diverged == (1,) and "out of range" in found.reasons[1] and not found.q[0].any()
    reached = np.isfinite(found.q[1, :, 0])
    np.testing.assert_allclose(found.q[1, reached, 0], found.t[reached], rtol=0.0, atol=1e-14)  # at a constant rate
    assert found.t[reached][-1] == pytest.approx(LARGEST, abs=0.1)
