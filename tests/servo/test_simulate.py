"""Motions under servos: drop-out, tracking at higher relative degree, loss of rank, slack, energy, drift."""

import numpy as np
import pytest

import gauss
from gauss import servo
from gauss.dynamics.kinematics import kinematics
from gauss.errors import SimulationError, StateError
from gauss.servo import AuxiliarySupport, Cable, Motor, Servo, ServoRelation, UnrealisableError
from tests.support import mechanisms, servos

TIGHT = {"rtol": 1e-11, "atol": 1e-13, "progress": False}
BALANCED = 1e-9  # of the energy scale: samples lie inside steps, where dense output is of order 7
DROPPED = 1e-10  # [rad, m]: an auxiliary mass a thousand times larger changes the motion by no more
TRACKED = 1e-9  # [m] over 10 s
TIMES = np.linspace(0.0, 10.0, 101)


def swaying(t):
    return 0.3 * np.sin(2.0 * t)


@pytest.mark.slow
def test_the_cart_drops_out_of_the_motion():
    """Neither the cart's mass nor a force given on it changes the motion; only the servo force does."""
    runs = [
        servo.simulate(
            Servo(scene, [servos.lean(swaying)], [AuxiliarySupport("cart", ("rail",))]), 5.0, times=TIMES[:51], **TIGHT
        )
        for scene in (
            servos.cart_pendulum(1.0),
            servos.cart_pendulum(1000.0),
            servos.cart_pendulum(1.0, cart_force=250.0),
        )
    ]
    for other in runs[1:]:
        assert np.abs(other.motion.q - runs[0].motion.q).max() <= DROPPED
        assert np.abs(other.efforts - runs[0].efforts).max() > 10.0


