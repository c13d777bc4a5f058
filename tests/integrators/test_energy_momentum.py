"""The method that conserves energy: to rounding, with loops, on the manifold, and beside loads that do work."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from gauss.simulation.compiled_steps.momentum_form import MomentumForm
from tests.support import closed_forms, mechanisms

ROUNDING = 1e-14  # of the largest energy: a few roundings of its parts, however many steps
SCENES = {
    "pendulum": (lambda: closed_forms.pendulum().scene, 100_000),
    "double pendulum": (lambda: gauss.load("double_pendulum"), 100_000),
    "heavy top": (lambda: gauss.load("heavy_top"), 20_000),
    "four-bar": (mechanisms.four_bar, 20_000),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_energy_is_conserved_to_rounding(name):
    """Steps so long that the midpoint method errs by 1e-5 and more."""
    build, steps = SCENES[name]
    system, h = gauss.compile_scene(build()), 2e-3
    times = np.linspace(0.0, steps * h, 1001)
    motion = gauss.simulate(system, times[-1], integrator="energy_momentum", step=h, times=times)
    found = gauss.energy(motion)
    assert np.abs(found.balance).max() <= ROUNDING * found.scale
    assert (
        max(
            np.max(np.abs(gauss.assemble(system, system.state(q)).constraint_residual), initial=0.0) for q in motion.q[::100]
        )
        <= 1e-12
    )


def _turning() -> gauss.Scene:
    """A pendulum on a column that turns about the vertical: no force depends on the angle of the column."""
    scene = gauss.Scene("turning", gravity=(0, 0, -9.81))
    scene.body("column", mass=2.0, inertia=(0.3, 0.3, 0.2))
    scene.revolute("turn", "ground", "column", axis=(0, 0, 1))
    scene.body("rod", mass=1.5, inertia=(0.24, 0.25, 0.03), com=(0.1, 0.0, -0.5), position=(0.4, 0, 0))
    scene.revolute("swing", "column", "rod", at=(0.4, 0, 0), axis=(0, 1, 0))
    scene.start("swing", 1.2, 0.4)
    scene.start("turn", rate=2.0)
    return scene


@pytest.mark.slow
def test_momentum_of_a_cyclic_coordinate_is_conserved():
    system = gauss.compile_scene(_turning())
    mechanics = MomentumForm(Program(system, Laws(system)))
    assert mechanics.acts.tolist() == [0.0, 1.0]
    motion = gauss.simulate(system, 20.0, integrator="energy_momentum", step=4e-3)
    mass = np.array([mechanisms.mass_matrix(system, q)[0] for q in motion.q[::50]])
    momentum = np.sum(mass * motion.v[::50], axis=1)
    assert np.ptp(momentum) <= 1e-13 * momentum[0]
    found = gauss.energy(motion)
    off = np.abs(found.balance) / found.scale  # the few steps in which the pendulum turns are made up for by the next
    assert off.max() <= 10 * ROUNDING and np.quantile(off, 0.99) <= ROUNDING


def _sprung() -> gauss.Scene:
    """Four-bar with a spring and a joint spring: their energy is potential."""
    scene = mechanisms.four_bar()
    scene.joint_spring("S", "D", stiffness=30.0, rest=0.2)
    scene.spring("rope", "coupler", "ground", at=(0.5, 0, 0), other_at=(1.0, 1.0, 0.5), stiffness=20.0, length=0.4)
    return scene


def _worked() -> gauss.Scene:
    """The same with dampers, a drive and a force."""
    scene = _sprung()
    scene.joint_spring("damper", "A", damping=0.4)
    scene.drive("A", torque=lambda t: 5.0 * np.sin(3 * t))
    scene.force("wind", "rocker", force=lambda t: (0.0, 2.0 * t, 1.0), at=(0.3, 0, 0))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("build", [_sprung, _worked])
def test_what_does_work_is_what_the_energy_changes_by(build):
    motion = gauss.simulate(build(), 4.0, integrator="energy_momentum", step=2e-3)
    found = gauss.energy(motion)
    assert np.ptp(found.potential) > 1.0
    assert np.abs(found.balance).max() <= 2 * ROUNDING * found.scale


def test_a_system_at_rest_stays():
    scene = closed_forms.pendulum(0.0).scene
    motion = gauss.simulate(scene, 1.0, integrator="energy_momentum", step=0.01)
    assert not motion.q.any() and not motion.v.any()
