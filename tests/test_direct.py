"""Forward dynamics as a built-in function: right numbers, every argument checked, nothing leaked."""

import gc
import sys

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError
from gauss.system import random_state
from tests.mechanisms import four_bar

SAME = 1e-11  # relative to the largest acceleration, of the certified recursion


def loaded():
    scene = gauss.load("double_pendulum")
    joint = next(iter(scene.joints))
    scene.drive(joint, torque=2.0)
    scene.joint_spring("spring", joint, stiffness=3.0, damping=0.2)
    return scene


SCENES = {
    "panda": lambda: gauss.load("robot:panda"),
    "ball joints": lambda: gauss.load("random_tree", n=5, seed=2, kinds=("ball", "free", "screw")),
    "loop": four_bar,
    "loads": loaded,
    "large": lambda: gauss.load("spatial_chain", n=60),
}


@pytest.mark.parametrize("name", SCENES)
def test_accelerations(name):
    system = gauss.compile_scene(SCENES[name]())
    rng = np.random.default_rng(0)
    given = random_state(system, rng, spread=0.3)
    state = system.initial_state() if system.has_closures else given
    load, out = rng.standard_normal(system.n_v), np.empty(system.n_v)
    expected = system.accelerations(state, load)
    assert system.forward_dynamics(state.q, state.v, load, out) is out
    assert np.abs(out - expected).max() < SAME * np.abs(expected).max()


@pytest.fixture(scope="module")
def arm():
    system = gauss.compile_scene(gauss.load("n_pendulum", n=3))
    state = random_state(system, np.random.default_rng(1))
    load = np.array([0.3, -0.2, 0.1])
    return system.forward_dynamics, state.q, state.v, load, system.accelerations(state, load)


ACCEPTED = {
    "arrays": np.array,
    "lists": list,
    "read-only arrays": lambda x: _frozen(np.array(x)),
    "every other entry": lambda x: np.repeat(x, 2)[::2],
    "the other byte order": lambda x: np.array(x, dtype=">f8"),
    "long doubles": lambda x: np.array(x, dtype=np.longdouble),
    "subclasses": lambda x: np.array(x).view(np.recarray),
    "off the alignment": lambda x: np.frombuffer(b"\0" + np.array(x).tobytes(), dtype=float, offset=1),
}


def _frozen(array):
    array.flags.writeable = False
    return array


@pytest.mark.parametrize("kind", ACCEPTED)
def test_arguments_are_taken_in_any_form(kind, arm):
    function, *given, expected = arm
    out = np.empty(3)
    function(*(ACCEPTED[kind](part) for part in given), out)
    assert np.abs(out - expected).max() < SAME * np.abs(expected).max()


REFUSED = {
    "q too short": (0, np.zeros(2), StateError, "q: expected 3"),
    "v in two dimensions": (1, np.zeros((3, 1)), StateError, "v: expected 3"),
    "load a word": (2, "abc", StateError, "load: expected 3"),
    "load of no numbers": (2, [None] * 2, StateError, "load: expected 3"),
    "q a number": (0, 1.0, StateError, "q: expected 3"),
    "out a list": (3, [0.0] * 3, StateError, "out: expected"),
    "out too long": (3, np.empty(4), StateError, "out: expected"),
    "out in single precision": (3, np.empty(3, np.float32), StateError, "out: expected"),
    "out read-only": (3, _frozen(np.empty(3)), StateError, "out: expected"),
    "out nothing": (3, None, StateError, "out: expected"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_arguments_that_do_not_fit_are_refused(name, arm):
    place, value, error, said = REFUSED[name]
    function, *arguments = arm[:4]
    arguments = [*arguments, np.empty(3)]
    arguments[place] = value
    with pytest.raises(error, match=said):
        function(*arguments)


@pytest.mark.parametrize("count", [0, 1, 3, 5])
def test_number_of_arguments(count, arm):
    with pytest.raises(TypeError, match=f"got {count} arguments"):
        arm[0](*[np.empty(3)] * count)


def test_result_may_take_the_place_of_an_argument(arm):
    function, q, v, load, expected = arm
    place = load.copy()
    function(q, v, place, place)
    assert np.abs(place - expected).max() < SAME * np.abs(expected).max()


def test_strided_results_are_written(arm):
    function, q, v, load, expected = arm
    room = np.full(6, 7.0)
    function(q, v, load, room[::2])
    assert np.abs(room[::2] - expected).max() < SAME * np.abs(expected).max()
    assert (room[1::2] == 7.0).all()


def test_references_are_kept_in_balance(arm):
    function, q, v, load, _ = arm
    out = np.empty(3)
    before = [sys.getrefcount(x) for x in (q, v, load, out)]
    for _ in range(1000):
        function(q, v, load, out)
        function(list(q), v, load, out)
    assert [sys.getrefcount(x) for x in (q, v, load, out)] == before


def test_function_outlives_its_system():
    function = gauss.compile_scene(gauss.load("n_pendulum", n=2)).forward_dynamics
    gc.collect()
    assert np.isfinite(function(np.zeros(2), np.zeros(2), np.zeros(2), np.empty(2))).all()


def test_without_the_known_layout_of_arrays(monkeypatch, arm):
    *given, expected = arm[1:]
    monkeypatch.setattr(sys.modules["gauss.tracing.direct"], "_is_laid_out_as_expected", lambda: False)
    function = gauss.compile_scene(gauss.load("n_pendulum", n=3)).forward_dynamics
    assert np.abs(function(*given, np.empty(3)) - expected).max() < SAME * np.abs(expected).max()


def test_loads_that_depend_on_time_are_refused():
    scene = gauss.load("n_pendulum", n=2)
    scene.drive("J1", torque=lambda t: np.sin(t))
    with pytest.raises(SimulationError, match="depends on time"):
        gauss.compile_scene(scene).forward_dynamics  # noqa: B018


def test_laws_that_cannot_be_traced_are_refused():
    scene = gauss.load("n_pendulum", n=2)
    scene.drive("J1", torque=lambda t: float(t) * 2.0)
    with pytest.raises(SimulationError, match="drive of J1"):
        gauss.compile_scene(scene).forward_dynamics  # noqa: B018