@pytest.mark.slow
def test_the_plate_drops_out_of_the_motion():
    """Example 6: a disk on a plate that a servo tilts so that its centre stays at rest; contacts are nonholonomic."""
    light, heavy = (
        servo.simulate(servos.rolling_servo(plate), 0.3, times=np.linspace(0, 0.3, 7), **TIGHT) for plate in (3.0, 3000.0)
    )
    assert np.abs(light.motion.q - heavy.motion.q).max() <= DROPPED
    assert np.abs(light.motion.v - heavy.motion.v).max() <= DROPPED * np.abs(light.motion.v).max()
    assert np.abs(light.motion.coordinate("pitch")).max() > 0.05
    assert np.ptp(light.motion.body("disk").position[:, :2], axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert np.abs(heavy.efforts[-1]).min() > 100 * np.abs(light.efforts[-1]).min()


@pytest.mark.slow
def test_pendulum_by_its_closed_form():
    """u = (M + m) ẍ + m l (θ̈ cos θ − θ̇² sin θ) along the whole motion."""
    held = Servo(servos.cart_pendulum(), [servos.lean(swaying)], [Motor("motor", "rail")])
    run = servo.simulate(held, 10.0, times=TIMES, **TIGHT)
    theta, rate, acceleration = swaying(TIMES), 0.6 * np.cos(2 * TIMES), -1.2 * np.sin(2 * TIMES)
    x = (servos.G * np.sin(theta) - 0.8 * acceleration) / np.cos(theta)
    u = 1.5 * x + 0.5 * 0.8 * (acceleration * np.cos(theta) - rate**2 * np.sin(theta))
    assert run.motion.coordinate("pin") == pytest.approx(theta, abs=1e-12)
    assert run.effort("motor") == pytest.approx(u, abs=1e-11)
    assert np.abs(run.residual("lean")).max() <= 1e-12


def flat_crane(T, load=2.0, trolley=10.0):
    """Flat solution of the crane on x = 0.8 sin 0.9 t, y = −3 + 0.4 cos 1.3 t: θ, s, x, T, F (four derivatives by hand)."""
    w, p, g = 0.9, 1.3, servos.G
    x = [0.8 * w**k * np.sin(w * T + k * np.pi / 2) for k in range(5)]
    y = [0.4 * p**k * np.cos(p * T + k * np.pi / 2) for k in range(5)]
    y[0] = y[0] - 3.0
    N, D = -np.array(x[2:5]), np.array([y[2] + g, y[3], y[4]])
    tangent = N[0] / D[0]
    rate = (N[1] - tangent * D[1]) / D[0]
    second = (N[2] - 2 * rate * D[1] - tangent * D[2]) / D[0]
    theta = np.arctan(tangent)
    tension = load * D[0] / np.cos(theta)
    acceleration = x[2] + y[2] * tangent + 2 * y[1] * rate + y[0] * second
    return theta, -y[0] / np.cos(theta), x[0] + y[0] * tangent, tension, trolley * acceleration - tension * np.sin(theta)


@pytest.mark.slow
def test_crane_follows_a_path():
    """Example 3, relative degree 4: path error over 10 s, and both servo forces against the flat solution."""
    held = servos.crane_servo(lambda t: 0.8 * np.sin(0.9 * t), lambda t: -3.0 + 0.4 * np.cos(1.3 * t))
    verdict = servo.realisable(held)
    assert verdict and verdict.outcome == "higher degree" and verdict.degree == 4 and "rank 1" in verdict.reason
    run = servo.simulate(held, 10.0, times=TIMES, **TIGHT)
    path = np.array([0.8 * np.sin(0.9 * TIMES), -3.0 + 0.4 * np.cos(1.3 * TIMES)]).T
    assert np.abs(run.motion.body("load").position[:, :2] - path).max() <= TRACKED
    theta, length, x, tension, force = flat_crane(TIMES)
    for coordinate, expected in (("swing", theta), ("hoist", length), ("rail", x)):
        assert run.motion.coordinate(coordinate) == pytest.approx(expected, abs=1e-11)
    assert run.effort("rope") == pytest.approx(tension, rel=1e-11)
    assert run.effort("trolley force") == pytest.approx(force, abs=1e-9)
    found = servo.energy(run)
    assert np.abs(found.balance).max() <= BALANCED * found.scale
    assert servo.solve(held, run.motion.state(40)).efforts == pytest.approx(run.efforts[40], rel=1e-10)


@pytest.mark.slow
def test_two_masses_and_a_spring():
    """Example 4: μ = m1 x1'' + m2 x_d'', x1 = x_d + m2 x_d''/k."""
    run = servo.simulate(servos.two_masses_servo(lambda t: 0.1 * np.sin(3 * t)), 10.0, times=TIMES, **TIGHT)
    assert run.verdict.degree == 4
    x = 0.1 * np.sin(3 * TIMES)
    assert run.motion.coordinate("xsecond") == pytest.approx(x, abs=TRACKED)
    assert run.motion.coordinate("xfirst") == pytest.approx(x * (1 - 2.0 * 9 / 50), abs=1e-11)
    assert run.effort("force") == pytest.approx(-9 * x * (1 - 2.0 * 9 / 50) - 2 * 9 * x, abs=1e-9)


@pytest.mark.slow
def test_damping_lowers_the_relative_degree():
    """With a damper beside the spring the force reaches the second mass one derivative earlier."""
    scene = servos.two_masses()
    scene.spring("damper", "first", "second", stiffness=0.0, damping=0.5)
    follow = ServoRelation("second", lambda t, m: m.coordinate("xsecond") - 0.1 * np.sin(3 * t))
    held = Servo(scene, [follow], [Motor("force", "xfirst")])
    assert servo.realisable(held).degree == 3
    run = servo.simulate(held, 1.0, times=TIMES[:11], progress=False)
    assert run.motion.coordinate("xsecond") == pytest.approx(0.1 * np.sin(3 * TIMES[:11]), abs=TRACKED)


def test_higher_degree_is_refused_where_it_cannot_be_reduced():
    scene = servos.two_masses()
    scene.drive("xfirst", force=lambda t: 0.1 if float(t) < 1.0 else 0.0)
    follow = ServoRelation("second", lambda t, m: m.coordinate("xsecond") - t)
    verdict = servo.realisable(Servo(scene, [follow], [Motor("force", "xfirst")]))
    assert verdict.outcome == "no hold"
    assert "'drive of xfirst'" in verdict.reason and "'second'" in verdict.reason


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1.0, 0.3])
def test_loss_of_rank_is_located(speed):
    """The inclination is asked to pass 90°: the run ends there, at the time at which it is reached, with its motion."""
    held = Servo(servos.cart_pendulum(), [servos.lean(lambda t: 0.5 + speed * t)], [Motor("motor", "rail")])
    with pytest.raises(UnrealisableError, match="'lean'.*'motor'") as caught:
        servo.simulate(held, 10.0, progress=False)
    reached = caught.value.trajectory
    assert reached.t[-1] == pytest.approx((np.pi / 2 - 0.5) / speed, abs=1e-6)
    assert np.abs(reached.residual("lean")).max() <= 1e-12
    assert reached.smallest[-1] < 1e-6 and reached.smallest[0] > 0.1


