"""Structures with several poses: reduced to a rigid body in one of them, and no silent fault in the others."""

import numpy as np
import pytest

import gauss
from gauss import servo
from gauss.dynamics.term_table import TERMS
from gauss.errors import StateError

CERTIFIED = 1e-9  # of accelerations, relative to the largest
SAME = 1e-12  # relative: equal formulae in joint coordinates that differ by a constant
LEFT, RIGHT = 2.0 * np.arctan2(0.4, 0.4), 2.0 * np.arctan2(0.4, 0.3)  # rad, by which the rods turn to their mirror image


def _dyad(mirrored: bool = False):
    """Two rods on a hinged base, which meet above the line between their hinges, or below it."""
    scene = gauss.Scene("dyad", gravity=(0.0, 0.0, -9.8))
    scene.body("base", 2.0, (0.1, 0.2, 0.2), position=(0.5, 0.0, 0.0))
    scene.revolute("root", "ground", "base", at=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    left, right, top = np.array([[0.2, 0.0, 0.0], [0.9, 0.0, 0.0], [0.6, 0.0, -0.4 if mirrored else 0.4]])
    for name, end, turned in (("one", left, LEFT), ("two", right, -RIGHT)):
        rotation = (0.0, turned if mirrored else 0.0, 0.0)
        scene.body(name, 1.0, (0.02, 0.03, 0.03), position=tuple((top + end) / 2.0), rotation=rotation)
    for name, parent, child, at in (
        ("left", "base", "one", left),
        ("top", "one", "two", top),
        ("right", "two", "base", right),
    ):
        scene.revolute(name, parent, child, at=tuple(at), axis=(0.0, 1.0, 0.0))
    return scene


def _states(system):
    """States in the pose of the scene, turned by whole turns, and in the mirrored one."""
    found = []
    for angles in (np.zeros(3), np.array([2.0, -2.0, 0.0]) * np.pi, np.array([LEFT, -LEFT - RIGHT, RIGHT])):
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


@pytest.mark.slow
def test_other_poses_are_refused_where_the_reduced_system_is_taken():
    system = gauss.compile_scene(_dyad())
    own, _, mirrored = _states(system)
    q, v = (np.tile(part, (2, 1)) for part in (mirrored.q, mirrored.v))
    simulator, many = gauss.Simulator(system, 1e-3), gauss.SimulatorBatch(system, 1e-3, 2)
    prepared, model = gauss.prepare(system, 0.1), gauss.prepare_linear_model(system)
    driven = _dyad()
    driven.input("motor", "root", limits=1.0)
    driven = gauss.compile_scene(driven)
    held = servo.Servo(
        system, [servo.ServoRelation("turns", lambda t, motion: motion.coordinate("root") - t)], [servo.Motor("m", "root")]
    )
    simulator.reset(own)
    for call in (
        lambda: gauss.simulate(system, 0.1, state=mirrored, progress=False),
        lambda: gauss.rollout(system, q, v, integrator="rk4", step=1e-3, steps=10),
        lambda: simulator.reset(mirrored),
        lambda: gauss.derivatives(system, mirrored),
        lambda: gauss.linearise(system, mirrored),
        lambda: many.reset(q, v),
        lambda: prepared(mirrored.q, mirrored.v),
        lambda: model(mirrored.q, 0.0 * mirrored.v),
        lambda: gauss.sensitivities(system, 0.1, step=0.01, state=mirrored),
        lambda: gauss.motion_gradient(system, 0.1, lambda q, v: q[0], step=0.01, state=mirrored),
        lambda: gauss.optimal_motion(driven, 0.1, start=mirrored),
        lambda: gauss.ilqr(driven, 0.1, step=0.01, start=mirrored, cost=lambda t, q, v, u: q[0] ** 2),
        lambda: servo.simulate(held, 0.1, state=mirrored, progress=False),
        lambda: servo.solve(held, mirrored),
    ):
        with pytest.raises(StateError, match="'left', 'top', 'right' cannot move"):
            call()


CALLS = [(name, ()) for name in TERMS if name != "null_space"]
CALLS += [(name, ("root",)) for name in TERMS]


@pytest.mark.slow
@pytest.mark.parametrize("name, independent", CALLS, ids=lambda part: part if isinstance(part, str) else "".join(part))
def test_functions_of_a_state_are_those_of_its_pose_or_refuse_it(name, independent):
    """The twin is written in the mirrored pose: its coordinates are less by those of this pose, its functions the same."""
    term, systems = TERMS[name], [gauss.compile_scene(_dyad(mirrored)) for mirrored in (False, True)]
    wanted = name + (":one" if term.of_frame else ":mass:one" if term.of_parameter else "")
    *_, mirrored = _states(systems[0])
    coordinates = mirrored.q, np.concatenate([mirrored.q[:1], np.zeros(3)])
    allowed = np.array([1.5, 0.0, 0.0, 0.0])
    options = {"independent": independent} if independent else {}
    given = [
        [{"q": q, "v": mirrored.v, "a": allowed, "l": 0.3 * allowed}[letter] for letter in term.arguments]
        for q in coordinates
    ]
    functions = [system.function(wanted, **options) for system in systems]
    if term.of_loops or independent:
        for rows in (given[0], [np.tile(part, (3, 1)) for part in given[0]]):
            with pytest.raises(StateError, match="cannot move"):
                functions[0](*rows)
        return
    found = [function(*each) for function, each in zip(functions, given, strict=True)]
    if name == "loop_constraints":  # whose rows are in axes of the bodies: what they say is compared
        residual, K, bias = found[0]
        assert np.abs(residual).max() < SAME and np.abs(K @ mirrored.v).max() < SAME
        acceleration = systems[0].accelerations(mirrored)
        assert np.abs(K @ acceleration + bias).max() < CERTIFIED
        return
    for one, two in zip(*(part if isinstance(part, tuple) else (part,) for part in found), strict=True):
        assert one == pytest.approx(two, rel=SAME, abs=SAME)
