"""Planned motions: durations in closed form, limits that are touched and kept, drives, loops, straight lines."""

import numpy as np
import pytest

import gauss
from gauss.errors import GaussError

ROUNDED = 1e-12  # of positions, rates and limits
DRIVEN = 1e-9  # error of a simulated drive
LINE = 1e-6  # deviation of a path from its line between 20 samples [m]
DIFFERENCE = 1e-5  # error of differences over time
POINTS = [{"A": 0.0, "B": 0.0}, {"A": 1.0, "B": -0.5}, {"A": 0.3, "B": 0.8}]
SHAPES = ("trapezoid", "s-curve", "cubic", "quintic")
LIMITS = {"speeds": 1.0, "accelerations": 2.0, "jerks": 10.0}
HIPS = ["hip1", "hip2", "hip3"]


@pytest.fixture(scope="module")
def pendulum():
    return gauss.compile_scene(gauss.load("double_pendulum"))


@pytest.fixture(scope="module")
def delta():
    return gauss.compile_scene(gauss.load("delta_robot"))


def move(system, shape: str = "trapezoid", **limits):
    return gauss.plan_motion(system, [{"A": 0.0, "B": 0.0}, {"A": 2.0, "B": 0.5}], shape=shape, **limits)


@pytest.mark.parametrize(
    "speed, acceleration, jerk, duration",
    [
        (1.0, 2.0, None, 2.0 / 1.0 + 1.0 / 2.0),  # trapezoid: h/v + v/a
        (9.0, 2.0, None, 2.0 * np.sqrt(2.0 / 2.0)),  # triangle: 2 √(h/a)
        (1.0, 2.0, 10.0, 2.0 / 1.0 + 1.0 / 2.0 + 2.0 / 10.0),  # h/v + v/a + a/j
        (1.0, 9.0, 4.0, 2.0 / 1.0 + 2.0 * np.sqrt(1.0 / 4.0)),  # without constant acceleration: h/v + 2 √(v/j)
        (9.0, 9.0, 4.0, 4.0 * (2.0 / (2.0 * 4.0)) ** (1.0 / 3.0)),  # jerks alone: 4 (h/2j)^⅓
        (9.0, 2.0, 10.0, 0.2 + np.sqrt(0.2**2 + 4.0 * 2.0 / 2.0)),  # T_j + √(T_j² + 4h/a)
    ],
)
def test_durations_are_least(pendulum, speed, acceleration, jerk, duration):
    shape = "trapezoid" if jerk is None else "s-curve"
    found = move(pendulum, shape, speeds=speed, accelerations=acceleration, jerks=jerk)
    assert abs(found.duration - duration) < ROUNDED


@pytest.mark.parametrize("shape", SHAPES)
def test_limits_are_touched_and_kept(pendulum, shape):
    found = gauss.plan_motion(pendulum, POINTS, shape=shape, begin=0.5, **LIMITS)
    t = np.linspace(found.begin, found.end, 4001)
    shares = [np.abs(found.rate(t)).max() / 1.0, np.abs(found.acceleration(t)).max() / 2.0]
    shares += [np.abs(found.law.derivative(3)(t)).max() / 10.0] if shape != "trapezoid" else []
    assert max(shares) <= 1.0 + ROUNDED and max(shares) > 1.0 - 1e-3
    assert found.begin == 0.5
    for time, point in ((-9.0, POINTS[0]), (found.begin, POINTS[0]), (found.end, POINTS[2]), (99.0, POINTS[2])):
        assert np.abs(found.position(time) - list(point.values())).max() < ROUNDED
        assert np.abs(found.rate(time)).max() < ROUNDED
    assert np.abs(found.law(found.law.x[1:-1])[:, None] - list(POINTS[1].values())).max(axis=2).min() < ROUNDED


@pytest.mark.parametrize("shape, smooth", [("trapezoid", 1), ("s-curve", 2), ("cubic", 2), ("quintic", 4)])
def test_derivatives_are_continuous(pendulum, shape, smooth):
    found, h = gauss.plan_motion(pendulum, POINTS, shape=shape, **LIMITS), 1e-9
    inner = found.law.x[2:-2]
    for order in range(smooth + 1):
        law = found.law.derivative(order)
        assert np.abs(law(inner - h) - law(inner + h)).max() < 1e-6  # h times the next derivative


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_drives_follow(shape):
    scene = gauss.load("double_pendulum")
    scene.starts.clear()
    found = gauss.plan_motion(scene, POINTS, shape=shape, begin=0.2, **LIMITS)
    for name in found.coordinates:
        scene.drive(name, angle=found[name])
    motion = gauss.simulate(scene, found.end + 0.2, times=np.linspace(0, found.end + 0.2, 20))
    assert "compiled" in motion.stats.plan.driver
    assert np.abs(motion.q - found.position(motion.t)).max() < DRIVEN
    assert np.abs(motion.v - found.rate(motion.t)).max() < DRIVEN