def test_fixed_steps_do_not_jump_over_a_loss_of_rank():
    """One step across 90° changes the sign of S: refused, never a silent wrong motion."""
    held = Servo(servos.cart_pendulum(), [servos.lean(lambda t: 1.5 + t)], [Motor("motor", "rail")])
    with pytest.raises(UnrealisableError, match="'lean'"):
        servo.simulate(held, 1.0, integrator="rk4", step=0.11, progress=False)


@pytest.mark.slow
def test_slack_cable_is_located():
    """A load that is let down faster than it falls would need a rope that pushes: from y'' = −g on."""
    held = servos.crane_servo(lambda t: 0.0 * t, lambda t: -3.0 - 2.0 * t**3)
    with pytest.raises(SimulationError, match="'rope'") as caught:
        servo.simulate(held, 3.0, progress=False)
    assert caught.value.trajectory.t[-1] == pytest.approx(servos.G / 12.0, abs=1e-6)


def cable_robot() -> gauss.Scene:
    """Point load in a plane, hung on three cables."""
    scene = gauss.Scene("cable robot", gravity=(0, 0, -servos.G))
    scene.body("carrier", 0.0)
    scene.body("load", 5.0)
    scene.prismatic("x", "ground", "carrier", axis=(1, 0, 0))
    scene.prismatic("z", "carrier", "load", axis=(0, 0, 1))
    return scene


@pytest.mark.slow
def test_redundant_cables_stay_taut():
    """Three cables, two relations: the least norm that pulls; the preload of least tension is kept."""
    path = ServoRelation("path", lambda t, m: m.position("load")[::2] - np.array([0.5 * np.cos(t), 1.0 + 0.5 * np.sin(t)]))
    corners = {"left": (-2, 0, 3), "right": (2, 0, 3), "floor": (0, 0, -1)}
    cables = [Cable(name, "load", "ground", other_at=at, slack=20.0) for name, at in corners.items()]
    held = Servo(cable_robot(), [path], cables)
    run = servo.simulate(held, 6.0, times=TIMES[:61], **TIGHT)
    assert (run.efforts >= 20.0 - 1e-6).all() and run.efforts.min() == pytest.approx(20.0, abs=1e-6)
    assert np.abs(run.residuals).max() <= 1e-12
    two = Servo(cable_robot(), [path], cables[::2])
    with pytest.raises(SimulationError, match="cables can only pull"):
        servo.simulate(two, 6.0, progress=False)


@pytest.mark.slow
def test_energy_is_the_work_of_the_servos():
    """T + V changes by the work of each reaction of the second kind; it is kept where W q̇ = 0."""
    motors = [Motor("motor", "rail"), Motor("torque", "pin")]
    held = Servo(servos.cart_pendulum(), [servos.lean(swaying), servos.at(lambda t: 0.1 * t * t)], motors)
    found = servo.energy(servo.simulate(held, 3.0, times=TIMES[:31], **TIGHT))
    assert np.abs(found.servos).max(axis=0).min() > 0.1
    assert np.abs(found.balance).max() <= BALANCED * found.scale
    still = Servo(servos.cart_pendulum(), [servos.at(lambda t: 0.0 * t)], [Motor("motor", "rail")])
    kept = servo.simulate(still, 3.0, state=still.system.state([0, 0.5]), times=TIMES[:31], **TIGHT)
    assert np.abs(kept.work).max() <= 1e-12 and np.abs(kept.efforts).max() > 1.0
    total = servo.energy(kept)
    assert np.ptp(total.kinetic + total.potential) <= BALANCED * total.scale


