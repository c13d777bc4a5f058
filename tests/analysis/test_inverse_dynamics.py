"""Inverse dynamics with loops against prescribed motions, Pinocchio's rnea, and forward dynamics."""

import numpy as np
import pinocchio as pin
import pytest

import gauss
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.errors import StateError
from gauss.system import random_state
from tests.support import mechanisms

ROUNDING = 1e-11  # relative, of two routes through the same state


@pytest.mark.peer
@pytest.mark.parametrize("seed", range(3))
def test_an_open_chain_agrees_with_rnea(seed):
    system, rng = gauss.compile_scene(gauss.load("spatial_chain", n=6, seed=seed)), np.random.default_rng(seed)
    state, qdd = random_state(system, rng), rng.standard_normal(system.n_v)
    found = gauss.inverse_dynamics(system, state, qdd, system.coordinates)
    model = twin(system).model
    expected = pin.rnea(model, model.createData(), state.q, state.v, qdd)
    assert found.is_unique and found.drives == system.coordinates
    assert np.abs(found.forces - expected).max() <= ROUNDING * np.abs(expected).max()


SCENES = {
    "four-bar": (mechanisms.four_bar, ["A"]),
    "slider-crank": (lambda: gauss.load("slider_crank"), ["guide"]),
    "ladder": (lambda: gauss.load("n_four_bar", n=2), ["A1"]),
    "cardan": (lambda: gauss.load("cardan"), ["cross.angle1"]),  # which stands still at the reference configuration
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_forward_dynamics_undone(scene):
    """Accelerations under a drive force give this force back, wherever in the loop the drive sits."""
    make, drives = SCENES[scene]
    scene = make()
    scene.start(next(iter(scene.joints)), position=0.7, rate=2.0)
    system = gauss.compile_scene(scene)
    state, load = system.initial_state(), np.zeros(system.n_v)
    load[[system.coordinates.index(name) for name in drives]] = 7.0
    found = gauss.inverse_dynamics(system, state, system.accelerations(state, load), drives)
    assert found.is_unique
    assert found.forces == pytest.approx([7.0], rel=1e-9)


@pytest.mark.slow
def test_a_prescribed_motion_takes_the_same_force():
    scene = mechanisms.four_bar()
    scene.starts.clear()
    scene.drive("A", angle=lambda t: 10 * t + np.sin(t))
    trajectory = gauss.simulate(scene, 0.2, times=[0.0, 0.1, 0.2])
    free = gauss.compile_scene(mechanisms.four_bar())
    for k, torque in enumerate(gauss.drive_forces(trajectory, "A")):
        state = trajectory.state(k)
        acceleration = trajectory.system.accelerations(state)
        assert gauss.inverse_dynamics(free, state, acceleration, ["A"]).forces[0] == pytest.approx(torque, rel=1e-9)


def test_redundant_drives_share_by_their_weights():
    """Cranks of a parallelogram turn alike: they share in inverse proportion to their weights."""
    scene = gauss.load("n_four_bar", n=1)
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    qdd = system.accelerations(state, np.array([4.0, 0, 0, 0]))
    alone = gauss.inverse_dynamics(system, state, qdd, ["A0"])
    equal = gauss.inverse_dynamics(system, state, qdd, ["A0", "A1"])
    shared = gauss.inverse_dynamics(system, state, qdd, ["A0", "A1"], weights=[1.0, 3.0])
    assert alone.is_unique and not equal.is_unique
    assert equal.forces == pytest.approx([alone.forces[0] / 2] * 2, rel=1e-9)
    assert shared.forces == pytest.approx([0.75 * alone.forces[0], 0.25 * alone.forces[0]], rel=1e-9)


def test_what_the_drives_cannot_do_is_said():
    system = gauss.compile_scene(mechanisms.rods(2))
    state = system.state([0.3, 0.4])
    with pytest.raises(StateError, match="J1 cannot give this motion"):
        gauss.inverse_dynamics(system, state, [1.0, 1.0], ["J1"])
    with pytest.raises(StateError, match="weights"):
        gauss.inverse_dynamics(system, state, [1.0, 1.0], ["J1"], weights=[-1.0])
    loop = gauss.compile_scene(mechanisms.four_bar())
    with pytest.raises(StateError, match="constraint 'D' has a residual"):
        gauss.inverse_dynamics(loop, loop.initial_state(), [1.0, 0, 0, 0], ["A"])


def test_a_drive_that_holds_nothing_is_named():
    """At its dead point a slider cannot turn the crank."""
    system = gauss.compile_scene(gauss.load("slider_crank"))
    state = system.initial_state()
    with pytest.raises(StateError, match="guide cannot give this motion"):
        gauss.inverse_dynamics(system, state, system.accelerations(state, [5.0, 0, 0, 0]), ["guide"])
