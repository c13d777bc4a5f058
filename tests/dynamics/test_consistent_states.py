"""Consistent starts: assembled from rough guesses, limits and kept values respected, refused in clear words."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.initial_states import RESIDUAL_THRESHOLD
from gauss.dynamics.kinematics import kinematics
from gauss.errors import ArgumentError, AssemblyError, InconsistentConstraintsWarning, SceneError, StateError
from gauss.system import random_state
from tests.support import mechanisms

MET_RESIDUAL = 1e-12  # rad, m: a closed gap
SCENES = {
    "four-bar": mechanisms.four_bar,
    "slider-crank": lambda: gauss.load("slider_crank"),
    "cardan": lambda: gauss.load("cardan"),
    "ladder": lambda: gauss.load("n_four_bar", n=3),
}


def _gap(system, state):
    return np.abs(position_residual(kinematics(system, state))).max()


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_any_guess_is_assembled(scene):
    system, rng = gauss.compile_scene(SCENES[scene]()), np.random.default_rng(0)
    for _ in range(5):
        guess = random_state(system, rng)
        state = system.initial_state(guess.q, guess.v)
        assert _gap(system, state) <= MET_RESIDUAL
        compulsion = gauss.assemble(system, state)
        rates = compulsion.A @ kinematics(system, state).quasi_velocities() + compulsion.B @ state.v
        assert np.abs(rates).max() <= MET_RESIDUAL * (1 + np.abs(state.v).max())


def test_the_step_is_the_least_in_the_mass_metric():
    """Of all motions that meet the rates, the one found is nearest: the change is orthogonal to every allowed motion."""
    system = gauss.compile_scene(mechanisms.four_bar())
    pose = system.initial_state()
    guess = np.array([1.0, -2.0, 0.5, 3.0])
    found = system.initial_state(pose.q, guess)
    allowed = system.initial_state(pose.q, found.v * 0 + np.array([1.0, 0, 0, 0]))

    def momenta(v):
        return system.Phi * kinematics(system, system.state(pose.q, v)).quasi_velocities()

    change = momenta(found.v) - momenta(guess)
    direction = kinematics(system, allowed).quasi_velocities()
    assert abs(change @ direction) <= 1e-12 * np.abs(momenta(guess)).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "cardan", "rolling_disk", "planetary_gears"])
def test_a_state_that_meets_the_constraints_stays_as_it_is(name):
    """By numpy first, then by machine code; a state off the constraints is projected by either."""
    system = gauss.compile_scene(gauss.load(name))
    met, rng = system.initial_state(), np.random.default_rng(0)
    off = system.state(met.q, met.v + 1e-6 * rng.uniform(-1.0, 1.0, system.n_v))
    goal = system.projected(off)
    assert not np.array_equal(goal.v, off.v)
    for _ in range(RESIDUAL_THRESHOLD + 2):
        same, again = system.projected(met), system.projected(off)
        assert np.array_equal(same.q, met.q) and np.array_equal(same.v, met.v)
        assert np.array_equal(again.q, goal.q) and np.array_equal(again.v, goal.v)


def test_who_writes_to_an_initial_state_changes_no_other():
    system = gauss.compile_scene(gauss.load("four_bar"))
    first = system.initial_state()
    kept = first.q.copy()
    first.q[:] = 9.0
    assert np.array_equal(system.initial_state().q, kept)
    assert np.array_equal(gauss.simulate(system, 0.01, progress=False).q[0], kept)


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.0, 4.0])
def test_what_is_kept_keeps_its_value(angle):
    system = gauss.compile_scene(mechanisms.four_bar())
    state = system.initial_state([angle, 0, 0, 0], [3.0, 0, 0, 0], keep=["A"])
    assert _gap(system, state) <= MET_RESIDUAL
    assert state.q[0] == pytest.approx(angle, abs=1e-12) and state.v[0] == pytest.approx(3.0, abs=1e-12)


def test_one_joint_that_is_kept_is_named_by_a_text():
    system = gauss.compile_scene(mechanisms.four_bar(twice=True))
    named, listed = (system.initial_state(keep=keep) for keep in ("again", ["again"]))
    assert np.array_equal(named.q, listed.q) and np.array_equal(named.v, listed.v)
    with pytest.raises(ArgumentError, match="keep"):
        system.initial_state(keep=3)


@pytest.mark.slow
def test_what_cannot_be_kept_is_refused_with_the_closest_pose():
    """A rocker of 0.7 m swings over 1.22 rad only: it cannot stand at right angles to its range."""
    system = gauss.compile_scene(mechanisms.four_bar())
    with pytest.raises(AssemblyError, match="'D'.*D keeps its value") as caught:
        system.initial_state([0.0, 0.0, 0.0, -2.0], keep=["D"])
    assert caught.value.state.q.shape == (4,) and _gap(system, caught.value.state) > 1e-2
    assert "D" in caught.value.violations


@pytest.mark.slow
def test_limits_are_kept():
    """The elbow of a two-link chain whose tip is held: without a limit it bends up, with one it bends down."""

    def elbow(limits):
        scene = gauss.Scene("elbow", gravity=(0, -9.81, 0))
        for name, x in (("upper", 0.0), ("lower", 1.0)):
            scene.body(name, 1.0, mechanisms.SLENDER, com=(0.5, 0, 0), position=(x, 0, 0))
        scene.revolute("shoulder", "ground", "upper")
        scene.revolute("elbow", "upper", "lower", at=(1, 0, 0), limits=limits)
        scene.coincident("hand", "lower", "ground", at=(1, 0, 0), other_at=(1.2, 0.3, 0))
        system = gauss.compile_scene(scene)
        return system.initial_state([0.5, -0.3])

    assert elbow(None).q[1] < -1.0
    bent = elbow((0.0, 2.0))
    assert 1.0 < bent.q[1] <= 2.0
    with pytest.raises(AssemblyError, match="'hand'.*At a limit: elbow"):
        elbow((-0.1, 0.1))


def test_limits_are_checked():
    scene = gauss.Scene("s")
    scene.body("a", 1.0, (0.1, 0.1, 0.1))
    with pytest.raises(SceneError, match="lowest and highest"):
        scene.revolute("A", "ground", "a", limits=(1.0, -1.0))
    with pytest.raises(SceneError, match="of a ball joint"):
        scene.ball("A", "ground", "a", limits=(0.0, 1.0))


@pytest.mark.slow
def test_every_constraint_that_cannot_be_met_is_named():
    scene = mechanisms.rods(2)
    scene.distance("far", "rod2", "ground", at=(1, 0, 0), length=2.5)
    scene.distance("farther", "rod2", "ground", at=(1, 0, 0), length=3.0)
    system = gauss.compile_scene(scene)
    with pytest.raises(AssemblyError, match="'farther' off by 0.*'far' off by") as caught:
        system.initial_state()
    assert list(caught.value.violations) == ["farther", "far"]
    best = system.initial_state(least_violation=True)
    assert 0.1 < _gap(system, best) < 1.0


def test_rates_that_contradict_each_other_are_named():
    scene = mechanisms.rods(1)
    scene.drive("J1", speed=1.0, name="slow")
    scene.drive("J1", speed=1.5, name="fast")
    with pytest.raises(AssemblyError, match="'(slow|fast)'.*in its rates"):
        gauss.compile_scene(scene).initial_state()


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1e-9, 1e-7])
def test_noise_of_typed_digits_is_used_and_said(noise):
    """A hinge given twice, the second a little off: the motion is that of one hinge, within the noise."""
    scene = mechanisms.rods(1)
    scene.coincident("again", "rod1", "ground", other_at=(0, 0, noise))
    system = gauss.compile_scene(scene)
    with pytest.warns(InconsistentConstraintsWarning, match="'again' off by"):
        state = system.initial_state()
    assert system.accelerations(state) == pytest.approx(
        gauss.compile_scene(mechanisms.rods(1)).accelerations(system.state()), rel=1e-6
    )


def test_larger_contradictions_are_refused():
    scene = mechanisms.rods(1)
    scene.coincident("again", "rod1", "ground", other_at=(0, 0, 1e-4))
    with pytest.raises(AssemblyError, match="'again' off by 0.0001"):
        gauss.compile_scene(scene).initial_state()


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.3, -1.0])
def test_a_four_bar_has_two_modes(angle):
    """The coupler's end lies where two circles meet: C = mode · arccos(…) on either side of B–D."""
    system = gauss.compile_scene(mechanisms.four_bar())
    start = system.initial_state()
    modes = gauss.assembly_modes(system, ["A"], system.state([angle, *start.q[1:]]))
    assert len(modes) == 2
    B = 0.4 * np.exp(1j * angle)
    reach = 1.2 - B
    beta = np.arccos((1.0 + abs(reach) ** 2 - 0.49) / (2 * abs(reach)))
    expected = {round(float(np.angle(np.exp(1j * (np.angle(reach) + s * beta)))), 9) for s in (1, -1)}
    found = set()
    for mode in modes:
        direction = kinematics(system, mode).rotation("coupler")[:, 0]
        found.add(round(float(np.arctan2(direction[1], direction[0])), 9))
    assert found == expected


