"""Batches by time stepping, motions of a batch as trajectories, and outputs of all samples."""

import pickle

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError

ROUNDING = 1e-12  # of the same step in two compiled loops, over 100 steps
STEP, STEPS, EVERY, BATCH = 1e-3, 100, 20, 5
SCENES = ("block_on_incline", "friction_oscillator", "double_pendulum_stops", "newtons_cradle", "slack_rope")


def batch(model: str) -> tuple[gauss.System, np.ndarray, np.ndarray]:
    """System with starts of different rates."""
    system, rng = gauss.compile_scene(gauss.load(model)), np.random.default_rng(3)
    start = system.initial_state()
    return system, np.tile(start.q, (BATCH, 1)), start.v + rng.uniform(-0.1, 0.1, (BATCH, system.n_v))


@pytest.mark.slow
@pytest.mark.parametrize("model", SCENES)
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")
def test_motions_with_contacts_are_those_of_simulate(model):
    system, q, v = batch(model)
    run = {"integrator": "time_stepping", "step": STEP}
    found = gauss.rollout(system, q, v, steps=STEPS, every=EVERY, **run)
    for k in (0, BATCH - 1):
        alone = gauss.simulate(system, STEPS * STEP, state=system.state(q[k], v[k]), times=found.t, **run)
        motion = found.trajectory(k)
        for part in ("t", "q", "v", "work"):
            np.testing.assert_allclose(getattr(motion, part), getattr(alone, part), rtol=ROUNDING, atol=ROUNDING)
        assert motion.step == alone.step


@pytest.mark.slow
def test_unsolved_contact_problems_are_those_of_simulate():
    system, q, v = batch("painleve_rod")
    run = {"integrator": "time_stepping", "step": STEP}
    with pytest.warns(gauss.errors.PainleveWarning):
        found = gauss.rollout(system, q[:1], v[:1], steps=STEPS, every=STEPS, **run)
        alone = gauss.simulate(system, STEPS * STEP, state=system.state(q[0], v[0]), **run)
    assert found.repeated == (0,) and np.array_equal(found.q[0, -1], alone.q[-1])


def test_starts_with_penetration_are_refused():
    system, q, v = batch("double_pendulum_stops")
    q[2] = 3.0
    with pytest.raises(StateError, match="inside of"):
        gauss.rollout(system, q, v, steps=1, step=STEP, integrator="time_stepping")


def test_other_integrators_name_time_stepping():
    system, q, v = batch("block_on_incline")
    with pytest.raises(SimulationError, match="use integrator='time_stepping', or simulate"):
        gauss.rollout(system, q, v, steps=1, step=STEP)


@pytest.mark.slow
@pytest.mark.parametrize("model, joint, integrator", [("cart_pole", "rail", "rk4"), ("four_bar", "A", "rk4")])
def test_trajectories_and_outputs_are_those_of_a_simulator(model, joint, integrator):
    scene, rng = gauss.load(model), np.random.default_rng(1)
    scene.input("u", joint, limits=2.0)
    scene.output("felt", "accelerometer", list(scene.bodies)[-1])
    scene.output("place", "position", list(scene.bodies)[-1])
    scene.output("rate", "rate", joint)
    sim = gauss.Simulator(scene, STEP, integrator)
    control, start, system = rng.uniform(-1.0, 1.0, (BATCH, 10, 1)), sim.state, sim.system
    q, v = np.tile(start.q, (BATCH, 1)), np.tile(start.v, (BATCH, 1))
    found = gauss.rollout(system, q, v, steps=STEPS, step=STEP, every=10, control=control)
    for u in control[3]:
        sim.step(u, n=10)
    for name in scene.outputs:
        np.testing.assert_allclose(found.output(name)[3, -1], sim.outputs[name], rtol=ROUNDING, atol=ROUNDING)
    motion = pickle.loads(pickle.dumps(found)).trajectory(3)
    np.testing.assert_allclose(motion.work[-1], sim.work, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(motion.system.loads[-1].load.effort(0.05), np.clip(control[3, 5], -2.0, 2.0))


def test_a_diverged_motion_with_loops_is_marked_and_ends_before():
    scene = gauss.load("four_bar")
    scene.input("u", "A")
    system = gauss.compile_scene(scene)
    start, control = system.initial_state(), np.zeros((9, 1, 1))
    control[4] = 1e200
    run = {"steps": STEPS, "step": STEP, "every": EVERY}
    q, v = np.tile(start.q, (9, 1)), np.tile(start.v, (9, 1))
    found, right = (gauss.rollout(system, q, v, control=u, **run) for u in (control, 0.0 * control))
    assert found.diverged == (4,) and np.isfinite(found.trajectory(4).q).all()
    np.testing.assert_array_equal(np.delete(found.q, 4, axis=0), np.delete(right.q, 4, axis=0))


def test_motions_and_outputs_that_do_not_exist_are_refused():
    system, q, v = batch("cart_pole")
    found = gauss.rollout(system, q, v, steps=2, step=STEP)
    assert len(found) == BATCH
    with pytest.raises(StateError, match="number of a motion"):
        found.trajectory(BATCH)
    with pytest.raises(StateError, match="no output 'x'"):
        found.output("x")
