"""What machine code leaves out of the steps of mechanisms with contacts is zero, and speeds bound those of all shapes."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.step_patterns import step_patterns
from gauss.simulation.moreau.unseen_contacts import step_limit
from gauss.system import random_state

ROUNDING = 1e-12  # of sums of products, relative
STEP = 1e-4  # s: within one, speeds change by less than a hundredth


def two_arms() -> gauss.Scene:
    """An arm of three links, two of them coupled, and a pendulum between their joints; stops, balls and a floor."""
    scene = gauss.Scene("two arms")
    scene.half_space("floor", at=(0.0, 0.0, -1.0))
    for name, parent, x in (("a", "ground", 0.0), ("p", "ground", 2.0), ("b", "a", 0.5), ("c", "b", 1.0)):
        scene.body(name, mass=1.0, inertia=(0.001, 0.02, 0.02), position=(x + 0.25, 0.0, 0.0))
        scene.revolute(f"hinge {name}", parent, name, at=(x, 0.0, 0.0), axis=(0, 1, 0))
        scene.stop(f"hinge {name}", lowest=-2.0, highest=2.0)
        scene.sphere(f"ball {name}", name, 0.05, at=(0.25, 0.0, 0.0))
        scene.contact(f"{name} on floor", f"ball {name}", "floor", friction=0.3)
    scene.contact("clash", "ball p", "ball c", friction=0.1)
    scene.couple("belt", "hinge c", "hinge b", -0.5)
    scene.start("hinge a", rate=3.0)
    return scene


def outside(begin: np.ndarray, end: np.ndarray, columns: int) -> np.ndarray:
    """Places that bounds leave out."""
    return (np.arange(columns) < begin[:, None]) | (np.arange(columns) >= end[:, None])


@pytest.mark.parametrize("seed", range(3))
def test_what_the_patterns_leave_out_is_zero(seed):
    system = gauss.compile_scene(two_arms())
    stepper, state = new_contact_stepper(system), random_state(system, np.random.default_rng(seed))
    N = stepper.compliance.free_columns
    found, terms = step_patterns(stepper.kernels.layout, N), stepper.kernels.terms(0.0, state.q, state.v)
    r, n_v = N.shape[1], len(N)
    inertia = np.zeros(r * r)
    np.add.at(inertia, found.gathered[:, 0], found.weight * terms.M.ravel()[found.gathered[:, 1]])
    whole = N.T @ terms.M @ N
    np.testing.assert_allclose(inertia.reshape(r, r), np.tril(whole), atol=ROUNDING * whole.max())
    C = np.linalg.cholesky(whole)
    Z = N @ np.linalg.inv(C).T
    assert not C[np.arange(r) < found.first[:, None]].any()
    assert not np.linalg.inv(C).T[np.arange(r)[:, None] < found.lowest].any()
    assert not Z[outside(found.z_begin, found.z_end, r)].any()
    assert not terms.J.any(axis=1)[outside(found.body_begin, found.body_end, n_v)].any()
    assert not terms.K[outside(found.row_begin, found.row_end, n_v)].any()
    assert np.ptp(found.lowest) > 0  # the pendulum is linked with nothing


@pytest.mark.slow
def test_the_largest_speed_bounds_that_of_every_shape():
    scene = two_arms()
    scene.input("push", "hinge p", limits=1.0)
    sim = gauss.Simulator(scene, STEP)
    assert sim._run.fastest == np.inf  # before the first step
    for _ in range(5):
        sim.step([1.0], n=100)
        _, velocity, turning = step_limit(sim.system)._motions(sim.state)
        speed = np.linalg.norm(velocity, axis=1).max()
        assert 0.99 * speed <= sim._run.fastest <= 1.2 * (speed + turning.max())
