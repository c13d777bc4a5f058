"""Time stepping of mechanisms by kernels of pairs of shapes: the same motion as by straight-line code, and closed forms."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss import Plan
from gauss.bench.fuzz.scenes import moved_scene
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.near_detection import FIRST_ROOM
from gauss.errors import ContactLawWarning, PainleveWarning, StateError
from gauss.simulation.moreau.contact_warnings import LOOSE_LAWS, warn_of_laws
from tests.support import mechanisms

STEP = 1e-3  # [s]
SAME_STEPS = 1e-9  # coordinates, rates and work after 150 steps of two solvers, each with laws met to 1e-10
GAIN = 1e-4  # of the energy: what a step of the midpoint rule may gain
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


def summed():
    """Three links whose angles have a constant sum, by a tendon that is given twice, and a belt on one of them."""
    scene = arm("summed arm")
    scene.body("tip", mass=0.5, inertia=(0.001, 0.01, 0.01), position=(1.2, 0.0, 0.55))
    scene.revolute("hinge 2", "link 1", "tip", at=(1.0, 0.0, 0.55), axis=(0, 1, 0))
    scene.body("wheel", mass=0.2, inertia=(0.001,) * 3)
    scene.revolute("shaft", "ground", "wheel", axis=(0, 1, 0))
    angles = {"hinge 0": 0.4, "hinge 1": 0.3, "hinge 2": -0.7}
    scene.linear_coupling("tendon", angles, constant=0.1)
    scene.linear_coupling("the same", {joint: -0.3 * factor for joint, factor in angles.items()}, constant=-0.03)
    scene.couple("belt", "shaft", "hinge 2", 3.0)
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


SCENES = {make.__name__: make for make in (driven, bouncing, coupled, summed, four_bar, on_a_spring)} | {
    "arm": lambda: arm("arm"),
}

WEDGED = {"driven", "coupled"}  # they come to rest on the foot: forces along normal and tangent are not unique


def moved(scene, duration: float, **options):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=STEP, progress=False, **options)


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_machine_code_and_python_take_the_same_steps(name):
    system = gauss.compile_scene(SCENES[name]())
    stepper = new_contact_stepper(system)
    if stepper.memory is None:
        assert name == "four_bar"
        return
    state = system.initial_state()
    stepper.forget()
    finished, rows = 0, np.empty((1, 4 + system.n_q + system.n_v))
    for _ in range(120):
        known, ends = stepper.known, np.array([state.t + STEP])
        by_python = stepper.python_step(state, STEP)
        stepper.known = known
        loop = stepper.steps_from(np.concatenate([[state.t], state.q, state.v, np.zeros(3)]), ends, rows)
        if loop.steps:
            finished += 1
            q, v, work = np.split(rows[0, 1:], [system.n_q, system.n_q + system.n_v])
            np.testing.assert_allclose(v, by_python.v, atol=SAME_STEPS)
            np.testing.assert_allclose(q, by_python.q, atol=SAME_STEPS)
            np.testing.assert_allclose(work, STEP * by_python.power, atol=10.0 * SAME_STEPS)
        else:
            by_python = stepper.python_step(state, STEP)
        state = system.projected(gauss.State(state.t + STEP, by_python.q, by_python.v))
    assert finished > 100


def on_a_slope(shape: str, friction: float, angle: float):
    """A body of 1 kg in a vertical plane, on a plane of a slope."""
    scene = gauss.Scene("slope")
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    scene.half_space("plane", normal=tuple(normal))
    place = tuple(0.1 * normal)
    for name in ("along", "up"):
        scene.body(name, mass=0.0, position=place)
    scene.body("body", mass=1.0, inertia=(0.004,) * 3, position=place)
    scene.prismatic("x", "ground", "along", at=place, axis=(1, 0, 0))
    scene.prismatic("z", "along", "up", at=place, axis=(0, 0, 1))
    scene.revolute("turn", "up", "body", at=place, axis=(0, 1, 0))
    if shape == "ball":
        scene.sphere("shape", "body", 0.1)
    else:
        scene.box("shape", "body", (0.6, 0.2, 0.2), rotation=(0.0, angle, 0.0))
    scene.contact("touch", "shape", "plane", friction=friction)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "friction", "angle", "acceleration"),
    [
        ("box", 0.2, 0.3, np.sin(0.3) - 0.2 * np.cos(0.3)),
        ("box", 0.5, 0.3, 0.0),
        ("ball", 0.5, 0.3, 5.0 / 7.0 * np.sin(0.3)),
        ("ball", 0.02, 0.3, np.sin(0.3) - 0.02 * np.cos(0.3)),
    ],
)
def test_bodies_slide_and_roll_down_a_slope_as_by_coulombs_law(shape, friction, angle, acceleration):
    found = moved(on_a_slope(shape, friction, angle), 0.2, plan=KERNELS)
    speed = np.hypot(*found.v[-1, :2])
    assert speed == pytest.approx(9.81 * acceleration * 0.2, abs=1e-8)


def test_a_leg_that_falls_comes_to_rest_on_its_stops_and_the_floor():
    scene = driven()
    del scene.loads["spring"]
    for name in [name for name, load in scene.loads.items() if name != "spring"]:
        del scene.loads[name]
    found = moved(scene, 1.5, plan=KERNELS)
    assert np.abs(found.v[-200:]).max() <= 1e-9
    energy = gauss.energy(found)
    total = energy.kinetic + energy.potential
    assert np.diff(total).max() <= GAIN * energy.scale
    assert total[-1] < total[0] - 0.1 * energy.scale


@pytest.mark.slow
def test_time_stepping_tells_painleves_paradox():
    scene, radius = gauss.load("painleve_rod"), 1e-3
    scene.shapes["end"] = replace(scene.shapes["end"], radius=radius)
    scene.shapes["floor"] = replace(scene.shapes["floor"], at=(0.0, -radius, 0.0))
    with pytest.warns(PainleveWarning, match="'C'") as warned:
        motion = moved(scene, 0.02, plan=KERNELS)
    assert {warning.filename for warning in warned} == {__file__}  # where the user calls
    assert 0.0 <= motion.stats.law_error <= LOOSE_LAWS and f"{motion.stats.law_error:.0e}" in repr(motion.stats)


def test_loose_laws_of_contact_are_told():
    with pytest.warns(ContactLawWarning, match="3 of 10 steps"):
        warn_of_laws(1e-12, 3, 10)
    with pytest.warns(ContactLawWarning, match="1e-03"):
        warn_of_laws(1e-3, 0, 10)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_laws(1e-9, 0, 10)


def test_penetration_at_the_start_is_refused():
    scene = arm("deep arm", height=0.3)
    with pytest.raises(StateError, match="inside of 'touch'"):
        moved(scene, STEP, plan=KERNELS)


@pytest.mark.slow
def test_samples_beside_the_steps_are_those_of_the_written_out_step():
    system, times = gauss.compile_scene(driven()), np.linspace(0.0, 0.1, 27)
    one, other = (moved(system, 0.1, plan=plan, times=times) for plan in (WRITTEN_OUT, KERNELS))
    np.testing.assert_array_equal(one.t, other.t)
    np.testing.assert_allclose(one.q, other.q, atol=SAME_STEPS)
    again = moved(system, 0.1, plan=KERNELS, times=times)
    np.testing.assert_array_equal(again.q, other.q)


def test_a_loop_in_which_nothing_moves_rests():
    """A body that is fixed and hinged to the ground stays, whatever touches it; its loop has no compliance."""
    given = moved_scene(0, 8753)
    motion = gauss.simulate(given.scene, 0.02, integrator="time_stepping", step=given.step)
    assert not motion.q.any()
    assert not motion.v.any()


def lying_chain(n: int):
    """Boxes on hinges that lie on a floor and turn there."""
    scene = gauss.Scene("lying chain")
    scene.half_space("floor")
    for k in range(n):
        scene.body(f"link {k}", mass=0.1, inertia=(1e-4,) * 3, position=(0.2 * k, 0.0, 0.03))
        scene.box(f"box {k}", f"link {k}", (0.12, 0.06, 0.06))
        if k:
            scene.revolute(f"hinge {k}", f"link {k - 1}", f"link {k}", axis=(0, 0, 1), at=(0.2 * k - 0.1, 0.0, 0.03))
    scene.free("floats", "ground", "link 0", at=(0.0, 0.0, 0.03))
    scene.start("floats", rate=(0.0, 0.3, 0.0, 0.0, 0.0, 1.0))
    scene.contacts_all(friction=0.4)
    return gauss.compile_scene(scene)


@pytest.mark.slow
def test_machine_code_holds_as_many_contacts_as_there_are():
    system = lying_chain(18)
    stepper, state = new_contact_stepper(system), system.initial_state()
    rows, begin = np.empty((2, 4 + system.n_q + system.n_v)), np.concatenate([[state.t], state.q, state.v, np.zeros(3)])
    assert stepper.steps_from(begin, state.t + STEP * np.arange(1, 3), rows).steps == 0  # there is no room
    stepper.python_step(state, STEP)
    assert stepper.known.key.size == 4 * 18 > FIRST_ROOM
    assert stepper.steps_from(begin, state.t + STEP * np.arange(1, 3), rows).steps == 2
    slow = new_contact_stepper(system)
    slow.memory, at = None, state  # all steps by Python
    slow.forget()
    for _ in range(8):
        step = slow.python_step(at, STEP)
        at = replace(at, t=at.t + STEP, q=step.q, v=step.v)
    motion = gauss.simulate(system, 8 * STEP, integrator="time_stepping", step=STEP, plan=KERNELS)
    np.testing.assert_allclose(motion.v[-1], at.v, atol=SAME_STEPS)
    assert len(gauss.contact_points(motion, -1)) == 4 * 18
