"""One piece of machine code for systems that differ in numbers only: each moves as it does alone."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.codegen import Graph, write
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import numbers, parametrised, with_numbers
from gauss.dynamics.traced_system import Program
from gauss.integrators import METHODS
from gauss.simulation.batch.fixed_step_batch import FixedStepBatch
from gauss.simulation.compiled_steps.loop_functions import fixed_batch

ROUNDING = 1e-11  # of 50 steps: constants fold differently from parameters
STEPS, STEP = 50, 1e-3


def arm(mass=1.0, com=-0.3, offset=0.6, moment=0.05):
    scene = gauss.Scene("arm")
    upper = scene.body("upper", mass=mass, inertia=(moment, 0.04, 0.02), com=(0.02, 0.0, com))
    lower = scene.body("lower", mass=0.7, inertia=(0.03, 0.03, 0.01), com=(0.0, 0.01, -offset - 0.2))
    scene.revolute("A", "ground", upper, axis=(0, 1, 0))
    scene.universal("U", upper, lower, at=(0, 0, -offset), axis=(1, 0, 0))
    return scene


def loaded(stiffness=40.0, torque=0.5, pull=2.0, weight=-9.81):
    scene = gauss.Scene("loaded", gravity=(0.0, 0.0, weight))
    cart = scene.body("cart", mass=2.0, inertia=(0.1, 0.1, 0.1))
    bob = scene.body("bob", mass=1.0, inertia=(0.01, 0.01, 0.01), com=(0, 0, -0.5))
    scene.prismatic("rail", "ground", cart)
    scene.revolute("pin", cart, bob, axis=(0, 1, 0))
    scene.joint_spring("buffer", "rail", stiffness=stiffness, damping=1.0)
    scene.spring("rope", bob, "ground", at=(0, 0, -0.5), other_at=(1.0, 0, 0), stiffness=stiffness, length=0.3)
    scene.drive("pin", torque=torque)
    scene.force("pull", bob, force=(pull, 0.0, 0.0))
    return scene


def four_bar(mass=1.2, shift=0.0):
    scene = gauss.load("four_bar")
    joints = scene.joints | {"D": replace(scene.joints["D"], at=(1.2 + shift, 0.0, 0.0))}
    return replace(scene, bodies=scene.bodies | {"crank": replace(scene.bodies["crank"], mass=mass)}, joints=joints)


def geared(mass=1.0):
    scene = gauss.load("gear_pair")
    name, body = next(iter(scene.bodies.items()))
    return replace(scene, bodies=scene.bodies | {name: replace(body, mass=mass)})


MEMBERS = {
    "masses and centres": [lambda k=k: arm(mass=1.0 + k, com=-0.3 + 0.1 * k) for k in range(3)],
    "lengths and inertias": [lambda k=k: arm(offset=0.5 + 0.1 * k, moment=0.03 + 0.01 * k) for k in range(3)],
    "springs": [lambda k=k: loaded(stiffness=20.0 + 30.0 * k) for k in range(3)],
    "drives, forces, gravity": [lambda k=k: loaded(torque=0.4 * k, pull=3.0 - k, weight=-9.81 + k) for k in range(3)],
    "loops": [lambda k=k: four_bar(mass=1.0 + k, shift=0.02 * k) for k in range(3)],
    "relations": [lambda k=k: geared(mass=1.0 + k) for k in range(3)],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MEMBERS)
def test_every_member_of_a_family_moves_as_it_does_alone(name):
    systems = [gauss.compile_scene(make()) for make in MEMBERS[name]]
    found, kinds = zip(*map(numbers, systems), strict=True)
    assert len(set(kinds)) == 1
    members = parametrised(systems[0], np.array(found))
    assert members.parameters
    starts = [system.initial_state() for system in systems]
    loop = fixed_batch(Program(members.system, Laws(systems[0]), family=members), METHODS["rk4"])
    batch = FixedStepBatch(loop, np.array([np.r_[s.q, s.v] for s in starts]).T, np.array(found)[:, members.varied].T)
    rows = batch.run(STEPS, STEP, STEPS, 1)
    assert batch.error.max() <= ROUNDING and batch.residual.max() <= ROUNDING
    run = {"integrator": "rk4", "step": STEP, "times": [0.0, STEPS * STEP]}
    for system, start, row in zip(systems, starts, rows, strict=True):
        alone = gauss.simulate(system, STEPS * STEP, state=start, **run)
        assert np.abs(row[-1] - np.r_[alone.q[-1], alone.v[-1]]).max() <= ROUNDING * max(1.0, np.abs(alone.v).max())


@pytest.mark.parametrize("name", MEMBERS)
def test_a_system_with_its_own_numbers_is_the_same_system(name):
    system = gauss.compile_scene(MEMBERS[name][0]())
    again = with_numbers(system, numbers(system)[0], system.dynamics)
    assert np.array_equal(numbers(again)[0], numbers(system)[0]) and numbers(again)[1] == numbers(system)[1]


def other_joint(scene):
    return replace(scene, joints=scene.joints | {"U": replace(scene.joints["U"], kind="revolute")})


def other_law(factor):
    scene = arm()
    scene.drive("A", torque=lambda t: factor * t)
    return scene


def sticking(limit=1.0):
    scene = arm()
    scene.joint_friction("A", limit=limit)
    return scene


@pytest.mark.parametrize(
    "one, other",
    [
        (arm, lambda: other_joint(arm())),
        (lambda: other_law(1.0), lambda: other_law(2.0)),
        (arm, loaded),
        (lambda: gauss.load("double_pendulum"), lambda: gauss.load("double_pendulum_stops")),
        (sticking, lambda: sticking(2.0)),
    ],
)
def test_systems_that_differ_in_more_than_numbers_are_of_two_kinds(one, other):
    assert numbers(gauss.compile_scene(one()))[1] != numbers(gauss.compile_scene(other()))[1]


def test_a_law_may_name_what_is_not_bound_yet():
    scene = arm()
    scene.drive("A", torque=lambda t: 1.0 if t < 5.0 else later)
    first, second = (numbers(gauss.compile_scene(scene)) for _ in range(2))
    assert first[1] == second[1] and np.array_equal(first[0], second[0])
    later = 2.0
    assert numbers(gauss.compile_scene(scene))[1] != first[1]


def test_parameters_of_functions_that_are_called_become_inputs_of_their_callers():
    p = Graph(shared=True).symbol("p")
    inner = write(lambda x: [p * x[0]], 1)
    outer = write(lambda x: inner(x) + p, 1)
    assert inner.parameters == outer.parameters == ("p",)

    def bound(x):
        x[0].graph.bind(["p"], x[1:])
        return outer(x[:1])

    assert write(bound, 2).parameters == ()


def test_expressions_of_two_graphs_that_are_not_shared_are_refused():
    with pytest.raises(TypeError, match="one Graph"):
        Graph().symbol("x") + Graph().symbol("y")
