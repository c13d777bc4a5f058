"""Damping of joints in time stepping with contacts: closed forms of one hinge, energy, light fingers on a floor."""

import numpy as np
import pytest

import gauss
from gauss import Plan
from gauss.dynamics.contact.contact_stepper import new_contact_stepper

INERTIA, RATE = 1e-4, 3.0  # [kg m²], [rad/s]
KERNELS = Plan("time stepping", "pair kernels")
ROUNDING = 1e-12  # of values of the order of 1
BALANCE = 1e-12  # [J], of energies of 1e-3 J


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
@pytest.mark.parametrize("z", [1.5, 2.0, 10.0, 1e4])
def test_no_step_is_too_long_for_the_damping_of_a_hinge(z):
    h = 1e-3
    found = moved(hinge(z * INERTIA / h), 20 * h, h)
    theta = max(0.5, 1.0 - 1.0 / z)
    factor = (1.0 - (1.0 - theta) * z) / (1.0 + theta * z)
    np.testing.assert_allclose(found.v[:, 0], RATE * factor ** np.arange(21), atol=RATE * ROUNDING)
    assert (found.v[:, 0] >= -RATE * ROUNDING).all()
    assert abs(found.v[1, 0] - RATE * np.exp(-z)) <= RATE * min(np.exp(-2.0), z**3) * (1.0 + ROUNDING)
    kinetic = 0.5 * INERTIA * found.v[:, 0] ** 2
    np.testing.assert_allclose(kinetic + found.work[:, 2], kinetic[0], atol=BALANCE)


@pytest.mark.slow
def test_damping_is_of_order_two():
    d, end = 0.005, 0.02
    errors = [abs(moved(hinge(d), end, h).v[-1, 0] - RATE * np.exp(-d / INERTIA * end)) for h in (4e-3, 2e-3, 1e-3)]
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
        done = stepper.run(state, np.zeros(3), np.array([state.t + h]), rows).steps
        after, stepper.known = stepper.known, known
        found = stepper.python_step(state, h)
        if done:
            np.testing.assert_allclose(rows[0, 1:-3], np.concatenate([found.q, found.v]), atol=1e-9)
            np.testing.assert_allclose(rows[0, -3:], h * found.power, atol=1e-12)
        stepper.known = after if done else stepper.known
        state = gauss.State(state.t + h, found.q, found.v)
