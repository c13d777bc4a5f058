"""Simulators, batches, prepared motions, rollouts, solutions and environments travel, and continue to the last bit."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import gauss
from tests.simulation.test_mechanism_contacts import arm
from tests.simulation.test_pair_kernel_steps import with_motor

STEP = 1e-3


def slow_down(t, at):
    """An opaque law."""
    return -0.1 * float(at.rate("pin"))


def _cart(opaque: bool = False) -> gauss.System:
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=10.0)
    scene.output("place", "position", "pole")
    if opaque:
        scene.drive("pin", torque=slow_down)
    return gauss.compile_scene(scene)


def _resting(name: str) -> gauss.System:
    return gauss.compile_scene(gauss.load(name))


SYSTEMS = {
    "inputs": _cart,
    "opaque law": lambda: _cart(opaque=True),
    "loops": lambda: _resting("four_bar"),
    "friction": lambda: _resting("friction_oscillator"),
    "pairs of shapes": lambda: gauss.compile_scene(with_motor(arm)),
}


def _moved(simulator, n: int):
    """Coordinates, rates and outputs after some steps."""
    many, n_u = isinstance(simulator, gauss.SimulatorBatch), len(simulator.inputs)
    u = np.linspace(-1.0, 1.0, 2)[:, None].repeat(n_u, axis=1) if many else np.ones(n_u)
    simulator.step(u if n_u else None, n)
    state = (simulator.q, simulator.v) if many else simulator.coordinates
    measured = simulator.output_vectors() if many else simulator.output_vector()
    return [*state, measured, simulator.t]


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("make", [lambda s: gauss.Simulator(s, STEP), lambda s: gauss.SimulatorBatch(s, STEP, 2)])
def test_simulators_and_batches_continue(name, make):
    simulator = make(SYSTEMS[name]())
    _moved(simulator, 7)
    again = pickle.loads(pickle.dumps(simulator))
    for one, other in zip(_moved(simulator, 5), _moved(again, 5), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_batch_keeps_its_marks():
    batch = gauss.SimulatorBatch(_cart(), STEP, 2)
    batch.reset(q=np.zeros((2, 2)), v=[[0.0, 0.0], [0.0, 1e200]])
    batch.step([[1.0], [1.0]], n=3)
    again = pickle.loads(pickle.dumps(batch))
    assert again.diverged.tolist() == batch.diverged.tolist() == [False, True]
    assert again.reasons == batch.reasons


@pytest.mark.slow
def test_prepared_motions_rollouts_and_solutions():
    for opaque in (False, True):
        system = _cart(opaque)
        motion = gauss.prepare(system, 0.1)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(motion))()[0], motion()[0])
        starts = np.zeros((2, 2)), np.zeros((2, 2))
        found = gauss.rollout(system, *starts, steps=5, step=STEP, control=np.ones((2, 1, 1)))
        again = pickle.loads(pickle.dumps(found))
        np.testing.assert_array_equal(again.q, found.q)
        np.testing.assert_array_equal(again.output("place"), found.output("place"))
    system = gauss.compile_scene(gauss.load("four_bar"))
    solution = gauss.solve(gauss.assemble(system, system.initial_state()))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(solution)).qdd, solution.qdd)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["cart_pole_swing_up", "acrobot", "four_bar_press"])
def test_environments_continue(task):
    gymnasium = pytest.importorskip("gymnasium")
    import gauss.gym

    made = getattr(gauss.gym, task)()
    one, many = gauss.gym.MechanismEnv(made), gauss.gym.MechanismVectorEnv(made, 3)
    for environment, seed in ((one, 3), (many, 4)):
        environment.reset(seed=seed)
        environment.action_space.seed(seed)
        assert isinstance(environment, gymnasium.Env | gymnasium.vector.VectorEnv)
        environment.step(environment.action_space.sample())
        again, action = pickle.loads(pickle.dumps(environment)), environment.action_space.sample()
        for _ in range(2):
            for mine, other in zip(environment.step(action)[:4], again.step(action)[:4], strict=True):
                np.testing.assert_array_equal(mine, other)


@pytest.mark.slow
def test_other_processes_continue_simulators():
    made = [
        gauss.Simulator(_cart(), STEP),
        gauss.SimulatorBatch(_cart(), STEP, 2),
        gauss.SimulatorBatch(_cart(True), STEP, 2),
    ]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(_moved, made, [5] * len(made)))
    for simulator, there in zip(made, found, strict=True):
        for one, other in zip(_moved(simulator, 5), there, strict=True):
            np.testing.assert_array_equal(one, other)


def _used(thing):
    """What another process finds with it."""
    if isinstance(thing, gauss.System):
        return gauss.simulate(thing, 0.02, progress=False).q[-1]
    if isinstance(thing, gauss.Trajectory):
        return thing.body(thing.system.structure.bodies[-1]).position[-1]
    if isinstance(thing, gauss.Simulator):
        thing.step(n=3)
        return thing.coordinates[0]
    return thing.qdd


def _all_kinds() -> list:
    """A system, a motion, a solution and a simulator."""
    system = gauss.compile_scene(gauss.load("four_bar"))
    solution = gauss.solve(gauss.assemble(system, system.initial_state()))
    return [system, gauss.simulate(system, 0.02, progress=False), solution, gauss.Simulator(system, STEP)]


@pytest.mark.slow
def test_a_spawned_pool_uses_all_kinds():
    with get_context("spawn").Pool(1) as pool:
        for there, thing in zip(pool.map(_used, _all_kinds()), _all_kinds(), strict=True):
            np.testing.assert_array_equal(there, _used(thing))


@pytest.mark.slow
def test_joblib_uses_all_kinds_under_laws_without_names():
    """Workers of loky: functions go by cloudpickle, what they take by pickle."""
    joblib = pytest.importorskip("joblib")
    scene = gauss.load("double_pendulum")
    scene.drive("A", name="motor", torque=lambda t: 0.1 * np.sin(t))
    things = [*_all_kinds(), gauss.compile_scene(scene)]
    found = joblib.Parallel(2, backend="loky")(joblib.delayed(lambda one: _used(one))(thing) for thing in things)
    for there, thing in zip(found, things, strict=True):
        np.testing.assert_array_equal(there, _used(thing))
