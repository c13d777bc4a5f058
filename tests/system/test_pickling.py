"""Systems and trajectories travel: to other processes, into files and back, and compute the same there."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss.errors import UnpicklableError

MODELS = sorted(path.stem for path in (Path(__file__).parents[2] / "models").glob("*.toml"))


def _again(thing):
    return pickle.loads(pickle.dumps(thing))


def _parts(found) -> tuple:
    return found if isinstance(found, tuple) else (found,)


def named_law(t):
    """A law with a name in a module."""
    return 0.1 * np.sin(t)


def _driven(law):
    scene = gauss.load("double_pendulum")
    scene.drive(next(iter(scene.joints)), name="motor", torque=law)
    return gauss.compile_scene(scene)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_a_system_is_the_same_after_a_journey(name):
    system = gauss.compile_scene(gauss.load(name))
    other = _again(system)
    assert other.structure.coordinates == system.structure.coordinates
    start = system.initial_state()
    np.testing.assert_array_equal(other.initial_state().q, start.q)
    one, two = gauss.Kinematics(system, start), gauss.Kinematics(other, start)
    for body in system.structure.bodies:
        np.testing.assert_array_equal(one.position(body), two.position(body))
        np.testing.assert_array_equal(one.velocity(body), two.velocity(body))


@pytest.mark.slow
@pytest.mark.parametrize("coordinates", ["tree", "maximal"])
def test_coordinates_are_kept(coordinates):
    system = gauss.compile_scene(gauss.load("spatial_tree"), coordinates)
    other = _again(system)
    assert other.structure.coordinates == system.structure.coordinates and other.n_q == system.n_q
    state = system.initial_state()
    np.testing.assert_array_equal(other.accelerations(state), system.accelerations(state))


@pytest.mark.slow
def test_machine_code_stays_behind_and_is_made_again():
    system = _driven(named_law)
    before = gauss.simulate(system, 0.1, progress=False)
    after = gauss.simulate(_again(system), 0.1, progress=False)
    np.testing.assert_array_equal(after.q, before.q)


@pytest.mark.slow
def test_a_trajectory_is_the_same_after_a_journey():
    motion = gauss.simulate(gauss.load("four_bar"), 0.1, progress=False)
    other = _again(motion)
    for name in ("t", "q", "v", "work"):
        np.testing.assert_array_equal(getattr(other, name), getattr(motion, name))
    assert other.settings == motion.settings and other.stats == motion.stats
    body = motion.system.structure.bodies[-1]
    np.testing.assert_array_equal(other.body(body).position, motion.body(body).position)


def _swing(system, speed):
    start = system.initial_state()
    return gauss.simulate(system, 0.05, state=system.state(start.q, start.v + speed), progress=False)


@pytest.mark.slow
def test_other_processes_simulate_a_system():
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = pool.submit(_swing, system, 1.0).result()
    np.testing.assert_array_equal(found.q, _swing(system, 1.0).q)


FUNCTIONS = {
    "a matrix": lambda s: (s.mass_matrix, "q"),
    "accelerations": lambda s: (s.forward_dynamics, "qvv"),
    "of a frame": lambda s: (s.jacobian, "qf"),
    "several": lambda s: (s.function("mass_matrix", "bias_forces"), "qv"),
    "of independent coordinates": lambda s: (s.function("mass_matrix", independent=("A",)), "q"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FUNCTIONS)
def test_functions_of_a_state_are_made_again(kind):
    system = gauss.compile_scene(gauss.load("four_bar"))
    start, (function, letters) = system.initial_state(), FUNCTIONS[kind](system)
    given = [{"q": start.q, "v": start.v, "f": "coupler"}[letter] for letter in letters]
    for one, other in zip(_parts(function(*given)), _parts(_again(function)(*given)), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_simulators_and_prepared_motions_go_on_where_they_were():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=10.0)
    one = gauss.Simulator(scene, step=1e-3)
    one.step([3.0], n=7)
    other = _again(one)
    for simulator in (one, other):
        simulator.step(n=5)
    assert one.snapshot() == other.snapshot()
    swing = gauss.prepare(gauss.load("pendulum"), 0.3, times=[0.1, 0.3])
    expected = swing([0.2], [1.0])[0].copy()
    np.testing.assert_array_equal(_again(swing)([0.2], [1.0])[0], expected)


@pytest.mark.parametrize("kind", ["drive", "relation", "displacement"])
def test_a_law_that_cannot_travel_is_named(kind):
    scene = gauss.load("double_pendulum")
    joint = next(iter(scene.joints))
    if kind == "drive":
        scene.drive(joint, name="motor", torque=lambda t: 0.1)
    elif kind == "displacement":
        scene.drive(joint, name="motor", displacement=lambda t: 0.1 * t)
    else:
        scene.one_sided("motor", lambda at: at.coordinate(joint) + 10.0)
    system = gauss.compile_scene(scene)
    with pytest.raises(UnpicklableError, match="motor") as caught:
        pickle.dumps(system)
    assert isinstance(caught.value, gauss.GaussError) and isinstance(caught.value, pickle.PicklingError)


def test_who_takes_functions_as_they_are_gets_them():
    cloudpickle = pytest.importorskip("cloudpickle")
    system = _driven(lambda t: 0.1)
    other = pickle.loads(cloudpickle.dumps(system))
    state = system.initial_state()
    np.testing.assert_array_equal(other.accelerations(state), system.accelerations(state))


def test_functions_that_name_the_package_are_sent_to_other_processes():
    """As joblib sends those of a script: with the packages that they name."""
    for package in (gauss, gauss.scene):
        assert pickle.loads(pickle.dumps(package)) is package


def test_copies_need_no_journey():
    system = _driven(lambda t: 0.1)
    assert copy.copy(system).dynamics is system.dynamics
    deep, state = copy.deepcopy(system), system.initial_state()
    np.testing.assert_array_equal(deep.accelerations(state), system.accelerations(state))


def _with_another_body(scene):
    body = scene.body("another", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene.revolute("hinge", "ground", body)


def test_a_scene_that_was_changed_since_is_not_passed_off_as_the_system():
    scene = gauss.load("double_pendulum")
    system = gauss.compile_scene(scene)
    _with_another_body(scene)
    assert pickle.loads(pickle.dumps(system)).coordinates == system.coordinates
    _with_another_body(system.scene)
    with pytest.raises(UnpicklableError, match="compile"):
        pickle.dumps(system)
