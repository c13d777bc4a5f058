"""Time stepping of mechanisms by kernels of pairs of shapes: the same motion as by straight-line code, and closed forms."""

import numpy as np
import pytest

import gauss
from gauss import Plan
from tests.support import mechanisms

STEP = 1e-3  # [s]
SAME_STEPS = 1e-9  # coordinates, rates and work after 150 steps of two solvers, each with laws met to 1e-10
KERNELS, WRITTEN_OUT = Plan("time stepping", "pair kernels"), Plan("time stepping", "compiled")


def arm(name: str, height: float = 0.55):
    """Two links of 1 kg on a hinge above a floor, the outer one with a capsule that reaches it."""
    scene = gauss.Scene(name)
    scene.half_space("floor")
    for k, (parent, x) in enumerate((("ground", 0.0), ("link 0", 0.5))):
        scene.body(f"link {k}", mass=1.0, inertia=(0.001, 0.02, 0.02), position=(x + 0.25, 0.0, height))
        scene.revolute(f"hinge {k}", parent, f"link {k}", at=(x, 0.0, height), axis=(0, 1, 0))
    scene.capsule("foot", "link 1", 0.05, 0.4, axis=(1, 0, 0))
    scene.contact("touch", "foot", "floor", friction=0.4)
    scene.start("hinge 0", position=0.5, rate=1.0)
    return scene


def driven():
    """The arm under a motor, springs, dampers, dry friction and stops."""
    scene = arm("driven arm")
    scene.drive("hinge 0", torque=lambda t: 2.0 * gauss.math.sin(20.0 * t))
    scene.joint_spring("spring", "hinge 1", stiffness=5.0, damping=0.1)
    scene.joint_friction("hinge 1", 0.3)
    scene.stop("hinge 1", lowest=-0.4, highest=0.05)
    return scene


def bouncing():
    """The arm with restitution."""
    scene = arm("bouncing arm")
    del scene.contacts["touch"]
    scene.contact("touch", "foot", "floor", friction=0.2, restitution=0.6)
    return scene


def coupled():
    """The arm whose outer hinge follows the inner one."""
    scene = arm("coupled arm")
    scene.couple("belt", "hinge 1", "hinge 0", -0.5)
    scene.start("hinge 0", position=0.7, rate=1.0)
    scene.start("hinge 1", position=-0.35, rate=-0.5)
    return scene


def four_bar():
    """A four-bar linkage whose coupler carries a ball that meets a wall."""
    scene = mechanisms.four_bar()
    body = "coupler"
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    place = system.forward_kinematics(state.q, body)[1]
    scene.sphere("ball", body, 0.01)
    scene.half_space("wall", at=tuple(place + [0.0, 0.03, 0.0]), normal=(0, -1, 0))
    scene.contact("touch", "ball", "wall", friction=0.3)
    return scene


def on_a_spring():
    """A free ball with a spring to the ground, above the floor."""
    scene = gauss.Scene("ball on a spring")
    scene.half_space("floor")
    scene.body("ball", mass=1.0, inertia=(0.001,) * 3)
    scene.free("float", "ground", "ball")
    scene.start("float", position=(0.0, 0.0, 0.11, 1, 0, 0, 0), rate=(0.5, 0.0, 0.0, 0.0, 0.0, 3.0))
    scene.spring("line", "ball", "ground", other_at=(0.1, 0.2, 0.5), stiffness=20.0, length=0.3)
    scene.sphere("sphere", "ball", 0.1)
    scene.contact("touch", "sphere", "floor", friction=0.5)
    return scene


SCENES = {make.__name__: make for make in (driven, bouncing, coupled, four_bar, on_a_spring)} | {
    "arm": lambda: arm("arm"),
}

WEDGED = {"driven", "coupled"}  # they come to rest on the foot: forces along normal and tangent are not unique


def moved(scene, duration: float, **options):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=STEP, progress=False, **options)


@pytest.mark.parametrize("name", SCENES)
def test_mechanisms_move_as_by_the_machine_code_of_the_scene(name):
    system = gauss.compile_scene(SCENES[name]())
    one, other = moved(system, 0.15, plan=WRITTEN_OUT), moved(system, 0.15, plan=KERNELS)
    np.testing.assert_allclose(one.q, other.q, atol=SAME_STEPS)
    np.testing.assert_allclose(one.v, other.v, atol=SAME_STEPS * 1e2)
    np.testing.assert_allclose(one.work, other.work, atol=SAME_STEPS * 1e1)
    pushes = [gauss.contact_forces(motion, "touch") for motion in (one, other)]
    assert pushes[0].max() > 0.0
    if name in WEDGED:
        return
    np.testing.assert_allclose(*pushes, atol=1e-6 * pushes[0].max())
    rubs = [gauss.friction_forces(motion, "touch") for motion in (one, other)]
    np.testing.assert_allclose(*rubs, atol=1e-6 * pushes[0].max())