def test_positions_rates_and_accelerations_trace():
    scene = gauss.load("double_pendulum")
    scene.starts.clear()
    found = gauss.plan_motion(scene, POINTS, shape="quintic", speeds=1.0)
    scene.drive("A", angle=lambda t: found.position(t)[0])
    scene.drive("B", speed=lambda t: found.rate(t)[1])
    scene.force("push", "lower", lambda t: (0.0, 0.1 * found.acceleration(t)[0], 0.0))
    motion = gauss.simulate(scene, 1.0, rtol=1e-9, atol=1e-9)
    assert np.abs(motion.q - found.position(motion.t)).max() < 1e-7  # a speed is integrated


@pytest.mark.slow
def test_accelerations_and_torques_of_a_loop(delta):
    start = delta.initial_state()
    first = {name: float(start.q[delta.joint(name).q][0]) for name in HIPS}
    found = gauss.plan_motion(delta, [first, {"hip1": 0.3, "hip2": -0.1, "hip3": 0.1}], speeds=1.0, accelerations=4.0)
    h, t = 1e-5, 0.3 * found.duration
    before, state, after = found.states(delta, [t - h, t, t + h], start=start)
    acceleration = found.accelerations(delta, state)
    assert np.abs((after.v - before.v) / (2 * h) - acceleration).max() < DIFFERENCE
    assert np.abs((after.q - before.q)[: delta.joint("wrist1a").q.start] / (2 * h) - state.v[:3]).max() < DIFFERENCE
    torques = gauss.inverse_dynamics(delta, state, acceleration, HIPS)
    load = np.zeros(delta.n_v)
    load[[delta.column(name) for name in HIPS]] = torques.forces
    assert np.abs(delta.accelerations(state, load) - acceleration).max() < 1e-8 * max(1.0, np.abs(acceleration).max())


def test_a_trajectory_of_a_four_bar_is_closed():
    system = gauss.compile_scene(gauss.load("four_bar"))
    found = gauss.plan_motion(system, [{"A": 0.0}, {"A": 2.0}], speeds=3.0, accelerations=8.0, shape="cubic")
    motion = found.trajectory(system, np.linspace(0, found.end, 15))
    for k in range(len(motion)):
        residual, K, _ = system.evaluate(("loop_constraints",), motion.q[k], motion.v[k])["loop_constraints"]
        assert np.abs(residual).max() < 1e-11 and np.abs(K @ motion.v[k]).max() < 1e-9
    assert np.abs(motion.q[:, 0] - found.position(motion.t)[:, 0]).max() < ROUNDED


@pytest.mark.slow
def test_points_may_be_states(delta):
    one, other = (
        delta.initial_state(),
        gauss.inverse_kinematics(delta, gauss.PointTarget("platform", (0.05, 0, -0.35))).state,
    )
    found = gauss.plan_motion(delta, [one, other], coordinates=HIPS, speeds=1.0, accelerations=2.0)
    assert found.coordinates == tuple(HIPS)
    last = found.states(delta, [found.end], start=other)[0]
    assert np.abs(delta.forward_kinematics(last.q, "platform")[1] - [0.05, 0, -0.35]).max() < 1e-8


def tip(x: float, y: float) -> gauss.PointTarget:
    return gauss.PointTarget("lower", (x, y, 0.0), at=(0.5, 0.0, 0.0))


def test_a_path_is_straight_and_as_fast_as_allowed(pendulum):
    found = gauss.plan_path(pendulum, [tip(0.6, -0.8), tip(0.2, -0.8), tip(0.2, -0.6)], speed=0.5, acceleration=2.0)
    assert abs(found.duration - (0.4 / 0.5 + 0.25) - (0.2 / 0.5 + 0.25)) < ROUNDED
    t = np.linspace(0, found.end, 301)
    R, p = pendulum.forward_kinematics(found.position(t), "lower")
    place, first = p + 0.5 * R[:, :, 0], t <= 1.05
    assert np.abs(place[first, 1] + 0.8).max() < LINE and np.abs(place[~first, 0] - 0.2).max() < LINE
    J = pendulum.jacobian(found.position(t), "lower")
    v = np.einsum("kij,kj->ki", J, found.rate(t))
    speed = np.hypot(v[:, 3] - 0.5 * R[:, 1, 0] * v[:, 2], v[:, 4] + 0.5 * R[:, 0, 0] * v[:, 2])
    assert abs(speed.max() - 0.5) < 1e-4


def test_a_path_slows_down_for_its_coordinates(pendulum):
    ends = [tip(0.6, -0.8), tip(0.2, -0.8)]
    found = gauss.plan_path(pendulum, ends, speed=0.5, acceleration=2.0, speeds={"B": 0.4}, accelerations=3.0)
    t = np.linspace(0, found.end, 2001)
    shares = np.abs(found.rate(t)[:, 1]).max() / 0.4, np.abs(found.acceleration(t)).max() / 3.0
    assert max(shares) <= 1.0 + ROUNDED and max(shares) > 0.99 and found.duration > 1.05