def test_start_is_made_consistent_through_the_actuators():
    """What the relation leaves open moves as an impulse of the cart's motor would move it, not by the mass metric."""
    held = Servo(servos.cart_pendulum(3.0), [servos.lean(lambda t: 0.3 + 0.7 * t)], [Motor("motor", "rail")])
    state = servo.initial_state(held, held.system.state([0.2, 0.3], [0.1, 0.2]))
    assert state.q == pytest.approx([0.2, 0.3], abs=1e-13)
    # the pin carries no moment: l θ̇ + ẋ cos θ is not changed by a force on the cart
    assert state.v[1] == pytest.approx(0.7, abs=1e-13)
    assert 0.8 * state.v[1] + np.cos(0.3) * state.v[0] == pytest.approx(0.8 * 0.2 + np.cos(0.3) * 0.1, abs=1e-12)


def test_start_that_cannot_be_met():
    far = ServoRelation("reach", lambda t, m: m.position("lower", (0.8, 0, 0))[0] - 5.0)
    held = Servo(servos.arm(), [far], [Motor("shoulder motor", "shoulder")])
    with pytest.raises((StateError, UnrealisableError), match="'reach'"):
        servo.initial_state(held)


@pytest.mark.slow
def test_arm_drawn_along_a_line_and_drift():
    """Example 5 along a motion: the relation is kept to rounding though steps are coarse."""
    held = Servo(servos.arm(), [servos.tip_on_line()], [Motor("shoulder motor", "shoulder")])
    run = servo.simulate(held, 0.5, rtol=1e-5, atol=1e-7, progress=False)
    assert np.abs(run.residual("tip")).max() <= 1e-12
    fixed = servo.simulate(held, 0.5, integrator="rk4", step=0.01, progress=False)
    assert np.abs(fixed.residual("tip")).max() <= 1e-12
    assert fixed.motion.q[-1] == pytest.approx(run.motion.q[-1], abs=1e-4)


@pytest.mark.slow
def test_closed_loop_under_a_servo():
    """The coupler point of a four-bar moves as prescribed, by a motor on the crank; loops stay closed."""
    scene = mechanisms.four_bar()
    scene.start("A", 0.5, 0.0)
    start = gauss.compile_scene(scene).initial_state()
    y = kinematics(gauss.compile_scene(scene), start).position("coupler", (0.5, 0, 0))[1]
    follow = ServoRelation("coupler", lambda t, m: m.position("coupler", (0.5, 0, 0))[1] - y - 0.05 * np.sin(2 * t) ** 2)
    held = Servo(scene, [follow], [Motor("motor", "A")])
    run = servo.simulate(held, 1.0, rtol=1e-9, atol=1e-11, times=np.linspace(0, 1, 11), progress=False)
    assert np.abs(run.residuals).max() <= 1e-11
    found = servo.energy(run)
    assert np.abs(found.balance).max() <= BALANCED * found.scale


@pytest.mark.slow
def test_systems_that_are_not_compiled_move_alike():
    """A law that asks where bodies are keeps the dynamics from being traced: the saddle system moves the servo then."""
    runs = []
    for wind in ((0.0, 0.0, 0.0), lambda t, motion: [0.0 if float(x) > 9.0 else 0.0 for x in motion.position("bob")]):
        scene = servos.cart_pendulum()
        scene.force("wind", "bob", force=wind)
        held = Servo(scene, [servos.lean(swaying)], [Motor("motor", "rail")])
        runs.append(servo.simulate(held, 0.5, times=np.linspace(0, 0.5, 6), **TIGHT))
    assert [run.motion.stats.plan.dynamics for run in runs] == ["compiled", "certified"]
    assert runs[1].motion.q == pytest.approx(runs[0].motion.q, abs=1e-12)
    assert runs[1].efforts == pytest.approx(runs[0].efforts, abs=1e-11)
