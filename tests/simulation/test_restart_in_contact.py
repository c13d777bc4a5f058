"""Motions that begin at samples of a motion by time stepping: what its steps leave of penetration is accepted, no more."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import EDGE, RADIUS, floor, free_body
from gauss.dynamics.contact.overlaps import START_OVERLAP
from gauss.errors import StateError

ROUNDING = 1e-14  # of unit quaternions


def tumbling():
    """Box, ball and capsule that fall and turn fast."""
    scene = floor("tumbling")
    free_body(scene, "block", EDGE**2 / 6.0, (0.0, 0.0, 0.3), rate=(2.0, 0.0, -1.0, 3.0, 8.0, 5.0))
    scene.box("brick", "block", (EDGE, 0.7 * EDGE, 0.4 * EDGE))
    free_body(scene, "roller", 0.4 * RADIUS**2, (0.0, 2.0, 0.4), rate=(3.0, 0.0, -3.0, 10.0, 20.0, 5.0))
    scene.capsule("pill", "roller", RADIUS, 0.5, axis=(0.0, 0.0, 1.0))
    scene.contacts_all(friction=0.3)
    return scene


def restarted(scene, found, k: int, duration: float, **options):
    """A short motion from a sample, of one step where no step is given."""
    for joint in scene.joints.values():
        if joint.pair.n_v:
            place = next(one for one in found.system.joints if one.name == joint.name)
            scene.start(joint.name, position=tuple(found.q[k, place.q]), rate=tuple(found.v[k, place.v]))
    options = {"integrator": "time_stepping", "step": duration, "progress": False} | options
    return gauss.simulate(scene, duration, **options)


@pytest.mark.slow
@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_a_motion_may_begin_at_any_sample_of_one_with_the_same_steps(step):
    scene = tumbling()
    found = gauss.simulate(scene, 0.3, integrator="time_stepping", step=step, progress=False)
    for k in range(0, len(found.t) - 1, max(1, int(5e-3 / step))):
        again = restarted(scene, found, k, step)
        assert again.stats.steps == 1
        np.testing.assert_allclose(again.q[0], found.q[k], atol=ROUNDING)


@pytest.mark.slow
def test_a_motion_may_begin_at_any_sample_of_one_under_error_control():
    scene, options = tumbling(), {"step": None, "rtol": 1e-4, "atol": 1e-4}
    found = gauss.simulate(scene, 0.3, integrator="time_stepping", progress=False, **options)
    for k in range(0, len(found.t) - 1, 8):
        assert restarted(scene, found, k, 1e-3, **options).t[-1] > 0.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")  # of a step that removes penetration
@pytest.mark.parametrize("loads", [False, True])
def test_penetration_that_no_step_leaves_is_refused(loads):
    step, scene = 1e-3, floor("sunk")
    free_body(scene, "ball", 0.4 * RADIUS**2, (0.0, 0.0, 0.999 * RADIUS))
    scene.sphere("shell", "ball", RADIUS)
    scene.contact("touch", "shell", "floor")
    if loads:  # the steps of a whole scene, not those of free bodies
        scene.force("push", "ball", (0.0, 0.0, 0.1))
    system = gauss.compile_scene(scene)
    with pytest.raises(StateError, match="inside"):
        gauss.simulate(system, step, integrator="time_stepping", step=step, progress=False)
    left = (step / system.scale.time) ** 2 * system.scale.length
    assert START_OVERLAP * system.scale.length < left < 1e-3 * RADIUS
    scene.start("ball floats", position=(0.0, 0.0, RADIUS - left, 1.0, 0.0, 0.0, 0.0))
    found = gauss.simulate(scene, step, integrator="time_stepping", step=step, progress=False)
    # a step that removes it moves no faster than gravity makes bodies in some steps
    assert abs(found.v[-1]).max() <= 10.0 * 9.81 * step
