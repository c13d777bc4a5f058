"""Symplectic methods over many steps in space: energy without a trend, momentum to rounding; overconstrained linkages."""

import numpy as np
import pytest

import gauss
from benchmarks.long_run_scenes import SCENES, angular_momentum, energy_error, momentum_error, trend
from gauss import rotations
from gauss.integrators import METHODS
from tests.support import mechanisms
from tests.support.orders import MECHANICAL

METHODS_IN_MOMENTA = ("verlet", "variational_midpoint", "gauss4", "gauss6")
SPATIAL = [name for name, run in SCENES.items() if run.axes]

STEPS, SAMPLES = 40_000, 1001
STEP = {"spatial_double_pendulum": 2e-3}  # s: chaotic; slow swings of the others take 50 s, so they run for 160 s
LONG_STEP = 4e-3  # s
MOMENTUM = 3e-13  # relative: that many compensated sums, and the rounding of forces and of the states that it is read off
NOISE = 4.0  # standard errors of a slope
WALK = 5e-14  # of the energies: random walk of rounding, which has slopes of its own
SYMPLECTIC = 1e-8  # differences of differences of 1e-4 rad of what is smooth over 1 rad
CLOSED = 1e-11  # rad: gap of 1e-12 m over the sines of twists


def _long(name: str, integrator: str) -> gauss.Trajectory:
    step = STEP.get(name, LONG_STEP)
    times = np.linspace(0.0, STEPS * step, SAMPLES)
    return gauss.simulate(SCENES[name].build(), times[-1], integrator=integrator, step=step, times=times)


@pytest.mark.slow
@pytest.mark.parametrize("name", SPATIAL)
@pytest.mark.parametrize("integrator", METHODS_IN_MOMENTA)
def test_energy_has_no_trend_and_momentum_is_conserved(integrator, name):
    motion = _long(name, integrator)
    change, noise = trend(motion.t, energy_error(motion))
    assert abs(change) <= NOISE * noise + WALK
    assert momentum_error(motion, SCENES[name].axes) <= MOMENTUM


@pytest.mark.slow
def test_the_trend_of_a_method_that_is_not_symplectic_is_seen():
    motion = _long("asymmetric_top", "rk4")
    change, noise = trend(motion.t, energy_error(motion))
    assert abs(change) > NOISE * noise + WALK
    assert momentum_error(motion, (2,)) > MOMENTUM


def test_angular_momentum_is_that_of_a_body_known_by_hand():
    motion = gauss.simulate(gauss.load("free_body"), 0.1)
    R = [rotations.from_quaternion(q[3:]) for q in motion.q]
    inertia = np.diag(motion.system.Phi[:3])
    expected = [turned @ inertia @ v[3:] for turned, v in zip(R, motion.v, strict=True)]
    assert angular_momentum(motion) == pytest.approx(np.array(expected), abs=1e-14)


class _Canonical:
    """Rotation vectors about a fixed rotation and their momenta: canonical coordinates of a body on a ball joint."""

    def __init__(self, system, centre):
        self.system, self.centre = system, centre

    def state(self, x):
        theta, momentum = x[:3], x[3:]
        q = rotations.multiply(self.centre, rotations.exponential(theta))
        rates = np.array([rotations.rotation_vector_rate(theta, unit) for unit in np.eye(3)]).T
        return self.system.state(q, np.linalg.solve(mechanisms.mass_matrix(self.system, q), rates.T @ momentum))

    def coordinates(self, q, v):
        there = rotations.multiply(rotations.conjugate(self.centre), q)
        theta = rotations.to_rotation_vector(rotations.from_quaternion(there))
        velocities = np.array([rotations.rotation_vector_velocity(theta, unit) for unit in np.eye(3)]).T
        return np.concatenate([theta, velocities.T @ mechanisms.mass_matrix(self.system, q) @ v])


def _lack_of_symplecticity(integrator: str) -> float:
    """Largest entry of Jᵀ Ω J − Ω for one long step, J being made of central differences of fourth order."""
    system, h, amount = gauss.compile_scene(SCENES["asymmetric_top"].build()), 0.03, 2e-3
    start = system.initial_state()
    canonical = _Canonical(system, rotations.multiply(start.q, rotations.exponential(np.array([0.2, -0.1, 0.3]))))

    def mapped(x):
        motion = gauss.simulate(system, h, integrator=integrator, step=h, state=canonical.state(x))
        return canonical.coordinates(motion.q[-1], motion.v[-1])

    x, columns = canonical.coordinates(start.q, start.v), []
    for unit in amount * np.eye(6):
        near, far = mapped(x + unit) - mapped(x - unit), mapped(x + 2 * unit) - mapped(x - 2 * unit)
        columns.append((8.0 * near - far) / (12.0 * amount))
    J = np.array(columns).T
    omega = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    return np.abs(J.T @ omega @ J - omega).max()


