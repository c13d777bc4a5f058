"""A batch of simulators: its motions are those of single ones; restarts, divergence, refusals."""

import numpy as np
import pytest

import gauss
from gauss.errors import PainleveWarning, SimulationError, StateError

ROUNDING = 1e-12  # of the same steps in SIMD code and in scalar code
STEP, BATCH = 1e-3, 5
MOTIONS = [("cart_pole", "rail"), ("four_bar", "A"), ("friction_oscillator", "rail"), ("painleve_rod", None)]


def scene_of(model: str, joint: str | None) -> gauss.Scene:
    scene = gauss.load(model)
    if joint is not None:
        scene.input("u", joint, limits=0.7)
        scene.output("rate", "rate", joint)
        scene.output("felt", "accelerometer", list(scene.bodies)[-1])
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("model, joint", MOTIONS)
def test_motions_are_those_of_single_simulators(model, joint):
    scene = scene_of(model, joint)
    many, sim = gauss.SimulatorBatch(scene, STEP, batch=BATCH), gauss.Simulator(scene, STEP)
    values = np.sin(np.arange(4.0 * BATCH)).reshape(4, BATCH, 1) if joint else [None] * 4
    with np.errstate(all="ignore"), pytest.warns(PainleveWarning) if model == "painleve_rod" else np.errstate():
        for u in values:
            many.step(u, n=5)
            sim.step(u if u is None else u[2], n=5)
    assert many.t == pytest.approx(sim.t, abs=ROUNDING) and not many.diverged.any() and not many.unconfirmed.any()
    np.testing.assert_allclose(many.q[2], sim.state.q, rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(many.v[2], sim.state.v, rtol=ROUNDING, atol=ROUNDING)
    for name, values in many.outputs.items():
        np.testing.assert_allclose(values[2], sim.outputs[name], rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("model, joint", MOTIONS)
def test_motions_after_a_restored_snapshot_are_those_before_bit_for_bit(model, joint):
    many = gauss.SimulatorBatch(scene_of(model, joint), STEP, batch=BATCH)
    values, ends = np.cos(np.arange(3.0 * BATCH)).reshape(3, BATCH, 1) if joint else [None] * 3, []
    with np.errstate(all="ignore"), pytest.warns(PainleveWarning) if model == "painleve_rod" else np.errstate():
        many.step(values[0], n=7)
        kept = many.snapshot()
        for _ in range(2):
            for u in values:
                many.step(u, n=3)
            ends.append((many.t, many.q, many.v, many.output_vectors()))
            many.step(n=2)
            many.restore(kept)
    assert many.t == pytest.approx(7 * STEP)
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_snapshot_keeps_which_motions_diverged():
    many = gauss.SimulatorBatch(scene_of("cart_pole", "rail"), STEP, batch=BATCH)
    v = np.zeros((BATCH, 2))
    v[1] = 1e200
    many.restart([1], many.q[1:2], v[1:2])
    many.step(n=5)
    kept = many.snapshot()
    many.reset()
    assert not many.diverged.any()
    many.restore(kept)
    assert list(np.flatnonzero(many.diverged)) == [1] and np.isnan(many.q[1]).any()


OF_OTHERS = {
    "step": lambda scene: gauss.SimulatorBatch(scene, 2 * STEP, batch=BATCH),
    "number": lambda scene: gauss.SimulatorBatch(scene, STEP, batch=BATCH + 1),
    "method": lambda scene: gauss.SimulatorBatch(scene, STEP, batch=BATCH, integrator="semi_implicit_euler"),
    "system": lambda scene: gauss.SimulatorBatch(scene_of("four_bar", "A"), STEP, batch=BATCH),
}


@pytest.mark.slow
@pytest.mark.parametrize("other", OF_OTHERS)
def test_snapshots_of_others_are_refused(other):
    scene = scene_of("cart_pole", "rail")
    with pytest.raises(SimulationError, match="of another system, step, method or number of motions"):
        gauss.SimulatorBatch(scene, STEP, batch=BATCH).restore(OF_OTHERS[other](scene).snapshot())


@pytest.mark.slow
def test_starts_restarts_and_divergence_leave_the_others_alone():
    scene = scene_of("cart_pole", "rail")
    many, other = (gauss.SimulatorBatch(scene, STEP, batch=BATCH, threads=k) for k in (1, 2))
    many.reset(seed=4), other.reset(seed=4)
    assert np.ptp(many.q, axis=0).all()
    v = np.zeros((BATCH, 2))
    v[1] = 1e200
    many.restart([1], many.q[1:2], v[1:2])
    u = np.ones((BATCH, 1))
    many.step(u, n=20), other.step(u, n=20)
    assert list(np.flatnonzero(many.diverged)) == [1]
    np.testing.assert_array_equal(np.delete(many.q, 1, axis=0), np.delete(other.q, 1, axis=0))
    many.restart(many.diverged, other.q[:1], other.v[:1])
    many.step(), other.step()
    assert not many.diverged.any()
    np.testing.assert_array_equal(many.q[1], other.q[0])


@pytest.mark.slow
@pytest.mark.parametrize("u", [np.ones(BATCH), np.ones((BATCH, 2)), np.full((BATCH, 1), np.nan)])
def test_refused_inputs_change_nothing(u):
    many, other = (gauss.SimulatorBatch(scene_of("cart_pole", "rail"), STEP, batch=BATCH) for _ in range(2))
    with pytest.raises(SimulationError, match="finite numbers of shape"):
        many.step(u)
    many.step(), other.step()
    assert np.array_equal(many.q, other.q)


def test_what_does_not_fit_is_refused():
    scene = gauss.load("cart_pole")
    for wrong in ({"batch": 0}, {"batch": 2, "threads": 0}, {"batch": 2, "integrator": "dop853"}):
        with pytest.raises(SimulationError):
            gauss.SimulatorBatch(scene, STEP, **wrong)
    many = gauss.SimulatorBatch(scene, STEP, batch=2)
    with pytest.raises(StateError, match="2 motions"):
        many.reset(q=np.zeros((3, 2)), v=np.zeros((3, 2)))


WRONG = {
    "u, words": (lambda many: many.step("abc"), SimulationError, "u: expected"),
    "u, ragged": (lambda many: many.step([[1.0], [1.0, 2.0], []]), SimulationError, "u: expected"),
    "u, complex": (lambda many: many.step(np.zeros((3, 1), complex)), SimulationError, "u: expected"),
    "q, words": (lambda many: many.reset("a"), StateError, "q0: expected"),
    "seed": (lambda many: many.reset(seed="x"), SimulationError, "seed: expected"),
    "spread": (lambda many: many.reset(seed=1, spread=-1.0), SimulationError, "spread: expected"),
    "no such motion": (lambda many: many.restart([5], np.zeros((1, 2)), np.zeros((1, 2))), StateError, "numbers of motions"),
    "too few": (lambda many: many.restart([0, 1], np.zeros((1, 2)), np.zeros((1, 2))), StateError, "of 2 motions, got 1"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG)
def test_wrong_arguments_are_named_and_change_nothing(case):
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=20.0)
    many, (call, kind, words) = gauss.SimulatorBatch(scene, step=1e-3, batch=3), WRONG[case]
    before = many.q, many.v
    with pytest.raises(kind, match=words):
        call(many)
    np.testing.assert_array_equal((many.q, many.v), before)
