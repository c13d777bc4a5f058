"""Prescribed positions that jump are refused before the motion, with the time and the size of the jump."""

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import SimulationError
from gauss.servo import Motor, Servo
from gauss.servo import simulate as simulate_servo
from tests.support import servos

pytestmark = pytest.mark.slow


def _teleports():
    step = lambda t: gm.where(t < 1.0, 1.0, 1.5)  # noqa: E731
    scene = gauss.Scene("two")
    for name in ("a", "b"):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.5, 0.0, 0.0))
    scene.prismatic("P", "ground", "a", axis=(1, 0, 0))
    scene.prismatic("Q", "a", "b", axis=(1, 0, 0))
    scene.start("Q", position=1.0)
    return scene, step


@pytest.mark.parametrize(
    "settings", [{}, {"integrator": "rk4", "step": 0.01}, {"integrator": "time_stepping", "step": 0.01}]
)
@pytest.mark.parametrize("kind", ["displacement", "distance", "guide", "constraint", "sawtooth"])
def test_positions_that_jump_are_refused_before_the_motion(kind, settings):
    """The message has name, time and size of the jump, and no step is made."""
    scene, step = _teleports()
    at = "1"
    if kind == "displacement":
        scene.drive("P", displacement=lambda t: step(t) - 1.0)
    elif kind == "sawtooth":
        scene.drive("P", displacement=lambda t: 0.5 * (t - np.floor(t)))
    elif kind == "distance":
        scene.distance("drive of P", "a", "b", length=step)
    elif kind == "guide":
        scene.guide("drive of P", "b", path=lambda t: np.array([step(t), 0.0, 0.0]), along=[(1, 0, 0)])
    else:
        scene.constrain("drive of P", position=lambda view: view.coordinate("Q") - step(view.t))
    if settings.get("integrator") == "time_stepping":
        scene.stop("P", -10.0, 10.0)
    with pytest.raises(SimulationError, match=rf"'drive of P'.* 0\.5 .*t = {at} s") as refused:
        gauss.simulate(scene, 2.0, **settings)
    assert refused.value.trajectory is None


@pytest.mark.parametrize(
    "profile",
    [lambda t: gm.where(t < 0.5, 0.0, 0.1), lambda t: gm.where(t < 0.5, 0.0, 0.1 * (t - 0.5))],
    ids=["position", "speed"],
)
def test_relations_of_servos_that_jump_are_refused(profile):
    """No finite effort holds what jumps; a relation whose acceleration jumps is held."""
    held = Servo(servos.cart_pendulum(), [servos.lean(profile)], [Motor("motor", "rail")])
    with pytest.raises(SimulationError, match=r"t = 0\.5 s.*'lean'.* 0\.1 "):
        simulate_servo(held, 1.0)
    smooth = Servo(
        servos.cart_pendulum(),
        [servos.lean(lambda t: gm.where(t < 0.5, 0.0, 0.1 * (t - 0.5) ** 2))],
        [Motor("motor", "rail")],
    )
    simulate_servo(smooth, 0.6)
