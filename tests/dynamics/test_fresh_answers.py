"""Answers follow what they depend on: none comes from a cache that was filled before something of it changed."""

from types import ModuleType

import numpy as np
import pytest

import gauss
from gauss import servo
from gauss.dynamics import Plan

pytestmark = pytest.mark.slow

BEFORE, AFTER = 1.0, 5.0  # of a number that a law looks up
ROUNDING = 1e-12  # relative, of results by other machine code


class Setting:
    """A number that somebody turns."""

    k = BEFORE


def pushed(scene, joint, setting):
    """Scene with a traced force along a joint."""
    scene.drive(joint, force=lambda t: setting.k * gauss.math.sin(3.0 * t))
    return scene


def rubbed(setting):
    scene = gauss.Scene("rubbed", gravity=(0, 0, 0))
    scene.body("block", 2.0)
    scene.prismatic("rail", "ground", "block", axis=(1, 0, 0))
    scene.joint_friction("rail", 0.1)
    scene.start("rail", rate=1.0)
    return pushed(scene, "rail", setting)


def resting(setting):
    scene = gauss.Scene("resting")
    scene.body("ball", 1.0, (0.004, 0.004, 0.004))
    scene.prismatic("up", "ground", "ball", axis=(0, 0, 1))
    scene.sphere("shape", "ball", 0.1)
    scene.half_space("floor", at=(0, 0, -0.1))
    scene.contact("foot", "shape", "floor")
    return pushed(scene, "up", setting)


def held_cart(setting):
    scene = pushed(gauss.load("cart_pole"), "rail", setting)
    hold = servo.ServoRelation("place", lambda t, motion: motion.coordinate("rail") - 0.1 * gauss.math.sin(t))
    return servo.Servo(scene, [hold], [servo.Motor("motor", "rail")])


def stepped(system):
    plan = Plan("time stepping", "certified")
    return gauss.simulate(system, 0.1, integrator="time_stepping", step=0.01, plan=plan).v


def bearing(system):
    motion = gauss.simulate(system, 0.1, integrator="time_stepping", step=0.01)
    return gauss.contact_forces(motion, "foot")


def tracked(held):
    return servo.simulate(held, 0.1).efforts


def balanced(held):
    return servo.lagrange(held, servo.initial_state(held, held.system.state(t=0.5))).efforts


LAWS = {
    "certified time stepping": (rubbed, gauss.compile_scene, stepped),
    "forces of contacts": (resting, gauss.compile_scene, bearing),
    "motions of servos": (held_cart, lambda made: made, tracked),
    "efforts of servos": (held_cart, lambda made: made, balanced),
}


@pytest.mark.parametrize("case", LAWS)
def test_a_law_that_changes_is_followed_by_what_was_asked_before(case):
    make, prepare, ask = LAWS[case]
    setting, fresh = Setting(), Setting()
    made = prepare(make(setting))
    before = ask(made)
    setting.k = fresh.k = AFTER
    expected = ask(prepare(make(fresh)))
    assert np.abs(before - expected).max() > 1e-3 * np.abs(expected).max()
    np.testing.assert_allclose(ask(made), expected, rtol=ROUNDING, atol=ROUNDING)


class Slots:
    """An object without a dictionary."""

    __slots__ = ("k",)


def of_class():
    Setting.k = BEFORE
    return Setting, lambda u: Setting.k * u


def of_module():
    module = ModuleType("settings")
    module.k = BEFORE
    return module, lambda u: module.k * u


def of_slots():
    slots = Slots()
    slots.k = BEFORE
    return slots, lambda u: slots.k * u


def of_function():
    def law(u):
        return law.k * u

    law.k = BEFORE
    return law, law


LOOKED_UP = {make.__name__: make for make in (of_class, of_module, of_slots, of_function)}


@pytest.mark.parametrize("what", LOOKED_UP)
def test_the_law_of_an_input_is_followed_wherever_it_looks_up_a_number(what):
    owner, law = LOOKED_UP[what]()
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.body("cart", 1.0)
    scene.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
    scene.input("push", "rail", effort=lambda u, t, motion: law(u))
    system = gauss.compile_scene(scene)
    for k in (BEFORE, AFTER):
        owner.k = k
        rate = gauss.simulate(system, 1.0, control=lambda t, q, v: [1.0], rate=10.0).v[-1, 0]
        simulator = gauss.Simulator(system, step=0.1)
        simulator.step([1.0], n=10)
        assert rate == pytest.approx(k) and simulator.state.v[0] == pytest.approx(k)  # closed form, unit mass
    Setting.k = BEFORE


def test_a_law_that_writes_to_its_state_does_not_move_the_start_of_other_motions():
    writes = [False]

    def law(t, motion):
        if writes[0] and isinstance(motion.state.q[0], float):
            motion.state.q[:] = motion.state.q + 1.0
        return float(np.sin(float(t)))

    scene = gauss.load("double_pendulum")
    scene.drive("A", torque=law)
    system = gauss.compile_scene(scene)
    before = system.initial_state().q
    writes[0] = True
    gauss.simulate(system, 0.01, integrator="rk4", step=0.005)
    writes[0] = False
    np.testing.assert_array_equal(gauss.simulate(system, 0.01, integrator="rk4", step=0.005).q[0], before)


LATER = {
    "start": lambda scene: scene.start("A", position=0.5, rate=2.0),
    "force": lambda scene: scene.force("push", "rod 1", force=(3.0, 1.0, 0.0)),
    "friction": lambda scene: scene.joint_friction("A", 0.3),
    "stop": lambda scene: scene.stop("A", -0.05, 0.05),
    "input": lambda scene: scene.input("motor", "A", limits=1.0),
}


@pytest.mark.parametrize("what", LATER)
@pytest.mark.parametrize("coordinates", ["tree", "maximal"])
def test_what_a_scene_is_given_later_does_not_reach_a_system(what, coordinates):
    def made():
        scene = gauss.Scene("rods", gravity=(0, -9.81, 0))
        scene.body("rod 1", 1.0, (0.001, 0.1, 0.1), com=(0.5, 0, 0))
        scene.revolute("A", "ground", "rod 1")
        return scene, gauss.compile_scene(scene, coordinates)

    scene, system = made()
    _, alone = made()
    LATER[what](scene)
    assert system.explain().splitlines()[0] == alone.explain().splitlines()[0]
    assert system.scene == alone.scene and system.nonsmooth == alone.nonsmooth
    for found, expected in ((gauss.simulate(one, 0.1, rtol=1e-8) for one in (system, alone)),):
        np.testing.assert_array_equal(found.q, expected.q)
        np.testing.assert_array_equal(found.v, expected.v)
