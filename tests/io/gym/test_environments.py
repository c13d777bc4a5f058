"""Environments of Gymnasium: the checker of Gymnasium, and motions of the vector environment against single ones."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import gauss  # noqa: E402
from gauss import gym  # noqa: E402
from gauss.errors import ArgumentError, SimulationError  # noqa: E402

ROUNDING = 1e-10  # SIMD code and scalar code over a few actions
TASKS = [gym.cart_pole_swing_up, gym.acrobot, gym.four_bar_press]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("make", TASKS)
def test_environments_pass_the_checker(make):
    check_env(gym.MechanismEnv(make()), skip_render_check=True)


@pytest.mark.slow
@pytest.mark.parametrize("make", TASKS)
def test_motions_of_a_vector_environment_are_those_of_single_ones(make):
    many, one = gym.MechanismVectorEnv(make(), 5), gym.MechanismEnv(make())
    observed, _ = many.reset(seed=3)
    alone, _ = one.reset(options={"state": gauss.State(0.0, many.simulators.q[2], many.simulators.v[2])})
    np.testing.assert_allclose(observed[2], alone, rtol=0.0, atol=ROUNDING)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (4, *many.action_space.shape)) * many.single_action_space.high
    for action in actions:
        found, expected = many.step(action), one.step(action[2])
        np.testing.assert_allclose(found[0][2], expected[0], rtol=ROUNDING, atol=ROUNDING)
        assert found[1][2] == pytest.approx(expected[1], abs=ROUNDING)


def test_episodes_end_and_begin_anew_with_the_next_action():
    task = gym.Task(gym.cart_pole_swing_up().scene, lambda q, v, u, y: q[..., 0], duration=0.06)
    many = gym.MechanismVectorEnv(task, 3)
    many.reset(seed=1)
    truncated = [many.step(np.ones((3, 1)))[3].all() for _ in range(7)]
    assert truncated == [False, False, True, False, False, False, True]


def test_a_motion_that_diverges_is_marked_and_the_others_are_not_affected():
    right, many = (gym.MechanismVectorEnv(gym.cart_pole_swing_up(), 6) for _ in range(2))
    for environment in (right, many):
        environment.reset(seed=2)
    many.simulators._batch.points[4, 1] = 1e200
    expected, found = (environment.step(np.ones((6, 1))) for environment in (right, many))
    assert found[4]["diverged"].tolist() == [False, True, False, False, False, False]
    assert found[2][1] and not found[0][1].any()
    np.testing.assert_array_equal(np.delete(found[0], 1, axis=0), np.delete(expected[0], 1, axis=0))


def test_a_failed_motion_terminates_with_its_reason():
    environment = gym.MechanismEnv(gym.cart_pole_swing_up())
    environment.reset(seed=1)
    environment.simulator._point[4] = 1e200  # the rate of the pole
    *_, terminated, _, info = environment.step(np.array([1.0]))
    assert terminated and "shorten the step" in info["failure"]


@pytest.mark.slow
@pytest.mark.parametrize("action", [[np.nan], [np.inf], [1.0, 2.0], 1.0, []])
def test_wrong_actions_are_errors_and_change_nothing(action):
    environment = gym.MechanismEnv(gym.cart_pole_swing_up())
    environment.reset(seed=1)
    before = environment.simulator.snapshot()
    with pytest.raises(ArgumentError, match="finite numbers"):
        environment.step(np.array(action))
    assert environment.simulator.snapshot() == before


def test_tasks_without_limits_or_inputs_are_refused():
    scene = gauss.load("cart_pole")
    with pytest.raises(ArgumentError, match="no inputs"):
        gym.Task(scene, lambda *_: 0.0)
    scene.input("u", "rail")
    with pytest.raises(ArgumentError, match="no limits"):
        gym.Task(scene, lambda *_: 0.0)
    driven = gauss.load("cart_pole")
    driven.input("u", "rail", limits=1.0)
    driven.drive("pin", torque=lambda t: gauss.math.sin(t))
    with pytest.raises(SimulationError, match="laws of time"):
        gym.MechanismVectorEnv(gym.Task(driven, lambda *_: 0.0), 2)


@pytest.mark.parametrize("make", [gym.MechanismEnv, lambda task: gym.MechanismVectorEnv(task, 2)])
def test_a_scene_is_no_task(make):
    with pytest.raises(ArgumentError):
        make(gauss.load("cart_pole"))
