"""Wrong shapes, kinds and numbers given to functions of a state, simulators, batches, prepared motions, environments.

Each call is refused with an error of gauss, and changes nothing; a motion of a batch that diverges affects no other.
"""

from importlib import import_module

import numpy as np
import pytest

import gauss
from gauss.errors import GaussError, SimulationError
from gauss.simulation.sweeps import ranges

STEP = 1e-3
PAIR = np.zeros(2)
NOT_PAIRS = {
    "a word": "abc",
    "a number": 3.0,
    "too few": [1.0],
    "too many": [1.0, 2.0, 3.0],
    "NaN": [np.nan, 0.0],
    "infinite": [np.inf, 0.0],
    "ragged": [[1, 2], [3]],
    "words": np.array(["a", "b"]),
    "complex": [1j, 0.0],
    "a dict": {},
    "an object": object(),
    "nothing in a list": [None, None],
}
NOT_COUNTS = (0, -1, 1.5, "2", None)
MANY = 10**14  # numbers that no machine has room for
NOT_POSITIVE = (0, -1.0, np.nan, np.inf, "a")


def scene() -> gauss.Scene:
    made = gauss.load("cart_pole")
    made.input("push", "rail", limits=5.0)
    made.output("place", "position", "pole")
    return made


SYSTEM = gauss.compile_scene(scene())
OF_Q = ("mass_matrix", "gravity_forces", "center_of_mass", "potential_energy")
OF_RATES = ("bias_forces", "coriolis_matrix", "momentum", "kinetic_energy")
OF_LOADS = ("forward_dynamics", "inverse_dynamics", "acceleration_derivatives")


def state_of(simulator) -> list:
    many = isinstance(simulator, gauss.SimulatorBatch)
    return [simulator.t, *((simulator.q, simulator.v) if many else simulator.coordinates)]


