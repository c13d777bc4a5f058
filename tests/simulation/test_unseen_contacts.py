"""Shapes that fixed steps carry through one another: where no step sees their contact, a warning names them."""

import warnings

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


def thrown(wall: str, friction: float, speed: float):
    """Motion of a ball that is thrown at a wall, without gravity."""
    scene = gauss.Scene("thrown", gravity=(0.0, 0.0, 0.0))
    free_body(scene, "A", 0.1, (0.0, 0.0, 5.0), rate=(0.0, 0.0, -speed, 0.0, 0.0, 0.0))
    scene.sphere("ball", "A", RADIUS)
    WALLS[wall](scene)
    scene.contact("touch", "ball", "wall", friction=friction)
    return gauss.simulate(scene, 50.0 / speed, integrator="time_stepping", step=STEP, progress=False)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("wall", WALLS)
def test_shapes_that_move_by_their_thickness_in_a_step_are_warned_of(wall, friction):
    with pytest.warns(ContactLawWarning, match="'ball' and 'wall'|'wall' and 'ball'"):
        assert thrown(wall, friction, PASSING * (THICK + 2 * RADIUS) / STEP).q[-1][2] < STOPPED
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactLawWarning)
        assert thrown(wall, friction, 0.5 * (THICK + 2 * RADIUS) / STEP).q[-1][2] > STOPPED
