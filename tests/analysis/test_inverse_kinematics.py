"""Inverse kinematics against closed forms, priorities, limits, and what stands against targets out of reach."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss import rotations
from gauss.errors import GaussError
from gauss.system import retract

MET = 1e-8  # error of a met target, in radians and lengths of the scene, and of coordinates from closed forms
STATIONARY = 1e-5  # error of coordinates at a least error that is not zero: the root of that of the merit
SLOPE = 1e-7  # relative error of central differences
TIP = (0.5, 0.0, 0.0)  # of the double pendulum, whose links are 1 m and 0.5 m


def planar_arm(**limits) -> gauss.Scene:
    """Three hinges about z, links of 1 m along x."""
    scene = gauss.Scene("planar arm", gravity=(0, 0, 0))
    for k, (parent, name) in enumerate(zip(("ground", "a", "b"), "abc", strict=True)):
        scene.body(name, 1.0, (0.0, 0.1, 0.1), com=(0.5, 0, 0), position=(float(k), 0, 0))
        scene.revolute(f"J{k + 1}", parent, name, at=(float(k), 0, 0), limits=limits.get(f"J{k + 1}"))
    return scene


@pytest.fixture(scope="module")
def arm():
    return gauss.compile_scene(planar_arm())


@pytest.fixture(scope="module")
def pendulum():
    return gauss.compile_scene(gauss.load("double_pendulum"))


@pytest.fixture(scope="module")
def delta():
    return gauss.compile_scene(gauss.load("delta_robot"))


def hand(x: float, y: float, **options) -> gauss.PointTarget:
    return gauss.PointTarget("c", (x, y, 0.0), at=(1.0, 0.0, 0.0), **options)


@pytest.mark.parametrize("x, y", [(1.2, 0.3), (-0.4, 0.9), (0.1, -0.8), (0.0, -1.4)])
def test_two_links_have_their_closed_form(pendulum, x, y):
    found = gauss.inverse_kinematics(pendulum, gauss.PointTarget("lower", (x, y, 0.0), at=TIP))
    A, B = found.state.q
    cosine = (x * x + y * y - 1.25) / 1.0
    assert found.reached and found.unmet == () and found.reason == ""
    assert abs(np.cos(B) - cosine) < MET
    turned = np.arctan2(y, x) - np.arctan2(0.5 * np.sin(B), 1.0 + 0.5 * np.cos(B))
    assert abs(np.exp(1j * A) - np.exp(1j * turned)) < MET


@pytest.mark.slow
@pytest.mark.parametrize("move", [(0.05, 0.02, -0.03), (-0.1, 0.0, 0.05), (0.0, 0.12, -0.08)])
def test_a_delta_robot_has_its_closed_form(delta, move):
    base, arm, forearm, platform = 0.2, 0.25, 0.5, 0.05
    p = np.array([0.0, 0.0, -0.3]) + move
    found = gauss.inverse_kinematics(delta, gauss.PointTarget("platform", p))
    assert found.reached
    for k in range(3):
        out = np.array([np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3), 0.0])
        w = p + (platform - base) * out
        a, c = w @ out, w[2]
        K = (w @ w + arm**2 - forearm**2) / (2 * arm)
        angles = -np.arctan2(c, a) + np.array([-1.0, 1.0]) * np.arccos(K / np.hypot(a, c))
        hip = found.state.q[delta.joint(f"hip{k + 1}").q][0]
        assert np.abs(np.exp(1j * angles) - np.exp(1j * hip)).min() < MET


@pytest.mark.slow
def test_the_legs_of_a_stewart_platform_reach_a_pose():
    system = gauss.compile_scene(gauss.load("stewart_platform"))
    position, rpy = np.array([0.05, -0.03, 1.08]), (0.1, -0.15, 0.2)
    found = gauss.inverse_kinematics(system, gauss.PoseTarget("platform", position, rpy))
    assert found.reached
    foot_angles, head_angles = np.deg2rad([-10, 10, 110, 130, 230, 250]), np.deg2rad([-50, 50, 70, 170, 190, 290])
    for k, (alpha, beta) in enumerate(zip(foot_angles, head_angles, strict=True), 1):
        foot, head = np.array([np.cos(alpha), np.sin(alpha), 0.0]), 0.6 * np.array([np.cos(beta), np.sin(beta), 0.0])
        there = position + rotations.from_rpy(*rpy) @ head
        longer = np.linalg.norm(there - foot) - np.linalg.norm(head + np.array([0.0, 0.0, 1.0]) - foot)
        assert abs(found.state.q[system.joint(f"leg{k}").q][0] - longer) < MET


@pytest.mark.slow
def test_a_loop_follows_the_posture_of_another_joint():
    system = gauss.compile_scene(gauss.load("four_bar"))
    found = gauss.inverse_kinematics(system, gauss.PostureTarget({"D": 0.3}))
    assert found.reached and abs(found.state.q[system.column("D")] - 0.3) < MET
    residual = system.evaluate(("loop_constraints",), found.state.q, found.state.v)["loop_constraints"][0]
    assert np.abs(residual).max() < 1e-12


def test_levels_are_strict(arm):
    goal, posture = hand(1.4, 1.1), gauss.PostureTarget({"J1": 1.5, "J2": -1.0, "J3": 0.2}, level=1, weight=1e6)
    found = gauss.inverse_kinematics(arm, [posture, goal], gauss.State(0.0, np.array([0.3, 0.5, 0.2]), np.zeros(3)))
    assert found.reached and found.unmet == ("posture",)
    assert np.abs(found.errors["point of c"]).max() < MET
    N = np.linalg.svd(point_jacobian(arm, found.state.q))[2][2]
    assert abs(N @ found.errors["posture"]) < STATIONARY  # the posture is the best of those that keep the hand
    assert found.obstacles["posture"] == ("point of c",)


def point_jacobian(system, q) -> np.ndarray:
    """Of the hand in the plane (2, 3), in closed form."""
    angles = np.cumsum(q)
    return np.array([[-np.sin(angles[k:]).sum() for k in range(3)], [np.cos(angles[k:]).sum() for k in range(3)]])


def test_limits_are_kept_and_named():
    system = gauss.compile_scene(planar_arm(J2=(-0.4, 0.4), J3=(-0.4, 0.4)))
    found = gauss.inverse_kinematics(system, hand(0.0, 1.0), gauss.State(0.0, np.array([1.0, 0.1, 0.1]), np.zeros(3)))
    assert not found.reached and found.unmet == ("point of c",)
    assert (np.abs(found.state.q[1:]) <= 0.4 + 1e-12).all()
    names = {part.split(" at its ")[0] for part in found.obstacles["point of c"]}
    assert names == {"J2", "J3"} and "0.4" in found.reason


@pytest.mark.parametrize("backend", ["daqp", "piqp", "clarabel"])
def test_backends_agree_on_limits(arm, backend):
    state = gauss.State(0.0, np.array([0.2, 0.3, 0.1]), np.zeros(3))
    v = gauss.differential_inverse_kinematics(
        arm, state, hand(0.0, 2.0), 0.1, speeds={"J1": 2.0, "J2": 1.5}, backend=backend
    )
    closed = gauss.differential_inverse_kinematics(arm, state, hand(0.0, 2.0), 0.1, speeds={"J1": 2.0, "J2": 1.5})
    assert np.abs(v - closed).max() < 1e-6 and v[0] <= 2.0 + 1e-6 and abs(v[1]) <= 1.5 + 1e-6


def test_stops_are_limits():
    scene = planar_arm()
    scene.stop("J2", highest=0.25)
    found = gauss.inverse_kinematics(scene, gauss.PostureTarget({"J2": 0.6}))
    assert abs(found.state.q[1] - 0.25) < MET
    assert found.obstacles == {"posture": ("J2 at its highest coordinate 0.25",)}


def test_targets_out_of_reach_are_named(pendulum):
    far = gauss.PointTarget("lower", (2.0, 1.0, 0.0), at=TIP, name="tip")
    found = gauss.inverse_kinematics(pendulum, far)
    A, B = found.state.q
    assert found.unmet == ("tip",) and found.obstacles == {"tip": ()} and "tip" in found.reason
    assert abs(np.exp(1j * A) - (2 + 1j) / np.sqrt(5)) < STATIONARY and abs(np.exp(1j * B) - 1) < STATIONARY


def test_targets_against_each_other_are_named(arm):
    pair = [hand(1.0, 1.0, name="one"), hand(1.2, 1.0, name="other", weight=3.0)]
    found = gauss.inverse_kinematics(arm, pair)
    assert set(found.unmet) == {"one", "other"}
    assert found.obstacles == {"one": ("other",), "other": ("one",)}
    assert np.abs(found.errors["one"] + [0.15, 0, 0]).max() < STATIONARY  # weights 1 and 3


def test_a_stretched_arm_bends(arm):
    found = gauss.inverse_kinematics(arm, hand(1.5, 0.0), arm.state(np.zeros(3)))  # stationary, and no minimum
    assert found.reached


def test_random_starts_are_deterministic():
    system = gauss.compile_scene(planar_arm(J2=(0.2, 3.0)))
    start, goal = system.state([0.0, 2.9, -2.9]), gauss.PostureTarget({"J2": 0.2, "J3": 3.0})
    one, two = (gauss.inverse_kinematics(system, goal, start, starts=4, seed=3) for _ in range(2))
    assert one.reached and np.array_equal(one.state.q, two.state.q)


TARGETS = {
    "pose": gauss.PoseTarget("c", (1.0, 0.4, 0.3), (0.3, -0.4, 1.0), rotation_weight=2.0),
    "rotation": gauss.PoseTarget("c", rotation=(0.0, 0.8, 0.1)),
    "point": gauss.PointTarget("c", (0.3, 0.1, 0.2), at=(0.3, 0.2, 0.1), along=[(1, 1, 0), (0, 0, 1)]),
    "distance": gauss.DistanceTarget("c", "ground", 0.7, at=(0.1, 0.2, 0.3), other_at=(0.5, 0, 0)),
    "mass": gauss.CenterOfMassTarget((0.1, 0.2, 0.3)),
    "posture": gauss.PostureTarget(gauss.State(0.0, np.array([0.1, 0.2, 0.3, 0.8, 0.0, 0.6, 0.0, 0.4]), np.zeros(7))),
}


@pytest.fixture(scope="module")
def free():
    scene = gauss.Scene("free chain", gravity=(0, 0, 0))
    scene.body("b", 2.0, (0.1, 0.2, 0.3), com=(0.1, 0.2, 0))
    scene.body("c", 1.0, (0.1, 0.1, 0.1), com=(0.5, 0, 0.1), position=(1, 0, 0))
    scene.free("F", "ground", "b")
    scene.revolute("J", "b", "c", at=(1, 0, 0), axis=(0, 1, 0))
    return gauss.compile_scene(scene)


@pytest.mark.parametrize("kind", TARGETS)
def test_rows_are_derivatives_of_errors(free, kind):
    target, rng, h = TARGETS[kind], np.random.default_rng(1), 1e-6
    q = retract(free, free.reference.q, rng.uniform(-0.7, 0.7, 7))

    def rows(theta):
        here = retract(free, q, theta)
        names = target.functions(free)
        return target.rows(free, here, free.evaluate(names, here, np.zeros(7)) if names else {})

    slopes = [-(rows(h * e).error - rows(-h * e).error) / (2 * h) for e in np.eye(7)]
    assert np.abs(rows(np.zeros(7)).jacobian - np.array(slopes).T).max() < SLOPE
    assert gauss.inverse_kinematics(free, target, free.state(q)).reached


def test_a_moving_pose_is_followed(free):
    velocity, step = np.array([0.3, -0.2, 0.5, 0.1, 0.2, -0.3]), 1e-3
    state = free.state(retract(free, free.reference.q, np.full(7, 0.3)))
    R, p = free.forward_kinematics(state.q, "c")
    target = gauss.PoseTarget("c", p, R, velocity=velocity)
    v = gauss.differential_inverse_kinematics(free, state, target, step)
    assert np.abs(free.jacobian(state.q, "c") @ v - velocity).max() < MET


def test_the_rate_of_a_rotation_vector(free):
    state, h, omega = free.initial_state(), 1e-6, np.array([0.3, -0.2, 0.5])
    at = rotations.from_rpy(0.4, -0.5, 0.6)
    moved = [
        gauss.PoseTarget("c", rotation=rotations.from_quaternion(rotations.exponential(s * h * omega)) @ at) for s in (-1, 1)
    ]
    found = free.evaluate(moved[0].functions(free), state.q, state.v)
    errors = [target.rows(free, state.q, found).error for target in moved]
    target = gauss.PoseTarget("c", rotation=at, velocity=(*omega, 0, 0, 0))
    rate = target.rate(target.rows(free, state.q, found).error)
    assert np.abs(rate - (errors[1] - errors[0]) / (2 * h)).max() < SLOPE


@pytest.mark.slow
def test_rates_close_loops_and_take_a_share_of_the_error(delta):
    state, step = delta.initial_state(), 0.01
    goal = gauss.PointTarget("platform", np.array([0.03, 0.0, -0.33]), gain=0.5)
    v = gauss.differential_inverse_kinematics(delta, state, goal, step)
    J = delta.jacobian(state.q, "platform")
    assert np.abs(J[3:] @ v * step - 0.5 * np.array([0.03, 0.0, -0.03])).max() < MET
    K = delta.evaluate(("loop_constraints",), state.q, v)["loop_constraints"][1]
    assert np.abs(K @ v).max() < 1e-10
    for _ in range(16):
        state = delta.projected(replace(state, q=retract(delta, state.q, step * v)))
        v = gauss.differential_inverse_kinematics(delta, state, goal, step)
    assert np.abs(delta.forward_kinematics(state.q, "platform")[1] - goal.position).max() < 1e-5  # 0.03 / 2¹⁶, and more


def test_prescribed_drives_keep_their_rates():
    scene = planar_arm()
    scene.drive("J1", angle=lambda t: 0.3 + 0.7 * t)
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    v = gauss.differential_inverse_kinematics(system, state, hand(0.0, 2.0), 0.1)
    assert abs(v[0] - 0.7) < MET


def test_no_rate_leads_beyond_a_limit(arm):
    state = gauss.State(0.0, np.array([0.2, 0.3, 0.1]), np.zeros(3))
    v = gauss.differential_inverse_kinematics(arm, state, gauss.PostureTarget({"J1": 2.0}), 0.1, limits={"J1": (-1, 0.25)})
    assert abs(v[0] - 0.5) < MET


def test_a_distance_and_the_centre_of_mass(arm):
    targets = [
        gauss.DistanceTarget("c", "ground", 2.0, at=(1, 0, 0)),
        gauss.CenterOfMassTarget((1.0, 0.5, 0.0), along=(0, 1, 0)),
    ]
    found = gauss.inverse_kinematics(arm, targets)
    q = np.cumsum(found.state.q)
    joints = np.concatenate([[0.0], np.cumsum(np.exp(1j * q))])
    assert found.reached and abs(abs(joints[3]) - 2.0) < MET
    assert abs(((joints[1:] + joints[:-1]) / 2).mean().imag - 0.5) < MET


WRONG = {
    "no target": (lambda s: gauss.inverse_kinematics(s, []), "PointTarget"),
    "no system": (lambda s: gauss.inverse_kinematics(3, hand(1, 1)), "System"),
    "frame": (lambda s: gauss.inverse_kinematics(s, gauss.PointTarget("hnd", (0, 0, 0))), "hnd"),
    "twice": (lambda s: gauss.inverse_kinematics(s, [hand(1, 1), hand(1, 2)]), "point of c"),
    "coordinate": (lambda s: gauss.inverse_kinematics(s, gauss.PostureTarget({"J9": 1.0})), "J9"),
    "number": (lambda s: gauss.PostureTarget({"J1": "x"}), "J1"),
    "nothing": (lambda s: gauss.PoseTarget("c"), "position="),
    "level": (lambda s: hand(1, 1, level=-1), "level"),
    "weight": (lambda s: hand(1, 1, weight=0.0), "weight"),
    "gain": (lambda s: hand(1, 1, gain=2.0), "gain"),
    "keyword": (lambda s: gauss.PointTarget("c", (0, 0, 0), wieght=2.0), "weight"),
    "nan": (lambda s: hand(np.nan, 1), "position"),
    "limits": (lambda s: gauss.inverse_kinematics(s, hand(1, 1), limits={"J1": (1, 0)}), "J1"),
    "limit of none": (lambda s: gauss.inverse_kinematics(s, hand(1, 1), limits={"J7": (0, 1)}), "J7"),
    "backend": (lambda s: gauss.inverse_kinematics(s, hand(1, 1), backend="svd"), "daqp"),
    "unknown backend": (lambda s: gauss.inverse_kinematics(s, hand(1, 1), backend="dakp"), "daqp"),
    "starts": (lambda s: gauss.inverse_kinematics(s, hand(1, 1), starts=-1), "starts"),
    "tolerance": (lambda s: gauss.inverse_kinematics(s, hand(1, 1), tolerance=0.0), "tolerance"),
    "step": (lambda s: gauss.differential_inverse_kinematics(s, s.reference, hand(1, 1), 0.0), "step"),
    "state": (lambda s: gauss.differential_inverse_kinematics(s, None, hand(1, 1), 0.1), "State"),
    "speeds": (lambda s: gauss.differential_inverse_kinematics(s, s.reference, hand(1, 1), 0.1, speeds=-1.0), "speeds"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_named(arm, case):
    call, named = WRONG[case]
    with pytest.raises(GaussError, match=named):
        call(arm)
