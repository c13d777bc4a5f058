"""Constraints beyond the joints: rows against differences, motions and forces against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import gauss
from gauss import math as gm
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.mechanism import Mechanism
from gauss.rotations import from_quaternion
from gauss.system import random_state, retract
from tests.support import mechanisms

ROUNDING = 1e-12  # of sums of a few dozen products of numbers of order 1 to 10
CENTRAL_DIFFERENCE = 2e-7  # h² of a step 1e-5 times third derivatives, plus rounding/h
FORWARD = 1e-10  # rows whose multipliers are found by proximal iterations, behind free joints far from their bodies
EXACT = 1e-9  # a motion at rtol 1e-11 over a second against its closed form


POINTS = {"at": (0.3, -0.2, 0.5), "other_at": (-0.4, 0.1, 0.2)}
PROFILE = CubicSpline(np.linspace(0, 2 * np.pi, 9), [0, 0.1, 0.4, 0.9, 1, 0.7, 0.3, 0.1, 0], bc_type="periodic")
KINDS = {
    "coincident": lambda s: s.coincident("r", "a", "tip", **POINTS),
    "distance": lambda s: s.distance("r", "a", "tip", **POINTS),
    "distance in time": lambda s: s.distance("r", "a", "b", length=lambda t: 2.0 + np.sin(t)),
    "on plane": lambda s: s.on_plane("r", "a", "tip", normal=(1, 2, -1), **POINTS),
    "on line": lambda s: s.on_line("r", "a", "b", axis=(1, 2, -1), **POINTS),
    "on curve": lambda s: s.on_curve("r", "a", "b", lambda p: (p[1] - p[0] ** 2, p[2] - np.sin(p[0])), **POINTS),
    "on surface": lambda s: s.on_curve("r", "a", "ground", lambda p: p @ p - 1.0, **POINTS),
    "angle": lambda s: s.angle("r", "a", "b", axis=(1, 2, -1), other_axis=(0, 1, 1)),
    "angle in time": lambda s: s.angle("r", "a", "b", angle=lambda t: 1.0 + 0.1 * t * t),
    "spur gear": lambda s: s.gear("r", "a", "b", (12, 30), **POINTS),
    "ring gear": lambda s: s.gear("r", "a", "ground", (12, 30), internal=True, **POINTS),
    "rack": lambda s: s.rack("r", "a", "b", axis=(1, 2, -1), along=(0, 1, 1), **POINTS),
    "cam": lambda s: s.cam("r", "C.angle2", "S", PROFILE),
    "transmission": lambda s: s.transmission("r", "C.angle1", "S", lambda at: 1.0 + at.coordinate("S") ** 2),
    "ball": lambda s: s.rolling("r", "a", "b", 0.7, normal=(1, 2, -1), **POINTS),
    "disk": lambda s: s.rolling("r", "a", "b", 0.7, crown=0.0, axis=(1, 0, 3), normal=(1, 2, -1), **POINTS),
    "wheel": lambda s: s.rolling("r", "a", "ground", 0.7, crown=0.1, axis=(1, 0, 3), **POINTS),
    "ball on ball": lambda s: s.rolling("r", "a", "b", 0.2, on_radius=1.5, **POINTS),
    "ball in bowl": lambda s: s.rolling("r", "a", "ground", 0.2, on_radius=-5.0, **POINTS),
    "knife edge": lambda s: s.knife_edge("r", "a", "b", at=(0.1, 0.2, 0.3), edge=(1, 2, 0), normal=(0, 1, 3)),
    "guide": lambda s: s.guide("r", "tip", lambda t: (np.cos(t), t, t**2), along=((1, 0, 0), (0, 1, 1))),
    "drive": lambda s: s.drive("S", displacement=lambda t: np.exp(-t) * np.cos(3 * t), name="r"),
    "own": lambda s: s.constrain(
        "r",
        lambda at: at.position("a") @ at.position("b") - at.t**3 + gm.maximum(at.coordinate("S"), at.coordinate("A")[0]),
        lambda at: (
            at.rotation("a")[:, 1] @ at.velocity("b", (1, 0, 0)) + at.angular_velocity("c")[2] * np.cos(at.rate("S") * 0)
        ),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(2))
def test_rows_are_the_derivatives_of_the_residuals(kind, seed):
    """A v + B q̇ − C is the rate of the gap, or the residual of velocities; A a + B q̈ − D its derivative."""
    scene = mechanisms.three_bodies(seed)
    KINDS[kind](scene)
    system, rng = gauss.compile_scene(scene), np.random.default_rng(seed)
    rows = system.structure.constraints[-1].rows
    state, qdd = replace(random_state(system, rng), t=0.4), rng.standard_normal(system.n_v)

    def moved(h, parts=40):
        q = state.q
        for i in range(parts):
            q = retract(system, q, (state.v + qdd * (i + 0.5) * h / parts) * h / parts)
        return kinematics(system, replace(state, q=q, v=state.v + qdd * h, t=state.t + h))

    def rate(motion):
        compulsion = gauss.assemble(system, motion.state)
        return (compulsion.A @ motion.quasi_velocities() + compulsion.B @ motion.state.v - compulsion.C)[rows]

    h = 1e-5
    before, now, after = moved(-h), kinematics(system, state), moved(h)
    relation = system.scene.relations["r"]
    holonomic = len(relation.positions(now))
    differences = (position_residual(after) - position_residual(before))[rows] / (2 * h)
    assert np.abs(rate(now) - differences)[:holonomic].max(initial=0.0) <= CENTRAL_DIFFERENCE
    residuals = np.array(relation.velocities(now), dtype=float)
    assert np.abs(rate(now)[holonomic:] - residuals).max(initial=0.0) <= ROUNDING
    compulsion = gauss.assemble(system, state)
    a = (after.quasi_velocities() - before.quasi_velocities()) / (2 * h)
    differentiated = (compulsion.A @ a + compulsion.B @ qdd - compulsion.D)[rows]
    assert np.abs(differentiated - (rate(after) - rate(before)) / (2 * h)).max() <= CENTRAL_DIFFERENCE * (
        1 + np.abs(compulsion.D[rows]).max()
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_forward_dynamics_from_link_to_link_meets_the_rows(kind):
    """Joint coordinates and closing rows against the full system of all bodies, in a state that need not be consistent."""
    scene = mechanisms.three_bodies()
    KINDS[kind](scene)
    system, rng = gauss.compile_scene(scene), np.random.default_rng(1)
    state, effort = replace(random_state(system, rng), t=0.4), rng.standard_normal(system.n_v)
    compulsion = gauss.assemble(system, state, effort)
    expected = gauss.solve(compulsion, "kkt")
    mechanism = Mechanism(system, state.q, state.v, state.t)
    rates, multipliers = mechanism.motion(effort)
    assert np.abs(rates - expected.qdd).max() <= FORWARD * np.abs(expected.qdd).max()
    power = -expected.multipliers @ compulsion.C
    assert abs(mechanism.power(multipliers) - power) <= FORWARD * (1.0 + abs(power))


def _run(scene, duration=1.0, **options):
    return gauss.simulate(scene, duration, rtol=1e-11, atol=1e-12, **options)


def _conserves_energy(trajectory):
    energy = gauss.energy(trajectory)
    assert np.abs(energy.balance).max() <= EXACT * energy.scale


@pytest.mark.slow
def test_a_rod_without_mass_is_a_pendulum():
    """A bob on a distance swings like the rod of the reference file; the force of the rod is m(g cos φ + l φ̇²)."""
    data = mechanisms.reference("pendulum")
    key = next(k for k in data["table"] if k != "t" and np.ndim(data["table"][k]) == 1)
    t, angles = np.array(data["table"]["t"]), np.array(data["table"][key])
    t, angles = t[t <= 1.5], angles[t <= 1.5]
    scene = gauss.Scene("bob on a rod", gravity=(0, 0, -9.81))
    scene.body("bob", 1.0, (0.01, 0.01, 0.01))
    scene.free("F", "ground", "bob")
    scene.distance("rod", "bob", "ground", length=1.0)
    scene.start("F", position=(np.sin(angles[0]), 0, -np.cos(angles[0]), 1, 0, 0, 0))
    trajectory = _run(scene, t[-1], times=t)
    x, z = trajectory.q[:, 0], trajectory.q[:, 2]
    assert np.abs(np.arctan2(x, -z) - angles).max() <= EXACT
    pull = -gauss.constraint_forces(trajectory, "rod")[:, 0]
    speed = (trajectory.v[:, :3] ** 2).sum(axis=1)
    assert pull == pytest.approx(9.81 * np.cos(angles) + speed, abs=1e-9)


@pytest.mark.slow
def test_a_bead_on_a_parabola():
    """ẍ (1 + 4x²) + 4 x ẋ² + 2 g x = 0 for y = x²: the energy, and the acceleration at a state."""
    scene = gauss.Scene("bead", gravity=(0, -9.81, 0))
    scene.body("bead", 0.3, (1e-3, 1e-3, 1e-3))
    scene.free("F", "ground", "bead")
    scene.on_curve("wire", "bead", "ground", lambda p: (p[1] - p[0] ** 2, p[2]))
    scene.start("F", position=(0.8, 0.64, 0, 1, 0, 0, 0), rate=(0.5, 0.8, 0, 0, 0, 0))
    system = gauss.compile_scene(scene)
    x, v = 0.8, 0.5
    expected = -(4 * x * v**2 + 2 * 9.81 * x) / (1 + 4 * x * x)
    assert system.accelerations(system.initial_state())[0] == pytest.approx(expected, rel=1e-12)
    _conserves_energy(_run(scene))


@pytest.mark.slow
def test_planetary_gears_turn_as_willis_says():
    """Sun 24, planet 12, ring 48 at rest: carrier = sun · 24/(24 + 48); and the torques are in the same ratio."""
    scene = gauss.Scene("planetary", gravity=(0, 0, 0))
    scene.body("sun", 1.0, (0.01, 0.01, 0.02))
    scene.body("arm", 0.5, (0.01, 0.01, 0.02))
    scene.body("planet", 0.3, (0.001, 0.001, 0.002), position=(0.36, 0, 0))
    scene.revolute("sun axle", "ground", "sun")
    scene.revolute("arm axle", "ground", "arm")
    scene.revolute("planet axle", "arm", "planet", at=(0.36, 0, 0))
    scene.gear("sun mesh", "sun", "planet", (24, 12))
    scene.gear("ring mesh", "planet", "ground", (12, 48), internal=True)
    scene.drive("sun axle", torque=3.0)
    trajectory = _run(scene)
    sun, arm, planet = (trajectory.rate(name)[-1] for name in ("sun axle", "arm axle", "planet axle"))
    assert arm == pytest.approx(sun * 24 / 72, rel=1e-11)
    assert planet == pytest.approx(-(sun - arm) * 24 / 12, rel=1e-11)
    ratio = 1 / 3
    inertia = 0.02 + ratio**2 * (0.02 + 0.3 * 0.36**2) + 0.002 * (planet / sun + ratio) ** 2
    assert sun == pytest.approx(3.0 / inertia, rel=1e-10)
    tooth = gauss.constraint_forces(trajectory, "sun mesh")[-1, 0]
    assert abs(tooth) * 0.24 == pytest.approx(3.0 - 0.02 * 3.0 / inertia, rel=1e-9)


@pytest.mark.slow
def test_bevel_gears_and_their_bearings():
    """Shafts at 70°: ω₁ z₁ = −ω₂ z₂ about axes that point away from the apex; the tooth force is felt at both bearings."""
    angle, (z1, z2) = np.deg2rad(70.0), (20, 35)
    scene = gauss.Scene("bevel", gravity=(0, 0, 0))
    direction = np.array([np.sin(angle), 0, np.cos(angle)])
    scene.body("pinion", 1.0, (0.01, 0.01, 0.02), position=(0, 0, 0.3))
    scene.body("wheel", 2.0, (0.03, 0.03, 0.05), position=0.25 * direction, rotation=(0, angle, 0))
    scene.revolute("in", "ground", "pinion")
    scene.revolute("out", "ground", "wheel", axis=direction)
    scene.gear("mesh", "pinion", "wheel", (z1, z2), other_axis=(0, 0, 1))
    scene.drive("in", torque=1.0)
    system = gauss.compile_scene(scene)
    qdd = system.accelerations(system.initial_state())
    assert qdd[1] == pytest.approx(-qdd[0] * z1 / z2, rel=1e-12)
    assert qdd[0] == pytest.approx(1.0 / (0.02 + 0.05 * (z1 / z2) ** 2), rel=1e-12)
    trajectory = _run(scene, 0.1, times=[0.0])
    tooth = np.abs(gauss.constraint_forces(trajectory, "mesh")[0, 0])
    for joint in ("in", "out"):
        assert np.linalg.norm(gauss.reactions(trajectory, joint).force[0]) == pytest.approx(tooth, rel=1e-11)


def test_a_rack_pulls_a_wheel():
    """Rack m, wheel J at radius r: ẍ = F/(m + J/r²)."""
    scene = gauss.Scene("rack", gravity=(0, 0, 0))
    scene.body("wheel", 1.0, (0.01, 0.01, 0.02))
    scene.body("rack", 3.0, (0.1, 0.1, 0.1), position=(0, -0.2, 0))
    scene.revolute("axle", "ground", "wheel")
    scene.prismatic("slide", "ground", "rack", axis=(1, 0, 0))
    scene.rack("mesh", "wheel", "rack")
    scene.drive("slide", force=5.0)
    trajectory = _run(scene)
    acceleration = 5.0 / (3.0 + 0.02 / 0.2**2)
    assert trajectory.coordinate("slide")[-1] == pytest.approx(acceleration / 2, rel=EXACT)
    assert trajectory.coordinate("axle")[-1] == pytest.approx(acceleration / 2 / 0.2, rel=EXACT)


@pytest.mark.parametrize("crossed", [False, True])
def test_a_belt_keeps_the_ratio_of_its_pulleys(crossed):
    scene = gauss.load("gear_pair")
    scene.couplings.clear()
    scene.belt("belt", "output", "input", radii=(0.3, 0.1), crossed=crossed)
    trajectory = gauss.simulate(scene, 0.5)
    assert trajectory.rate("output")[-1] == pytest.approx(
        (-1 if crossed else 1) * trajectory.rate("input")[-1] / 3, rel=1e-12
    )


@pytest.mark.slow
def test_a_cam_lifts_its_follower():
    """A follower on a periodic spline, over two turns: its acceleration and the torque that the cam takes."""
    scene = gauss.Scene("cam", gravity=(0, 0, -9.81))
    scene.body("cam", 1.0, (0.01, 0.01, 0.02))
    scene.body("follower", 0.5, (0.01, 0.01, 0.01))
    scene.revolute("shaft", "ground", "cam")
    scene.prismatic("lift", "ground", "follower", axis=(0, 0, 1))
    scene.cam("profile", "shaft", "lift", PROFILE)
    scene.drive("shaft", angle=lambda t: 6.0 * t)
    t = np.linspace(0.05, 2.05, 9)
    trajectory = gauss.simulate(scene, 2.1, integrator="rk4", step=0.02, times=t)  # the constraints decide the motion
    angle = np.mod(6.0 * t, 2 * np.pi)
    assert trajectory.coordinate("lift") == pytest.approx(PROFILE(angle), abs=1e-11)
    force = 0.5 * (36.0 * PROFILE(angle, 2) + 9.81)
    assert gauss.drive_forces(trajectory, "shaft") == pytest.approx(force * PROFILE(angle, 1), abs=1e-9)


def test_a_gearing_whose_ratio_varies():
    """q̇₂ = (1 + t) q̇₁ under a torque τ on the first: (J₁ + k² J₂) q̈₁ = τ − k k̇ J₂ q̇₁."""
    scene = gauss.Scene("variator", gravity=(0, 0, 0))
    for name in ("one", "two"):
        scene.body(name, 1.0, (0.1, 0.1, 0.2))
        scene.revolute(f"axle {name}", "ground", name)
    scene.transmission("variator", "axle two", "axle one", lambda at: 1.0 + at.t)
    scene.drive("axle one", torque=0.7)
    scene.start("axle one", rate=2.0)
    trajectory = _run(scene)
    # d/dt ½(J₁ + k² J₂) q̇₁² = τ q̇₁ holds since the variator takes no power
    _conserves_energy(trajectory)
    k, rate = 1.0 + trajectory.t, trajectory.rate("axle one")
    assert trajectory.rate("axle two") == pytest.approx(k * rate, rel=1e-11)


def _disk(spin, crown=0.0, lean=0.4):
    """Uniform thin disk of 1 kg and 0.5 m, axis x of its frame, that leans and rolls on the ground."""
    scene = gauss.Scene("disk", gravity=(0, 0, -9.81))
    scene.body("disk", 1.0, (0.125, 0.0625, 0.0625))
    scene.free("F", "ground", "disk")
    scene.rolling("contact", "disk", "ground", 0.5, crown=crown, axis=(1, 0, 0))
    half = lean / 2
    start = (0, 0, 0.5 * np.cos(lean), np.cos(half), 0, np.sin(half), 0)
    scene.start("F", position=start, rate=(0, 0, 0, *spin))
    return scene


@pytest.mark.slow
def test_a_rolling_disk_keeps_its_energy_and_does_not_slip():
    trajectory = _run(_disk((5.0, 0.3, 1.0)), 1.0)
    _conserves_energy(trajectory)
    relation = trajectory.system.scene.relations["contact"]
    for motion in trajectory.motions[:: max(1, len(trajectory) // 10)]:
        assert np.abs(np.array(relation.velocities(motion), dtype=float)).max() <= 1e-12
        assert abs(relation.positions(motion)[0]) <= 1e-12


@pytest.mark.slow
def test_a_disk_that_rolls_steadily_in_a_circle():
    """Lean θ from the vertical, precession Ω about it, spin ω about the own axis: all stay constant if

    (C + m r²) Ω ω cos θ + A Ω² sin θ cos θ = m g r sin θ, with A = ¼ m r², C = ½ m r², from the moments about the contact.
    """
    m, r, g, lean, precession = 1.0, 0.5, 9.81, 0.4, 1.5
    A, C = m * r * r / 4, m * r * r / 2
    weight = m * g * r * np.sin(lean) - A * precession**2 * np.sin(lean) * np.cos(lean)
    spin = weight / ((C + m * r * r) * precession * np.cos(lean))
    up = np.array([-np.sin(lean), 0.0, np.cos(lean)])  # the vertical in the frame of the disk, whose axis is x
    across = up - np.array([up[0], 0, 0])
    omega = precession * across + np.array([spin, 0.0, 0.0])
    arm = np.array([0.0, 0.0, r])  # from the lowest point to the centre: the disk leans about y
    scene = _disk(omega, lean=lean)
    pose = scene.starts["F"].position
    scene.start("F", position=pose, rate=(*(from_quaternion(np.array(pose[3:])) @ np.cross(omega, arm)), *omega))
    trajectory = _run(scene, 1.0)
    axis = trajectory.body("disk").rotation[:, :, 0]
    assert np.abs(np.arcsin(np.abs(axis[:, 2])) - lean).max() <= EXACT
    heading = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    assert np.abs(heading - precession * trajectory.t).max() <= EXACT


@pytest.mark.slow
def test_a_ball_rolls_down_a_bowl():
    """At a small angle θ: (7/5) (ρ − r) θ̈ = −g sin θ."""
    scene = gauss.Scene("bowl", gravity=(0, 0, -9.81))
    r, rho, theta = 0.1, 1.1, 0.3
    scene.body("ball", 2.0, (0.4 * 2.0 * r * r,) * 3)
    scene.free("F", "ground", "ball")
    scene.rolling("contact", "ball", "ground", r, on_radius=-rho)
    scene.start("F", position=((rho - r) * np.sin(theta), 0, -(rho - r) * np.cos(theta), 1, 0, 0, 0))
    system = gauss.compile_scene(scene)
    a = system.accelerations(system.initial_state())
    expected = -9.81 * np.sin(theta) / 1.4
    assert a[0] == pytest.approx(expected * np.cos(theta), rel=1e-12)
    _conserves_energy(_run(scene))


def test_a_sleigh_on_an_inclined_plane_drifts_sideways():
    """Knife edge under its centre of mass, spinning: it does not slide down without bound but moves along a cycloid.

    The speed u along the blade obeys u̇ = g' cos ωt, so x = g' sin²(ωt)/(2ω²), y = g' (ωt − ½ sin 2ωt)/(2ω²).
    """
    slope, omega = 3.0, 2.0
    scene = gauss.Scene("sleigh", gravity=(slope, 0, 0))
    scene.body("sleigh", 1.3, (0.1, 0.1, 0.2))
    scene.planar("P", "ground", "sleigh", second_axis=(1, 0, 0))
    scene.knife_edge("blade", "sleigh")
    scene.start("P", rate=(0, 0, omega))
    trajectory = _run(scene, 2.0)
    x, y, angle = trajectory.q.T
    assert angle == pytest.approx(omega * trajectory.t, abs=EXACT)
    assert x == pytest.approx(slope / (2 * omega**2) * np.sin(angle) ** 2, abs=1e-9)
    assert y == pytest.approx(slope / (2 * omega**2) * (angle - np.sin(2 * angle) / 2), abs=1e-9)
