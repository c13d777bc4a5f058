"""Batches with inputs of each motion: against single motions under the same tables; motions that diverge are marked."""

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError

ROUNDING = 1e-13  # SIMD code and scalar code over 100 steps
UPRIGHT = 0.9  # cosine of the angle of the pole; hanging it is -1
BATCH, STEPS, STEP = 11, 100, 1e-3
SCENES = {"cart_pole": "rail", "four_bar": "A"}


def batch(model: str):
    """System, starts and inputs of a batch."""
    scene, rng = gauss.load(model), np.random.default_rng(7)
    scene.input("u", SCENES[model], limits=20.0)
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    rates = start.v * rng.uniform(0.5, 1.0, (BATCH, 1))
    return system, np.tile(start.q, (BATCH, 1)), rates, rng.uniform(-30.0, 30.0, (BATCH, 10, 1))


@pytest.mark.slow
@pytest.mark.parametrize("model", SCENES)
def test_motions_of_a_batch_are_those_of_simulate(model):
    system, q0, v0, control = batch(model)
    found = gauss.rollout(system, q0, v0, steps=STEPS, step=STEP, every=STEPS, control=control)
    for k in (0, BATCH - 1):
        start = gauss.State(0.0, q0[k], v0[k])
        options = {"integrator": "rk4", "step": STEP}
        alone = gauss.simulate(system, STEPS * STEP, state=start, control=control[k], rate=100.0, **options)
        assert np.abs(found.q[k, -1] - alone.q[-1]).max() <= ROUNDING
    assert found.diverged == () and found.repeated == ()


def test_results_depend_neither_on_threads_nor_on_how_rows_are_held():
    system, q0, v0, control = batch("cart_pole")
    run = {"steps": STEPS, "step": STEP, "every": STEPS}
    one = gauss.rollout(system, q0, v0, control=control, **run)
    two = gauss.rollout(system, q0, v0, control=np.repeat(control, 10, axis=1), threads=2, **run)
    np.testing.assert_array_equal(one.q, two.q)


def test_a_motion_that_diverges_is_marked_and_the_others_are_not_affected():
    system, q0, v0, control = batch("cart_pole")
    run = {"steps": STEPS, "step": STEP, "every": STEPS, "control": control}
    right = gauss.rollout(system, q0, v0, **run)
    v0[3] = 1e200
    found = gauss.rollout(system, q0, v0, **run)
    assert found.diverged == (3,)
    np.testing.assert_array_equal(np.delete(found.q, 3, axis=0), np.delete(right.q, 3, axis=0))


@pytest.mark.slow
def test_sampled_control_swings_a_pole_up():
    place = Path(gauss.__file__).parents[1] / "models" / "examples" / "control" / "mppi.py"
    example = run_path(str(place))
    scene, cost, duration = example["cart_pole"]()
    law = example["Mppi"](scene, cost, samples=200)
    motion = gauss.simulate(law.system, duration, control=law, rate=50.0, integrator="rk4", step=5e-3)
    assert np.cos(motion.q[-1, 1]) > UPRIGHT


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda u: u[:, :, 0], "expected shape"),
        (lambda u: u[:5], "expected shape"),
        (lambda u: u[:, :7], "divisor"),
        (lambda u: lambda t, q, v: (0.0,), "laws"),
        (lambda u: [[[1.0]], [[1.0], [2.0]]], "expected numbers"),
        (lambda u: np.where(np.arange(BATCH)[:, None, None] == 4, np.nan, u), "input 'u' of motion 4 is nan in row 0"),
    ],
)
def test_invalid_inputs_are_refused(change, message):
    system, q0, v0, control = batch("cart_pole")
    with pytest.raises(SimulationError, match=message):
        gauss.rollout(system, q0, v0, steps=STEPS, step=STEP, control=change(control))
    with pytest.raises(SimulationError, match="no inputs"):
        gauss.rollout(gauss.compile_scene(gauss.load("cart_pole")), q0, v0, steps=STEPS, step=STEP, control=control)