@pytest.mark.slow
def test_modes_of_sliders_and_of_two_loops():
    assert len(gauss.assembly_modes(gauss.compile_scene(gauss.load("slider_crank")), ["A"])) == 2
    scene = mechanisms.four_bar()
    scene.body("lever", 1.0, mechanisms.SLENDER, com=(0.3, 0, 0), position=(1.9, 0, 0))
    scene.revolute("E", "ground", "lever", at=(1.9, 0, 0))
    scene.distance("rod", "rocker", "lever", at=(0.7, 0, 0), other_at=(0.6, 0, 0), length=0.8)
    assert len(gauss.assembly_modes(gauss.compile_scene(scene), ["A"])) == 4


@pytest.mark.slow
def test_modes_need_every_input_and_a_pose_that_closes():
    system = gauss.compile_scene(mechanisms.four_bar())
    with pytest.raises(StateError, match="keep 1 more of A, B"):
        gauss.assembly_modes(system, [])
    with pytest.raises(StateError, match="pose"):
        gauss.assembly_modes(system, ["D"], system.state([0, 0, 0, -2.0]))


@pytest.mark.parametrize("axial", [1e-3, 1e-9, 1e-12, 0.0])
def test_a_slender_rod_between_two_balls_starts_on_its_constraints(axial):
    """It may spin as it likes; that it has next to no inertia about its axis costs no digits of the other rates."""
    scene, axis = gauss.Scene("rod"), np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    across = 0.1 * (np.eye(3) - (1.0 - axial) * np.outer(axis, axis))
    scene.body("arm", 1.0, (0.1, 0.1, 0.1), position=(0.25, 0, 0))
    scene.body("rod", 1.0, across, position=(1.0, 0.5, 0.5))
    scene.body("lever", 1.0, (0.1, 0.1, 0.1), position=(1.5, 1.0, 1.25))
    scene.revolute("O", "ground", "arm", axis=(0, 1, 0))
    scene.ball("P", "arm", "rod", at=(0.5, 0, 0))
    scene.ball("Q", "rod", "lever", at=(1.5, 1.0, 1.0))
    scene.revolute("R", "lever", "ground", at=(1.5, 1.0, 1.5), axis=(0, 1, 0))
    system = gauss.compile_scene(scene)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        state = system.initial_state(system.reference.q, np.linspace(-3.0, 5.0, system.n_v))
    assert gauss.assemble(system, state).constraint_residual <= 1e-13


@pytest.mark.slow
def test_a_rod_without_inertia_about_its_axis_is_refused_by_name():
    """Nothing decides how it spins between two balls."""
    scene = gauss.Scene("rod")
    scene.body("rod", 1.0, (0.0, 0.1, 0.1), position=(0.5, 0, 0))
    scene.ball("P", "ground", "rod")
    scene.ball("Q", "rod", "ground", at=(1.0, 0, 0))
    with pytest.raises(gauss.errors.GaussError, match="'P'.*inertia") as caught:
        gauss.simulate(scene, 0.1)
    assert not isinstance(caught.value, AssemblyError)
    assert "without inertia in some direction (joints must carry it): rod" in gauss.compile_scene(scene).explain()
