"""Accelerations, compulsions and derivatives in single states with dry friction in joints and limited drives."""

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError

MASS, ARM, INERTIA, FRICTION, G = 1.0, 0.3, 0.1, 2.0, 9.81
EXACT = 1e-12  # relative, of a closed form
DIFFERENCED = 1e-6  # central differences of step 1e-5


def arm(friction=FRICTION, **limited):
    scene = gauss.Scene("arm")
    scene.body("arm", MASS, (INERTIA,) * 3, com=(ARM, 0, 0))
    scene.revolute("hinge", "ground", "arm", axis=(0, 1, 0))
    if limited:
        scene.drive("hinge", **limited)
    else:
        scene.joint_friction("hinge", friction)
    return gauss.compile_scene(scene)


def expected(q, v, load, w=0.0):
    """Closed form: m g r cos q and a load against friction, over the moment of inertia."""
    torque, slides = MASS * G * ARM * np.cos(q) + load, v - w
    held = np.clip(-torque, -FRICTION, FRICTION) if slides == 0.0 else -FRICTION * np.sign(slides)
    return (torque + held) / (INERTIA + MASS * ARM**2)


CASES = [(0.3, 1.0, 0.0), (0.3, -1.0, 0.0), (0.3, 0.0, 0.0), (0.3, 0.0, -2.0), (1.2, 0.0, 0.5), (0.3, 0.0, -9.0)]


@pytest.mark.slow
@pytest.mark.parametrize(("q", "v", "load"), CASES)
def test_friction_slides_by_its_rate_and_sticks_within_its_limit(q, v, load):
    system = arm()
    state = system.state([q], [v])
    for found in (system.accelerations(state, [load]), gauss.solve(gauss.assemble(system, state, [load])).qdd):
        assert abs(found[0] - expected(q, v, load)) <= EXACT * (1.0 + abs(expected(q, v, load)))


@pytest.mark.parametrize("v", [0.0, 1.0, 2.0])
def test_a_limited_drive_holds_its_speed_or_pushes_with_its_limit(v):
    system = arm(speed=1.0, limit=FRICTION)
    state = system.state([1.2], [v])
    assert abs(system.accelerations(state)[0] - expected(1.2, v, 0.0, w=1.0)) <= 1e-11


def test_friction_beside_a_closed_stop():
    scene = gauss.Scene("stopped")
    scene.body("arm", MASS, (INERTIA,) * 3, com=(ARM, 0, 0))
    scene.revolute("hinge", "ground", "arm", axis=(0, 1, 0))
    scene.joint_friction("hinge", FRICTION)
    scene.stop("hinge", highest=0.0)
    system = gauss.compile_scene(scene)
    state = system.state([0.0], [0.0])
    assert abs(system.accelerations(state)[0]) <= 1e-9  # the stop carries what friction does not
    assert abs(system.accelerations(state, [-9.0])[0] - expected(0.0, 0.0, -9.0)) <= 1e-9  # it is pulled off the stop


@pytest.mark.slow
def test_the_instant_is_that_of_the_motion():
    system = arm()
    motion = gauss.simulate(system, 0.2, times=[0.0, 0.1 - 1e-4, 0.1, 0.1 + 1e-4])
    difference = (motion.v[3] - motion.v[1]) / 2e-4
    assert abs(system.accelerations(motion.state(2))[0] - difference[0]) <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("v", [1.0, -1.0])
def test_derivatives_where_friction_slides(v):
    system, h = arm(), 1e-5
    found = gauss.derivatives(system, system.state([0.4], [v]))
    for name, at in (("q", (h, 0.0, 0.0)), ("v", (0.0, h, 0.0)), ("load", (0.0, 0.0, h))):
        dq, dv, df = at
        slope = (expected(0.4 + dq, v + dv, df) - expected(0.4 - dq, v - dv, -df)) / (2 * h)
        assert abs(getattr(found, name)[0, 0] - slope) <= DIFFERENCED * (1.0 + abs(slope))


@pytest.mark.slow
def test_derivatives_where_friction_sticks_and_between():
    system = arm()
    stuck = gauss.derivatives(system, system.state([0.3], [0.0]), [-2.0])
    assert np.abs([stuck.q, stuck.load]).max() <= 1e-12  # it stays at rest
    limit = FRICTION - MASS * G * ARM
    for load in (limit, limit + 1.0):  # at the limit, and setting out
        with pytest.raises(SimulationError, match="'friction of hinge'"):
            gauss.derivatives(system, system.state([0.0], [0.0]), [load])
