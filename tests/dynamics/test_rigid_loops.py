"""Structures with several poses: reduced to a rigid body in one of them, and no silent fault in the others."""

import numpy as np
import pytest

import gauss
from gauss.errors import StateError

CERTIFIED = 1e-9  # of accelerations, relative to the largest


def _dyad():
    """Two rods on a hinged base, which meet above the line between their hinges."""
    scene = gauss.Scene("dyad", gravity=(0.0, 0.0, -9.8))
    scene.body("base", 2.0, (0.1, 0.2, 0.2), position=(0.5, 0.0, 0.0))
    scene.revolute("root", "ground", "base", at=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    left, right, top = np.array([[0.2, 0.0, 0.0], [0.9, 0.0, 0.0], [0.6, 0.0, 0.4]])
    for name, end in (("one", left), ("two", right)):
        scene.body(name, 1.0, (0.02, 0.03, 0.03), position=tuple((top + end) / 2.0))
    for name, parent, child, at in (
        ("left", "base", "one", left),
        ("top", "one", "two", top),
        ("right", "two", "base", right),
    ):
        scene.revolute(name, parent, child, at=tuple(at), axis=(0.0, 1.0, 0.0))
    return scene


def _states(system):
    """States in the pose of the scene, turned by whole turns, and in the mirrored one."""
    one, two = 2.0 * np.arctan2(0.4, 0.4), 2.0 * np.arctan2(0.4, 0.3)
    found = []
    for angles in (np.zeros(3), np.array([2.0, -2.0, 0.0]) * np.pi, np.array([one, -one - two, two])):
        found.append(system.initial_state(np.concatenate([[0.3], angles]), np.array([0.7, 0.0, 0.0, 0.0])))
    return found


def test_accelerations_are_those_of_the_pose_of_the_state():
    system = gauss.compile_scene(_dyad())
    assert len(system.subsystems) == 1 and len(system.subsystems[0].joints) == 1
    *_, same, mirrored = [gauss.solve(gauss.assemble(system, state)).qdd for state in _states(system)]
    assert abs(same[0] - mirrored[0]) > 0.01 * abs(same[0])
    for state in _states(system):
        exact = gauss.solve(gauss.assemble(system, state)).qdd
        found = system.forward_dynamics(state.q, state.v, np.zeros(system.n_v))
        assert np.abs(found - exact).max() <= CERTIFIED * np.abs(exact).max()


def test_whole_turns_are_no_other_pose():
    system = gauss.compile_scene(_dyad())
    own, turned, mirrored = _states(system)
    motions = [gauss.simulate(system, 0.1, state=state, progress=False) for state in (own, turned)]
    assert motions[0].q[-1, 0] == pytest.approx(motions[1].q[-1, 0], rel=CERTIFIED)


def test_other_poses_are_refused_where_the_reduced_system_is_taken():
    system = gauss.compile_scene(_dyad())
    own, _, mirrored = _states(system)
    q, v = (np.tile(part, (2, 1)) for part in (mirrored.q, mirrored.v))
    simulator = gauss.Simulator(system, 1e-3)
    simulator.reset(own)
    for call in (
        lambda: gauss.simulate(system, 0.1, state=mirrored, progress=False),
        lambda: gauss.rollout(system, q, v, integrator="rk4", step=1e-3, steps=10),
        lambda: simulator.reset(mirrored),
        lambda: gauss.derivatives(system, mirrored),
        lambda: gauss.linearise(system, mirrored),
    ):
        with pytest.raises(StateError, match="'left', 'top', 'right' cannot move"):
            call()