@pytest.mark.slow
@pytest.mark.parametrize("integrator", METHODS_IN_MOMENTA)
def test_a_step_is_a_symplectic_map_of_rotations(integrator):
    assert _lack_of_symplecticity(integrator) <= SYMPLECTIC


def test_a_step_that_is_not_symplectic_is_told_from_one_that_is():
    assert _lack_of_symplecticity("rk4") > 100 * SYMPLECTIC


def _rods_on_balls() -> gauss.Scene:
    """Crank, coupler on two balls and rocker, in space: a loop with ball joints in it; the coupler spins."""
    scene = gauss.Scene("RSSR", gravity=(0, 0, -9.81))
    scene.body("crank", mass=1.0, inertia=(0.01, 0.05, 0.05), com=(0.15, 0, 0))
    scene.body("coupler", mass=0.8, inertia=(0.01, 0.06, 0.07), com=(0, 0.02, 0.45), position=(0.3, 0, 0))
    scene.body("rocker", mass=1.2, inertia=(0.05, 0.01, 0.05), com=(0, -0.2, 0), position=(0.3, 0.5, 0.9))
    scene.revolute("A", "ground", "crank", axis=(0, 0, 1))
    scene.ball("B", "crank", "coupler", at=(0.3, 0, 0))
    scene.ball("C", "coupler", "rocker", at=(0.3, 0, 0.9))
    scene.revolute("D", "ground", "rocker", at=(0.3, 0.5, 0.9), axis=(1, 0, 0))
    scene.start("A", rate=3.0)
    scene.start("B", rate=(0.0, 0.0, 4.0))
    return scene


CONVERGING = {"asymmetric top": SCENES["asymmetric_top"].build, "loop with balls": _rods_on_balls}


@pytest.mark.slow
@pytest.mark.parametrize("name", CONVERGING)
@pytest.mark.parametrize("integrator", METHODS_IN_MOMENTA)
def test_order_in_space(integrator, name):
    """Against dop853, whose error is far below."""
    system, duration, order = gauss.compile_scene(CONVERGING[name]()), 0.4, METHODS[integrator].order
    exact, errors = gauss.simulate(system, duration, rtol=1e-13, atol=1e-13), []
    counts = (100, 200) if order < 6 else (25, 50)
    for count in counts:
        motion = gauss.simulate(system, duration, integrator=integrator, step=duration / count)
        errors.append(np.abs(np.concatenate([motion.q[-1] - exact.q[-1], motion.v[-1] - exact.v[-1]])).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.slow
def test_loops_with_balls_stay_closed_and_keep_their_energy():
    times = np.linspace(0.0, 8.0, 401)
    for integrator in METHODS_IN_MOMENTA:
        motion = gauss.simulate(_rods_on_balls(), times[-1], integrator=integrator, step=2e-3, times=times)
        change, noise = trend(motion.t, energy_error(motion))
        assert abs(change) <= NOISE * noise + WALK
        assert (
            max(
                np.abs(gauss.assemble(motion.system, motion.system.state(q)).constraint_residual).max()
                for q in motion.q[::50]
            )
            <= 1e-13
        )


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 1.0])
@pytest.mark.parametrize("integrator", MECHANICAL)
def test_overconstrained_linkages_run_with_any_step(integrator, rate):
    """Bennett's linkage, whose rows are dependent on its motion alone; it begins at rest with all coordinates zero, too."""
    scene, relation = mechanisms.bennett(rate)
    system = gauss.compile_scene(scene)
    for step, count in ((1e-2, 60), (1e-3, 400), (1e-4, 1000), (1e-5, 1000)):
        motion = gauss.simulate(system, count * step, integrator=integrator, step=step, times=[0.0, count * step])
        assert np.abs(relation(motion)).max() <= CLOSED


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Bennett", "bricard"])
@pytest.mark.parametrize("integrator, most", [("gauss4", 1e-7), ("gauss6", 1e-11)])
def test_overconstrained_linkages_move_as_they_do_by_another_method(integrator, most, name):
    system = gauss.compile_scene(mechanisms.bennett(1.0)[0] if name == "Bennett" else gauss.load(name))
    exact = gauss.simulate(system, 0.8, integrator="radau5")
    motion = gauss.simulate(system, 0.8, integrator=integrator, step=5e-3)
    assert np.abs(motion.q[-1] - exact.q[-1]).max() <= most
