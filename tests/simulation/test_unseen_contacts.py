"""Shapes that fixed steps carry through one another: where no step sees their contact, a warning names them."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import free_body
from gauss.errors import ContactLawWarning

RADIUS, STEP = 0.5, 0.01
THICK = 1.0  # m, of the walls
WALLS = {
    "box": lambda scene: scene.box("wall", "ground", (4.0, 4.0, THICK)),
    "terrain": lambda scene: scene.height_field("wall", "ground", np.zeros((5, 5)), (4.0, 4.0), depth=THICK),
}
PASSING = 3.3  # of the speed at which a step is as long as both are thick: no step ends in the wall
STOPPED = 0.0  # m: lowest place of a ball that does not pass


def thrown(wall: str, friction: float, speed: float) -> gauss.Scene:
    """Ball that is thrown at a wall, without gravity."""
    scene = gauss.Scene("thrown", gravity=(0.0, 0.0, 0.0))
    free_body(scene, "A", 0.1, (0.0, 0.0, 5.0), rate=(0.0, 0.0, -speed, 0.0, 0.0, 0.0))
    scene.sphere("ball", "A", RADIUS)
    WALLS[wall](scene)
    scene.contact("touch", "ball", "wall", friction=friction)
    return scene


def simulated(scene, steps):
    """Last height of the ball by :func:`gauss.simulate`."""
    return gauss.simulate(scene, steps * STEP, integrator="time_stepping", step=STEP, progress=False).q[-1][2]


def rolled_out(scene, steps):
    """By a rollout of two motions, of which one is at rest."""
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    rates = np.array([np.zeros(6), start.v])
    made = gauss.rollout(system, np.array([start.q] * 2), rates, integrator="time_stepping", steps=steps, step=STEP)
    return made.q[1, -1, 2]


def stepped(scene, steps):
    """By a simulator, step by step."""
    simulator = gauss.Simulator(scene, STEP)
    for _ in range(steps):
        simulator.step()
    return simulator.state.q[2]


def stepped_at_once(scene, steps):
    """By a simulator in one call."""
    simulator = gauss.Simulator(scene, STEP)
    simulator.step(n=steps)
    return simulator.state.q[2]


def stepped_together(scene, steps):
    """By a batch of simulators."""
    many = gauss.SimulatorBatch(scene, STEP, 3)
    many.step(n=steps)
    return many.q[1, 2]


WAYS = [simulated, rolled_out, stepped, stepped_at_once, stepped_together]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("wall", WALLS)
def test_shapes_that_move_by_their_thickness_in_a_step_are_warned_of(wall, friction, way):
    speed, steps = PASSING * (THICK + 2 * RADIUS) / STEP, 9
    with pytest.warns(ContactLawWarning, match="'ball' and 'wall'|'wall' and 'ball'"):
        assert way(thrown(wall, friction, speed), steps) < STOPPED
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactLawWarning)
        assert way(thrown(wall, friction, 0.15 * speed), 7 * steps) > STOPPED


@pytest.mark.parametrize("way", [stepped, stepped_at_once, stepped_together])
def test_shapes_that_become_fast_are_warned_of(way):
    fall = PASSING * (THICK + 2 * RADIUS) / STEP**2
    scene = replace(thrown("box", 0.0, 0.0), gravity=(0.0, 0.0, -fall))
    with pytest.warns(ContactLawWarning, match="'ball' and 'wall'|'wall' and 'ball'"):
        assert way(scene, 3) < STOPPED


MADE = {
    "one": lambda scene: gauss.Simulator(scene, STEP),
    "batch": lambda scene: gauss.SimulatorBatch(scene, STEP, 2),
    "in turn": lambda scene: gauss.SimulatorBatch(_pulled(scene), STEP, 2),
}


def _pulled(scene: gauss.Scene) -> gauss.Scene:
    """The scene with an opaque law, for which a batch makes its steps one motion after the other."""
    scene.force("pull", "A", lambda t: (1e-3 * float(t), 0.0, 0.0))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("made", MADE)
def test_a_restored_motion_is_watched_as_it_was(made):
    speed = PASSING * (THICK + 2 * RADIUS) / STEP
    fast, slow = (MADE[made](thrown("box", 0.0, share * speed)) for share in (1.0, 0.15))
    begun = fast.snapshot()
    for _ in range(2):
        with pytest.warns(ContactLawWarning, match="'ball' and 'wall'|'wall' and 'ball'"):
            fast.step()
        after = fast.snapshot()
        fast.restore(begun)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactLawWarning)
        fast.restore(after)
        fast.step()
        fast.restore(slow.snapshot())
        fast.step(n=3)
    with pytest.warns(ContactLawWarning):
        slow.restore(begun)
        slow.step()
