"""Assembly from poses far from any that closes: near ones are found; starts of the user are kept, or a warning tells."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.dynamics.assembly_search import FAR_POSE, assembled, followed
from gauss.dynamics.consistent_states import consistent
from gauss.dynamics.projection import position_residual_of, relative
from gauss.errors import AssemblyError, StartWarning
from gauss.system import retract

CLOSED = 1e-10  # of the scales of the rows
REACH = (1.0, 0.8, 0.7)  # m: links of a chain
SEEDS = range(4)


def closed_chain(distance: float = 1.2) -> gauss.Scene:
    """Chain of hinges with axes in space whose tip is held by a ball joint; at zero the tip is away from it."""
    scene, previous = gauss.Scene("closed chain"), "ground"
    for i, length in enumerate(REACH):
        name, place = f"link{i}", (REACH[i - 1] if i else 0.0, 0, 0)
        scene.body(name, length, (0.01, 0.1, 0.1), com=(length / 2, 0, 0), on=previous, position=place)
        axis = ((0, 0, 1), (0, 1, 0), (0.3, 1, 0.2))[i]
        scene.revolute(f"J{i}", previous, name, frame=name, axis=axis)
        previous = name
    scene.frame("tip", previous, (REACH[-1], 0, 0))
    scene.frame("place", "ground", (distance, 0.3, 0.2))
    scene.ball("held", "ground", previous, frame="place", child_frame="tip")
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_paths_end_near_the_guess(seed):
    system = gauss.compile_scene(closed_chain())
    away = np.random.default_rng(seed).uniform(-1.0, 1.0, system.n_v)
    guess = system.state(retract(system, system.reference.q, away))
    pose = followed(system, guess)
    assert pose.is_met and relative(system, position_residual_of(system, pose.state)) <= CLOSED
    hinges = [system.joint(f"J{i}").q.start for i in range(3)]
    found = assembled(system, guess, [], restart=True)
    assert found.is_met and np.abs(found.state.q - guess.q)[hinges].max() <= FAR_POSE
    again = assembled(system, guess, [], restart=True)
    assert np.array_equal(again.state.q, found.state.q)  # deterministic


@pytest.mark.slow
def test_what_no_pose_closes_is_refused_with_its_residual():
    system = gauss.compile_scene(closed_chain(distance=9.0))
    with pytest.raises(AssemblyError, match="'held'.*starts") as refused:
        system.initial_state()
    missing = np.linalg.norm([9.0, 0.3, 0.2]) - sum(REACH)
    off = position_residual_of(system, refused.value.state)
    assert np.linalg.norm(off) == pytest.approx(missing, rel=0.2)  # the closest pose is stretched


@pytest.mark.slow
def test_a_start_that_is_kept_is_no_news():
    scene = closed_chain()
    state = gauss.compile_scene(scene).initial_state()
    system = gauss.compile_scene(scene)
    scene.start("J0", float(state.q[system.joint("J0").q.start]))
    with warnings.catch_warnings():
        warnings.simplefilter("error", StartWarning)
        found = gauss.compile_scene(scene).initial_state()
    assert found.q[0] == pytest.approx(state.q[0], abs=CLOSED)


@pytest.mark.slow
def test_a_start_that_is_changed_is_told():
    scene = closed_chain()
    scene.start("J0", 3.0)  # away from the place: the chain cannot close
    system = gauss.compile_scene(scene)
    with pytest.warns(StartWarning, match="'J0' from 3 to"):
        found = consistent(system, system.start(), ("J0",))
    assert relative(system, position_residual_of(system, found)) <= CLOSED
    for _ in range(2):  # it is not kept by its content, or it is told again
        with pytest.warns(StartWarning, match="'J0' from 3 to"):
            gauss.compile_scene(scene).initial_state()


def test_a_frame_of_the_child_is_for_loops_only():
    scene = gauss.Scene("open")
    scene.body("arm", 1.0, (1, 1, 1))
    scene.frame("tip", "arm", (1, 0, 0))
    scene.revolute("J", "ground", "arm", frame="ground", child_frame="tip")
    with pytest.raises(gauss.errors.SceneError, match="child_frame is for loops"):
        gauss.compile_scene(scene)
    for options, words in (
        ({"child_frame": "tip"}, "goes with a frame on the parent"),
        ({"frame": "ground", "child_frame": "tip", "child_at": (0, 0, 0)}, "without child_at"),
        ({"frame": "tip", "child_frame": "tip"}, "'tip' is on 'arm', not on 'ground'"),
        ({"frame": "ground", "child_frame": "top"}, "no body or frame 'top'"),
    ):
        with pytest.raises(gauss.errors.SceneError, match=words):
            scene.revolute("K", "ground", "arm", **options)