def refused(call, simulator=None):
    before = [] if simulator is None else state_of(simulator)
    with pytest.raises(GaussError) as caught:
        call()
    assert str(caught.value)
    for one, other in zip(before, [] if simulator is None else state_of(simulator), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
@pytest.mark.parametrize("bad", NOT_PAIRS.values(), ids=NOT_PAIRS)
def test_functions_of_a_state(bad):
    for name in OF_Q:
        refused(lambda name=name: getattr(SYSTEM, name)(bad))
    for name in (*OF_RATES, *OF_LOADS):
        rest = (PAIR,) * (name in OF_LOADS)
        refused(lambda name=name, rest=rest: getattr(SYSTEM, name)(bad, PAIR, *rest))
        refused(lambda name=name, rest=rest: getattr(SYSTEM, name)(PAIR, bad, *rest))
    for name in OF_LOADS:
        refused(lambda name=name: getattr(SYSTEM, name)(PAIR, PAIR, bad))


@pytest.mark.parametrize("frame", [None, 3, "nobody", ["pole"], object()])
def test_frames(frame):
    refused(lambda: SYSTEM.forward_kinematics(PAIR, frame))
    refused(lambda: SYSTEM.jacobian(PAIR, frame))


SAME_PLACE = np.lib.stride_tricks.as_strided(np.zeros(2), (2, 2), (0, 8))  # both rows lie in one


@pytest.mark.parametrize("out", [np.zeros(3), np.zeros((2, 2), dtype=np.float32), [1], "x", SAME_PLACE])
def test_destinations(out):
    refused(lambda: SYSTEM.mass_matrix(PAIR, out=out))


@pytest.mark.slow
@pytest.mark.parametrize("bad", [v for k, v in NOT_PAIRS.items() if k not in ("a number", "too few")])
def test_inputs_of_simulators_and_environments(bad):
    simulator, batch = gauss.Simulator(SYSTEM, STEP), gauss.SimulatorBatch(SYSTEM, STEP, 2)
    refused(lambda: simulator.step(bad), simulator)
    refused(lambda: batch.step(bad), batch)
    refused(lambda: gauss.rollout(SYSTEM, [PAIR] * 2, [PAIR] * 2, steps=2, step=STEP, control=bad))
    refused(lambda: gauss.simulate(SYSTEM, 0.01, control=lambda t, q, v: bad, rate=100.0, progress=False))
    pytest.importorskip("gymnasium")
    gym = import_module("gauss.gym")
    task = gym.cart_pole_swing_up()
    for environment in (gym.MechanismEnv(task), gym.MechanismVectorEnv(task, 2)):
        environment.reset(seed=0)
        refused(lambda environment=environment: environment.step(bad))
        refused(lambda environment=environment: environment.step(None))


@pytest.mark.parametrize("bad", NOT_PAIRS.values(), ids=NOT_PAIRS)
def test_starts(bad):
    simulator, batch, motion = (
        gauss.Simulator(SYSTEM, STEP),
        gauss.SimulatorBatch(SYSTEM, STEP, 2),
        gauss.prepare(SYSTEM, 0.1),
    )
    for start in ((bad, [PAIR] * 2), ([PAIR] * 2, bad)):
        refused(lambda start=start: gauss.rollout(SYSTEM, *start, steps=2, step=STEP))
        refused(lambda start=start: batch.reset(*start), batch)
    refused(lambda: batch.restart([0], bad, [PAIR]), batch)
    refused(lambda: batch.restart(bad, [PAIR], [PAIR]), batch)
    for start in ((bad, PAIR), (PAIR, bad)):
        refused(lambda start=start: motion(*start))
    refused(lambda: simulator.reset(bad), simulator)


@pytest.mark.parametrize(
    "state",
    [
        gauss.State(np.nan, PAIR, PAIR),
        gauss.State(0.0, np.array([np.nan, 0.0]), PAIR),
        gauss.State(0.0, PAIR, np.array([np.inf, 0.0])),
        gauss.State(0.0, np.zeros(3), PAIR),
    ],
)
def test_states(state):
    simulator = gauss.Simulator(SYSTEM, STEP)
    refused(lambda: simulator.reset(state), simulator)
    refused(lambda: gauss.simulate(SYSTEM, 0.1, state=state, progress=False))


@pytest.mark.parametrize("bad", NOT_COUNTS)
def test_counts(bad):
    simulator, batch = gauss.Simulator(SYSTEM, STEP), gauss.SimulatorBatch(SYSTEM, STEP, 2)
    refused(lambda: simulator.step([1.0], n=bad), simulator)
    refused(lambda: batch.step([[1.0], [1.0]], n=bad), batch)
    refused(lambda: gauss.SimulatorBatch(SYSTEM, STEP, bad))
    refused(lambda: gauss.SimulatorBatch(SYSTEM, STEP, 2, threads=bad))
    refused(lambda: gauss.rollout(SYSTEM, [PAIR], [PAIR], steps=bad, step=STEP))


def test_what_does_not_fit_into_memory():
    simulator = gauss.Simulator(SYSTEM, STEP)
    for call in (
        lambda: simulator.step([1.0], n=MANY),
        lambda: gauss.SimulatorBatch(SYSTEM, STEP, MANY),
        lambda: gauss.rollout(SYSTEM, [PAIR], [PAIR], steps=MANY, step=STEP),
        lambda: gauss.rollout(SYSTEM, [PAIR], [PAIR], steps=10**3 * MANY, step=STEP, every=10**3),
        lambda: gauss.simulate(SYSTEM, MANY * STEP, integrator="rk4", step=STEP, progress=False),
        lambda: gauss.simulate(SYSTEM, MANY * STEP, integrator="rk4", step=STEP, times=[1.0], progress=False),
        lambda: gauss.sweep(SYSTEM.scene, {"pole.mass": [1.0, 2.0]}, 1.0, samples=MANY),
        lambda: gauss.sweep(SYSTEM.scene, dict.fromkeys(("pole.mass", "cart.mass"), np.ones(10**7)), 1.0),
        lambda: ranges([f"pole.mass=1:2:{MANY}"]),
    ):
        with pytest.raises(SimulationError, match="GiB"):
            call()


@pytest.mark.parametrize("bad", NOT_POSITIVE)
def test_steps_and_durations(bad):
    refused(lambda: gauss.Simulator(SYSTEM, bad))
    refused(lambda: gauss.SimulatorBatch(SYSTEM, bad, 2))
    refused(lambda: gauss.rollout(SYSTEM, [PAIR], [PAIR], steps=2, step=bad))
    refused(lambda: gauss.prepare(SYSTEM, bad))
    refused(lambda: gauss.prepare(SYSTEM, 0.1, rtol=bad))


@pytest.mark.parametrize("given", [{"rtol": 1e-3}, {"atol": 1e-3}, {"times": [0.1]}, {"every": 0}, {"integrator": "rk5"}])
def test_settings_that_do_not_apply_to_fixed_steps(given):
    refused(lambda: gauss.rollout(SYSTEM, [PAIR], [PAIR], **({"steps": 2, "step": STEP} | given)))


def test_a_motion_that_diverges_affects_no_other():
    inputs, rates = np.array([[[1.0]], [[2.0]], [[3.0]]]), np.array([[0.0, 0.0], [0.0, 1e200], [0.0, 0.5]])
    batch = gauss.SimulatorBatch(SYSTEM, STEP, 3)
    batch.reset(q=np.zeros((3, 2)), v=rates)
    batch.step(inputs[:, 0], n=20)
    found = gauss.rollout(SYSTEM, np.zeros((3, 2)), rates, steps=20, step=STEP, control=inputs)
    assert batch.diverged.tolist() == [False, True, False] and found.diverged == (1,)
    for k in (0, 2):
        alone = gauss.SimulatorBatch(SYSTEM, STEP, 1)
        alone.reset(q=np.zeros((1, 2)), v=rates[k : k + 1])
        alone.step(inputs[k], n=20)
        np.testing.assert_array_equal(batch.q[k], alone.q[0])
        np.testing.assert_array_equal(found.q[k, -1], alone.q[0])
    batch.restart([1], np.zeros((1, 2)), np.zeros((1, 2)))
    batch.step(inputs[:, 0])
    assert not batch.diverged.any() and np.isfinite(batch.q).all()


def test_truth_values_are_no_indices_and_counts():
    system = gauss.compile_scene(gauss.load("pendulum"))
    motion = gauss.Trajectory.from_coordinates(system, [0.0, 1.0], [[0.0], [0.1]])
    many = gauss.rollout(system, [[0.0]] * 2, [[0.0]] * 2, steps=1, step=1e-3)
    calls = {
        "state": lambda: motion.state(True),
        "trajectory": lambda: many.trajectory(True),
        "contact_points": lambda: gauss.contact_points(motion, True),
        "batch": lambda: gauss.SimulatorBatch(system, STEP, True),
        "steps": lambda: gauss.Simulator(system, STEP).step(n=True),
        "more steps than numbers": lambda: gauss.Simulator(system, STEP).step(n=10**400),
    }
    for call in calls.values():
        with pytest.raises(GaussError):
            call()


def test_a_zero_at_the_start_counts_in_its_direction():
    system = gauss.compile_scene(gauss.load("pendulum"))
    rising = gauss.Trajectory.from_coordinates(system, [0.0, 1.0, 2.0], [[0.0], [0.1], [0.2]])
    found = {way: len(gauss.crossings(rising, lambda at: at.coordinate("A"), direction=way)) for way in (-1, 0, 1)}
    assert found == {-1: 0, 0: 1, 1: 1}


@pytest.mark.parametrize("rate", [np.int64(50), np.float32(50.0)])
def test_rates_and_limits_are_numbers_of_numpy_too(rate):
    scene = gauss.load("cart_pole")
    assert scene.input("push", "rail", limits=rate).bounds == (-50.0, 50.0)
    motion = gauss.simulate(scene, 0.04, control=np.zeros((2, 1)), rate=rate, progress=False)
    assert motion.settings["rate"] == 50.0