@pytest.mark.slow
def test_a_pose_turns_about_a_fixed_axis():
    system = gauss.compile_scene(gauss.load("stewart_platform"))
    legs = [f"leg{k}" for k in range(1, 7)]
    ends = [gauss.PoseTarget("platform", (0, 0, 1.0), (0, 0, 0)), gauss.PoseTarget("platform", (0, 0.05, 1.05), (0, 0, 0.2))]
    options = {"turning_speed": 0.2, "turning_acceleration": 1.0, "samples": 4}
    found = gauss.plan_path(system, ends, speed=1.0, acceleration=5.0, coordinates=legs, **options)
    assert abs(found.duration - (0.2 / 0.2 + 0.2)) < ROUNDED
    middle = found.states(system, [0.5 * found.duration])[0]
    R, p = system.forward_kinematics(middle.q, "platform")
    assert np.abs(p - [0, 0.025, 1.025]).max() < 1e-4
    assert np.abs(R - [[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]]).max() < 1e-4


WRONG = {
    "one point": (lambda s: gauss.plan_motion(s, POINTS[:1], **LIMITS), "two points"),
    "same points": (lambda s: gauss.plan_motion(s, POINTS[:1] * 2, **LIMITS), "same"),
    "other names": (lambda s: gauss.plan_motion(s, [{"A": 0.0}, {"B": 1.0}], **LIMITS), "same coordinates"),
    "unknown name": (lambda s: gauss.plan_motion(s, [{"A1": 0.0}, {"A1": 1.0}], **LIMITS), "A1"),
    "text": (lambda s: gauss.plan_motion(s, [{"A": 0.0}, {"A": "x"}], **LIMITS), "finite numbers"),
    "shape": (lambda s: gauss.plan_motion(s, POINTS, shape="cubik", **LIMITS), "cubic"),
    "no limits": (lambda s: gauss.plan_motion(s, POINTS, shape="cubic"), "speeds="),
    "no acceleration": (lambda s: gauss.plan_motion(s, POINTS, speeds=1.0), "accelerations="),
    "no jerk": (lambda s: gauss.plan_motion(s, POINTS, speeds=1.0, accelerations=1.0, shape="s-curve"), "jerks="),
    "negative": (lambda s: gauss.plan_motion(s, POINTS, speeds=-1.0, accelerations=1.0), "speeds"),
    "law of none": (lambda s: gauss.plan_motion(s, POINTS, **LIMITS)["C"], "C"),
    "path of one": (lambda s: gauss.plan_path(s, [tip(0.6, -0.8)], speed=1, acceleration=1), "two targets"),
    "path of two kinds": (
        lambda s: gauss.plan_path(s, [tip(0.6, -0.8), gauss.PoseTarget("lower", (0, 0, 0))], speed=1, acceleration=1),
        "one kind",
    ),
    "out of reach": (lambda s: gauss.plan_path(s, [tip(0.6, -0.8), tip(3, 0)], speed=1, acceleration=1), "line 1, at"),
    "speed": (lambda s: gauss.plan_path(s, [tip(0.6, -0.8), tip(0.2, -0.8)], speed=0, acceleration=1), "speed"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_named(pendulum, case):
    call, named = WRONG[case]
    with pytest.raises(GaussError, match=named):
        call(pendulum)


def test_loops_ask_for_the_driven_coordinates(delta):
    with pytest.raises(GaussError, match="coordinates="):
        gauss.plan_motion(delta, [delta.initial_state(), delta.initial_state()], speeds=1.0, accelerations=1.0)


def test_a_motion_that_the_loop_forbids_is_named():
    system = gauss.compile_scene(gauss.load("four_bar"))
    found = gauss.plan_motion(system, [{"D": 0.0}, {"D": 6.0}], speeds=3.0, accelerations=8.0)
    with pytest.raises(GaussError, match="at t = .*D"):
        found.states(system, np.linspace(0, found.end, 40))


def test_limits_of_joints_are_kept():
    scene = gauss.Scene("limited")
    scene.body("a", 1.0, (0.1, 0.1, 0.1))
    scene.revolute("J", "ground", "a", limits=(-1.0, 1.0))
    with pytest.raises(GaussError, match="'J' goes from .* beyond the limits"):
        gauss.plan_motion(scene, [{"J": 0.0}, {"J": 1.0}, {"J": -1.0}], speeds=1.0, shape="cubic")
    assert gauss.plan_motion(scene, [{"J": 0.0}, {"J": 1.0}, {"J": -1.0}], speeds=1.0, accelerations=1.0).duration > 0.0
