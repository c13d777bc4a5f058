"""Forces of all samples in one pass: those of machine code are those of certified solutions, each sample is solved once."""

import pickle
import warnings

import numpy as np
import pytest

import gauss
from gauss.analysis import sample_forces
from gauss.dynamics.sample_multipliers import sample_multipliers
from gauss.errors import RecordedMotionWarning, StateError
from tests.support import mechanisms

AGREEMENT = 1e-11  # relative to the largest multiplier of the motion
SAMPLES = np.linspace(0.0, 0.2, 6)


def spatial_loop() -> gauss.Scene:
    """Four-bar with a universal joint and a ball, driven by a given law: a loop without redundant rows."""
    scene = gauss.Scene("spatial four-bar", gravity=(0, 0, -9.81))
    scene.body("crank", 1.0, (0.02, 0.03, 0.03), com=(0.2, 0, 0))
    scene.body("coupler", 2.0, (0.02, 0.2, 0.2), com=(0.5, 0, 0), position=(0.4, 0, 0))
    scene.body("rocker", 1.5, (0.06, 0.02, 0.06), com=(0, 0.3, 0), position=(1.4, -0.6, 0.2))
    scene.revolute("A", "ground", "crank", at=(0, 0, 0), axis=(0, 0, 1))
    scene.universal("B", "crank", "coupler", at=(0.4, 0, 0), axis=(0, 1, 0.5))
    scene.ball("C", "coupler", "rocker", at=(1.2, 0.3, 0.4))
    scene.revolute("D", "ground", "rocker", at=(1.4, -0.6, 0.2), axis=(0.3, 0.2, 1))
    scene.drive("A", torque=lambda t: 3.0 * gauss.math.sin(5.0 * t))
    scene.start("A", rate=2.0)
    return scene


def prescribed() -> gauss.Scene:
    """Pendulum on a cart whose motion is prescribed, with a spring to the ground."""
    scene = gauss.load("cart_pole")
    scene.drive(next(iter(scene.joints)), displacement=lambda t: 0.1 * gauss.math.sin(7.0 * t))
    return scene


MOTIONS = {
    "tree": lambda: gauss.load("random_tree", n=4, seed=3),
    "spatial loop": spatial_loop,
    "coupling": lambda: gauss.load("gear_pair"),
    "rolling": lambda: gauss.load("rolling_disk"),
    "prescribed": prescribed,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_machine_code_finds_the_multipliers_of_certified_solutions(name):
    motion = gauss.simulate(MOTIONS[name](), 0.2, times=SAMPLES, progress=False)
    found, certain = sample_multipliers(motion.system, motion.t, motion.q, motion.v)
    expected = sample_forces.sample_forces(motion, "auto").values
    assert certain.all()
    assert np.abs(found - expected).max() <= AGREEMENT * np.abs(expected).max()


def test_redundant_constraints_are_left_to_certified_solutions():
    system = gauss.compile_scene(gauss.load("slider_crank"))
    start = system.initial_state()
    assert sample_multipliers(system, np.zeros(1), start.q[None], start.v[None]) is None


@pytest.mark.slow
def test_each_sample_is_solved_once_for_all_joints(monkeypatch):
    solved, solve = [], sample_forces.solution_at
    monkeypatch.setattr(sample_forces, "solution_at", lambda *given: solved.append(given) or solve(*given))
    motion = gauss.simulate(mechanisms.rods(3), 0.2, times=SAMPLES, progress=False)
    for joint in ("J1", "J2", "J3"):
        gauss.reactions(motion, joint)
    assert len(solved) == len(SAMPLES)
    monkeypatch.setattr(sample_forces, "MANY_SAMPLES", len(SAMPLES))
    again = gauss.simulate(mechanisms.rods(3), 0.2, times=SAMPLES, progress=False)
    for joint in ("J1", "J2", "J3"):
        for one, other in zip(gauss.reactions(again, joint), gauss.reactions(motion, joint), strict=True):
            assert np.abs(one - other).max() <= AGREEMENT * 10.0  # N, N m, of rods of 1 kg and 1 m
    assert len(solved) == len(SAMPLES)


def test_forces_follow_laws_that_change():
    scale, scene = [1.0], mechanisms.rods(2)
    scene.drive("J1", torque=lambda t: scale[0] * gauss.math.cos(t))
    motion = gauss.simulate(scene, 0.1, times=[0.0, 0.1], progress=False)
    before = gauss.drive_forces(motion, "J1")
    scale[0] = 2.0
    assert np.array_equal(gauss.drive_forces(motion, "J1"), 2.0 * before)


@pytest.mark.slow
def test_a_recorded_motion_has_the_rates_and_forces_of_the_simulated_one():
    motion = gauss.simulate(gauss.load("heavy_top"), 0.1, times=np.linspace(0.0, 0.1, 201), progress=False)
    signs = np.where(np.arange(201) % 3 == 1, -1.0, 1.0)[:, None]
    q = motion.q.copy()
    for place in motion.system.quaternions.values():
        q[:, place] *= signs
    recorded = gauss.Trajectory.from_coordinates(motion.system, motion.t, q)
    assert np.abs(recorded.v - motion.v)[5:-5].max() <= 1e-6 * np.abs(motion.v).max()
    joint = motion.system.joints[0].name
    given = gauss.Trajectory.from_coordinates(motion.system, motion.t[:3], motion.q[:3], motion.v[:3])
    expected = gauss.reactions(motion, joint).force[:3]
    assert np.abs(gauss.reactions(given, joint).force - expected).max() <= AGREEMENT * max(np.abs(expected).max(), 1.0)
    assert np.array_equal(pickle.loads(pickle.dumps(given)).q, given.q)


@pytest.mark.parametrize(
    "t, q, v, words",
    [
        ([0.0], [[0.0, 0.0]], None, "at least two times"),
        ([0.0, 0.0], np.zeros((2, 2)), None, "increasing times, got t"),
        ([0.0, np.inf], np.zeros((2, 2)), None, "finite, increasing times, got t"),
        ([0.0, 1.0], np.ma.masked_array(np.zeros((2, 2)), mask=np.eye(2)), None, "expected numbers t"),
        ([0.0, 1.0], np.zeros((3, 2)), None, r"coordinates q \(k, 2\), got shapes \(2,\) and \(3, 2\)"),
        ([0.0, 1.0], "ab", None, "expected numbers t"),
        ([0.0, 1.0], np.zeros((2, 3)), None, r"coordinates q \(k, 2\), got shapes \(2,\) and \(2, 3\)"),
        ([0.0, 1.0], np.zeros((2, 2)), np.zeros((2, 1)), r"finite rates v \(2, 2\), got shape \(2, 1\)"),
    ],
)
def test_recordings_that_do_not_fit_are_refused(t, q, v, words):
    with pytest.raises(StateError, match=words):
        gauss.Trajectory.from_coordinates(gauss.compile_scene(mechanisms.rods(2)), t, q, v)


@pytest.mark.slow
def test_recordings_that_leave_the_loop_constraints_are_warned_of():
    motion = gauss.simulate(gauss.load("four_bar"), 0.1, times=np.linspace(0.0, 0.1, 101), progress=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gauss.Trajectory.from_coordinates(motion.system, motion.t, motion.q)
    noise = np.random.default_rng(0).uniform(-1e-4, 1e-4, motion.q.shape)
    with pytest.warns(RecordedMotionWarning, match="does not meet its loop constraints: at t = "):
        gauss.Trajectory.from_coordinates(motion.system, motion.t, motion.q + noise)
