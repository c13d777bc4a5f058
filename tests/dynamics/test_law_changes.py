"""Laws that change after a scene was compiled: motions follow them, or say that the scene must be compiled anew."""

import numpy as np
import pytest

import gauss
from gauss.errors import SceneError

pytestmark = pytest.mark.slow


def cart():
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.body("cart", 1.0)
    scene.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
    scene.start("rail", rate=1.0)
    return scene


class Setting:
    """A number that somebody turns."""

    k = 0.5


FOLLOWED = {
    "drive": (lambda s, x: s.drive("rail", force=lambda t: x.k), lambda k: 1.0 + k / 2),
    "force": (lambda s, x: s.force("push", "cart", lambda t, motion: (x.k, 0, 0)), lambda k: 1.0 + k / 2),
    "traced drive": (lambda s, x: s.drive("rail", force=lambda t: 2 * x.k * t), lambda k: 1.0 + k / 3),
    "joint friction": (lambda s, x: s.joint_friction("rail", lambda t: x.k), lambda k: 1.0 - k / 2),
}
WRITTEN = {
    "displacement": lambda s, x: s.drive("rail", displacement=lambda t: x.k * t),
    "speed": lambda s, x: s.drive("rail", speed=lambda t: x.k),
    "limited speed": lambda s, x: s.drive("rail", speed=lambda t: x.k, limit=1.0),
    "gap": lambda s, x: s.one_sided("wall", lambda at: x.k - at.coordinate("rail")),
    "constraint": lambda s, x: s.constrain("tie", velocity=lambda at: at.rate("rail") - x.k),
    "guide": lambda s, x: s.guide("guide", "cart", lambda t: (x.k * t, 0, 0), along=((1, 0, 0),)),
}
USES = {
    "simulate": lambda system: gauss.simulate(system, 0.1),
    "time stepping": lambda system: gauss.simulate(system, 0.1, integrator="time_stepping", step=0.01),
    "accelerations": lambda system: system.accelerations(system.state()),
    "initial state": lambda system: system.initial_state(),
    "forward dynamics": lambda system: system.forward_dynamics,
    "rollout": lambda system: gauss.rollout(system, np.zeros((2, 1)), np.zeros((2, 1)), step=0.01, steps=2),
    "assemble": lambda system: gauss.assemble(system, system.state()),
    "derivatives": lambda system: gauss.derivatives(system, system.state()),
}


@pytest.mark.parametrize("case", FOLLOWED)
def test_motions_follow_efforts(case):
    add, expected = FOLLOWED[case]
    scene, setting = cart(), Setting()
    add(scene, setting)
    system = gauss.compile_scene(scene)
    for k in (0.5, 0.25, 0.5):
        setting.k = k
        assert abs(gauss.simulate(system, 1.0).q[-1, 0] - expected(k)) <= 1e-9  # closed form, unit mass and rate


@pytest.mark.parametrize("case", WRITTEN)
def test_functions_that_became_rows_may_not_change(case):
    scene, setting = cart(), Setting()
    WRITTEN[case](scene, setting)
    system = gauss.compile_scene(scene)
    before = gauss.simulate(system, 0.2).q[-1]
    setting.k = 0.75
    for use in USES.values():
        with pytest.raises(SceneError, match="compile the scene anew"):
            use(system)
    assert gauss.simulate(scene, 0.2).t[-1] == 0.2  # a scene is compiled as it is now
    setting.k = 0.5
    assert np.array_equal(gauss.simulate(system, 0.2).q[-1], before)
