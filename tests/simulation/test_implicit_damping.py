"""Damping of joints in time stepping with contacts: closed forms of one hinge, energy, light fingers on a floor."""

import numpy as np
import pytest

import gauss
from gauss import Plan
from gauss.dynamics.contact.contact_stepper import new_contact_stepper

INERTIA, RATE = 1e-4, 3.0  # [kg m²], [rad/s]
KERNELS, *WHOLE_SCENE = ROUTES = tuple(Plan("time stepping", name) for name in ("pair kernels", "compiled", "certified"))
ROUNDING = 1e-12  # of values of the order of 1
BALANCE = 1e-12  # [J], of energies of 1e-3 J
SAME_STEPS = 1e-9  # coordinates, rates and work of two solvers, each with laws met to 1e-10


def hinge(damping: float):
    """Ball on a damped vertical hinge, far above a floor."""
    scene = gauss.Scene("damped hinge", gravity=(0.0, 0.0, 0.0))
    scene.half_space("floor", at=(0.0, 0.0, -10.0))
    scene.body("ball", mass=1.0, inertia=(INERTIA,) * 3)
    scene.revolute("hinge", "ground", "ball", axis=(0, 0, 1))
    scene.joint_spring("damper", "hinge", damping=damping)
    scene.start("hinge", rate=RATE)
    scene.sphere("shell", "ball", 0.1)
    scene.contact("touch", "shell", "floor", friction=0.5)
    return scene


def moved(scene, duration: float, step: float, **options):
    """Motion by kernels of pairs of shapes."""
    options = {"integrator": "time_stepping", "step": step, "plan": KERNELS, "progress": False} | options
    return gauss.simulate(scene, duration, **options)


@pytest.mark.slow
@pytest.mark.parametrize("plan", ROUTES, ids=lambda plan: plan.dynamics)
@pytest.mark.parametrize("z", [1.5, 2.0, 10.0, 1e4])
def test_no_step_is_too_long_for_the_damping_of_a_hinge(z, plan):
    h = 1e-3
    found = moved(hinge(z * INERTIA / h), 20 * h, h, plan=plan)
    theta = max(0.5, 1.0 - 1.0 / z)
    factor = (1.0 - (1.0 - theta) * z) / (1.0 + theta * z)
    np.testing.assert_allclose(found.v[:, 0], RATE * factor ** np.arange(21), atol=RATE * ROUNDING)
    assert (found.v[:, 0] >= -RATE * ROUNDING).all()
    assert abs(found.v[1, 0] - RATE * np.exp(-z)) <= RATE * min(np.exp(-2.0), z**3) * (1.0 + ROUNDING)
    kinetic = 0.5 * INERTIA * found.v[:, 0] ** 2
    np.testing.assert_allclose(kinetic + found.work[:, 2], kinetic[0], atol=BALANCE)


@pytest.mark.slow
@pytest.mark.parametrize("plan", ROUTES, ids=lambda plan: plan.dynamics)
def test_damping_is_of_order_two(plan):
    d, end = 0.005, 0.02
    errors = [
        abs(moved(hinge(d), end, h, plan=plan).v[-1, 0] - RATE * np.exp(-d / INERTIA * end)) for h in (4e-3, 2e-3, 1e-3)
    ]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert ((orders > 1.8) & (orders < 2.3)).all()


def finger(damping: float):
    """Light finger of two links that falls on a rough floor."""
    scene = gauss.Scene("finger")
    scene.half_space("floor", at=(0.0, 0.0, -0.05))
    for k in range(2):
        scene.body(f"link {k}", mass=1e-3, inertia=(1e-8,) * 3, position=(0.02 + 0.04 * k, 0.0, 0.0))
        scene.revolute(
            f"hinge {k}", f"link {k - 1}" if k else "ground", f"link {k}", axis=(0, 1, 0), at=(0.04 * k, 0.0, 0.0)
        )
        scene.joint_spring(f"damper {k}", f"hinge {k}", damping=damping, stiffness=1e-4)
        scene.capsule(f"bone {k}", f"link {k}", 0.008, 0.03, axis=(1, 0, 0))
    scene.contacts_all(friction=0.6)
    return scene


