"""Accelerations by machine code are those of the certified recursion, and where they are not, the recursion answers."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.errors import SceneError, SimulationError, StateError
from gauss.system import retract
from tests.support import mechanisms

ROUNDING = 1e-12  # relative to the largest acceleration; both are refined once
SCENES = {
    "panda": lambda: gauss.load("robot:panda"),
    "arm": lambda: mechanisms.chain([1.0, 2.0, 0.5]),
    "ball": lambda: mechanisms.two_bodies("ball", 3),
    "floating": lambda: gauss.load("free_body"),
    "ball, free and screw": lambda: gauss.load("random_tree", n=5, seed=2, kinds=("ball", "free", "screw")),
    "coupled": lambda: gauss.load("gear_pair"),
    "damped": lambda: gauss.load("cart_pole"),
    "four-bar": lambda: gauss.load("four_bar"),
    "slider-crank": lambda: gauss.load("slider_crank"),
    "bricard": lambda: gauss.load("bricard"),
    "rolling disk": lambda: gauss.load("rolling_disk"),
    "long chain": lambda: long_chain(),
    "uneven masses": lambda: mechanisms.chain([1.0, 1e6, 1.0, 1e6]),
}
HEAVY_TIP = [1.0] * 9 + [1e12]  # too many digits are lost in joint coordinates


def long_chain():
    """One that is swept, with loads."""
    scene = gauss.load("n_pendulum", n=45)
    joints = list(scene.joints)
    scene.joint_spring("spring", joints[3], stiffness=3.0, damping=0.5)
    scene.drive(joints[0], torque=lambda t: 0.5 * np.cos(t))
    return scene


def certified(system, state, load=None):
    return CertifiedEngine().rates(system, state, load).acceleration


def off(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.fixture
def unsolved(monkeypatch):
    """The certified recursion must not be asked."""
    monkeypatch.setattr(CertifiedEngine, "rates", lambda *_: pytest.fail("not by machine code"))


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_they_are_those_of_the_certified_recursion(name):
    system = gauss.compile_scene(SCENES[name]())
    f = system.forward_dynamics
    for state, load in zip(*mechanisms.consistent_states(system, 5), strict=True):
        expected = certified(system, state, load)
        assert off(system.accelerations(state, load), expected) <= ROUNDING
        assert off(f(state.q, state.v, load, t=state.t), expected) <= ROUNDING
        assert off(system.accelerations(state), certified(system, state)) <= ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(SCENES) - {"uneven masses"}))
def test_machine_code_alone_finds_them(name, unsolved):
    system = gauss.compile_scene(SCENES[name]())
    for state, load in zip(*mechanisms.consistent_states(system, 3), strict=True):
        assert np.isfinite(system.accelerations(state, load)).all()


def test_a_heavy_tip_is_left_to_the_recursion():
    system = gauss.compile_scene(mechanisms.chain(HEAVY_TIP))
    (state,), (load,) = mechanisms.consistent_states(system, 1)
    assert np.array_equal(system.accelerations(state, load), certified(system, state, load))


def test_near_singular_flat_postures_are_left_to_the_recursion():
    """Compiled elimination gives such rows up; what they lack then is seen."""
    system = gauss.compile_scene(gauss.load("n_four_bar", n=3))
    signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
    state = system.state(-(np.pi / 2 - 1e-6) * signs, -2.0 * signs)
    expected = certified(system, state)
    assert np.abs(system.accelerations(state) - expected).max() <= 1e-9 * np.abs(expected).max()


def test_laws_are_called_as_they_are_now():
    strength = [1.0]
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=lambda t: strength[0] * np.cos(t))
    scene.joint_spring("spring", "J2", stiffness=3.0, damping=0.5)
    system = gauss.compile_scene(scene)
    (state,), _ = mechanisms.consistent_states(system, 1)
    before = system.forward_dynamics
    for strength[0] in (1.0, -20.0):
        expected = certified(system, state)
        assert off(system.accelerations(state), expected) <= ROUNDING
        made = system.forward_dynamics
        assert off(made(state.q, state.v, np.zeros(2), None, state.t), expected) <= ROUNDING
    assert off(before(state.q, state.v, np.zeros(2), None, state.t), expected) > 0.1


def test_laws_off_their_limits_count_once_where_the_recursion_answers():
    scene = mechanisms.chain(HEAVY_TIP)
    scene.drive(next(iter(scene.joints)), torque=lambda t: 1e9 * np.cos(t))
    system = gauss.compile_scene(scene)
    (state,), (load,) = mechanisms.consistent_states(system, 1)
    assert off(system.accelerations(state, load), certified(system, state, load)) <= ROUNDING


@pytest.mark.parametrize("what", ["law on a body", "law of the motion"])
def test_opaque_laws_are_called_beside_machine_code(what):
    scene = mechanisms.rods(2)
    if what == "law on a body":
        scene.force("wind", next(iter(scene.bodies)), force=lambda t: (t, 0.0, 1.0 if float(t) > 0 else 0.0))
    if what == "law of the motion":
        scene.drive("J1", torque=lambda t, motion: float(motion.coordinate("J2")))
    system = gauss.compile_scene(scene)
    (state,), (load,) = mechanisms.consistent_states(system, 1)
    assert off(system.accelerations(state, load), certified(system, state, load)) <= ROUNDING
    with pytest.raises(SimulationError, match="system.accelerations"):
        _ = system.forward_dynamics


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four-bar", "coupled", "slider-crank", "bricard", "triangle"])
def test_a_state_off_the_constraints_is_judged_by_the_recursion(name):
    system = gauss.compile_scene(SCENES[name]() if name in SCENES else triangle())
    start = system.initial_state()
    assert not obstacles(system)
    one = np.eye(system.n_v)[1]
    for dq, dv in ((1e-7, 0.0), (0.0, 1.0), (0.1, 0.0)):
        state = system.state(retract(system, start.q, dq * one), start.v + dv * one)
        try:
            expected = certified(system, state)
        except SimulationError as error:
            with pytest.raises(SimulationError) as found:
                system.accelerations(state)
            assert str(found.value) == str(error)
        else:
            assert np.array_equal(system.accelerations(state), expected)


def triangle():
    """A rigid triangle of rods that swings as one body."""
    scene = gauss.Scene("triangle", gravity=(0, -9.81, 0))
    for name, at in (("one", (0, 0, 0)), ("two", (1, 0, 0)), ("three", (0.5, 0.75, 0))):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.2, 0.1, 0), position=at)
    scene.revolute("hinge", "ground", "one", at=(0, 0, 0), axis=(0, 0, 1))
    scene.revolute("a", "one", "two", at=(1, 0, 0), axis=(0, 0, 1))
    scene.revolute("b", "two", "three", at=(0.5, 0.75, 0), axis=(0, 0, 1))
    scene.revolute("c", "three", "one", at=(0.25, 0.5, 0), axis=(0, 0, 1))
    return scene


def test_quaternions_are_made_unit_or_refused():
    system = gauss.compile_scene(gauss.load("free_body"))
    f, v, none = system.forward_dynamics, np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), np.zeros(6)
    q = np.array([0.1, 0.2, 0.3, 0.8, 0.0, 0.6, 0.0])
    nearly = np.concatenate([q[:3], (1.0 + 4e-7) * q[3:]])
    assert off(f(nearly, v, none), f(q, v, none)) <= ROUNDING
    with pytest.raises(StateError, match="quaternion .* of joint"):
        f(np.concatenate([q[:3], 2.0 * q[3:]]), v, none)


def test_wrong_input_is_refused():
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=lambda t: np.inf if t > 1 else 0.0)
    system = gauss.compile_scene(scene)
    state = system.state([0.1, 0.2])
    with pytest.raises(StateError, match=r"load: .*J1, J2.*\(3,\)"):
        system.accelerations(state, np.zeros(3))
    with pytest.raises(StateError, match="load: expected 2 finite numbers"):
        system.accelerations(state, [0.0, np.nan])
    with pytest.raises(StateError, match="q: expected 2 numbers"):
        system.accelerations(gauss.State(0.0, np.zeros(3), np.zeros(2)))
    with pytest.raises(StateError, match="q: expected 2 finite numbers"):
        system.accelerations(gauss.State(0.0, np.array([np.nan, 0.0]), np.zeros(2)))
    with pytest.raises(SceneError, match="its law returned"):
        system.accelerations(gauss.State(2.0, state.q, state.v))


def test_a_part_that_is_no_number_is_not_passed_over():
    f = gauss.compile_scene(gauss.load("gear_pair")).forward_dynamics
    with pytest.raises(StateError, match="v: expected 2 finite numbers"):
        f([0.0, 0.0], [np.inf, 0.0], [0.0, 0.0])
    scene = gauss.Scene("apart", gravity=(0, 0, -9.81))
    for name in ("one", "two"):
        scene.body(name, mass=1.0, inertia=(0.1, 0.1, 0.1), com=(0.0, 0.0, -0.5))
        scene.revolute(f"hinge of {name}", "ground", name, axis=(0, 1, 0))
    f = gauss.compile_scene(scene).forward_dynamics
    assert np.isfinite(f([0.1, 0.2], [0.0, 0.0], [0.0, 0.0])).all()
    with pytest.raises(StateError, match="q: expected 2 finite numbers"):
        f([0.1, np.nan], [0.0, 0.0], [0.0, 0.0])