@pytest.mark.slow
def test_light_fingers_stay_finite_and_agree_with_shorter_steps():
    d = 2e-4  # h d over the inertia of a link about its hinge, 4e-7 kg m², is 1 at 2 ms; over that of its centre 40
    long, short = (moved(finger(d), 0.6, h, times=[0.1, 0.6]) for h in (2e-3, 2e-4))
    np.testing.assert_allclose(long.q, short.q, atol=5e-3)  # rad; order 1 at the impact
    assert np.isfinite(long.v).all()


@pytest.mark.slow
def test_machine_code_and_python_take_the_same_steps():
    system = gauss.compile_scene(finger(2e-4))
    stepper, state, h = new_contact_stepper(system), system.initial_state(), 2e-3
    stepper.forget()
    stepper.detection.find(stepper._begin(state, 0.0, 0.0).terms.bodies, 1.0)
    stepper.forget()
    for _ in range(60):
        known, rows = stepper.known, np.empty((1, 4 + system.n_q + system.n_v))
        done = stepper.steps_from(
            np.concatenate([[state.t], state.q, state.v, np.zeros(3)]), np.array([state.t + h]), rows
        ).steps
        after, stepper.known = stepper.known, known
        found = stepper.python_step(state, h)
        if done:
            np.testing.assert_allclose(rows[0, 1:-3], np.concatenate([found.q, found.v]), atol=1e-9)
            np.testing.assert_allclose(rows[0, -3:], h * found.power, atol=1e-12)
        stepper.known = after if done else stepper.known
        state = gauss.State(state.t + h, found.q, found.v)


@pytest.mark.slow
@pytest.mark.parametrize("plan", WHOLE_SCENE, ids=lambda plan: plan.dynamics)
def test_the_steps_of_a_whole_scene_damp_as_those_by_kernels_do(plan):
    one, other = (moved(finger(2e-4), 0.3, 2e-3, plan=route) for route in (KERNELS, plan))
    for name in ("q", "v", "work"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=SAME_STEPS)


def hand():
    """Palm with three fingers of three light links, damped, with stops and springs: time stepping without contacts."""
    scene = gauss.Scene("hand")
    for f in range(3):
        for k in range(3):
            name, parent = f"link {f} {k}", f"link {f} {k - 1}" if k else "ground"
            scene.body(name, mass=0.01, inertia=(1e-7,) * 3, position=(0.015 + 0.03 * k, 0.03 * f, 0.0))
            scene.revolute(f"hinge {f} {k}", parent, name, axis=(0, 1, 0), at=(0.03 * k, 0.03 * f, 0.0))
            scene.joint_spring(f"damper {f} {k}", f"hinge {f} {k}", damping=0.05, stiffness=0.02)
            scene.stop(f"hinge {f} {k}", lowest=-0.2, highest=0.01 * (1 + f))
    return scene


@pytest.mark.slow
def test_a_light_hand_between_stops_does_not_diverge():
    options = {"plan": None, "times": [0.1, 0.5]}
    h = 2e-3  # h d over the inertia of the last link is 30: an explicit step diverges
    long, short = (moved(hand(), 0.5, step, **options) for step in (h, h / 10.0))
    assert long.stats.plan.dynamics == "compiled"
    np.testing.assert_allclose(long.q, short.q, atol=5e-3)  # rad; order 1 at the stops
    assert np.abs(long.v).max() < 1.0


@pytest.mark.slow
def test_many_hands_damp_as_one_does():
    system, h = gauss.compile_scene(hand()), 2e-3
    start, found = system.initial_state(), moved(hand(), 0.1, 2e-3, plan=None)
    many = gauss.rollout(
        system, start.q + np.zeros((2, 1)), start.v + np.zeros((2, 1)), integrator="time_stepping", steps=50, step=h
    )
    np.testing.assert_allclose(many.q[:, -1], found.q[-1] + np.zeros((2, 1)), atol=SAME_STEPS)
