"""Linear models against closed forms: normal modes, a governor with a prescribed drive, rolling, Furuta's pendulum."""

import numpy as np
import pytest

import gauss

CLOSED = 1e-9  # relative
ROOTS = 1e-4  # of zero eigenvalues of translations and heading, which are multiple: roots of round-off
G = 9.81


def test_a_double_pendulum_of_points_has_its_normal_modes():
    """ω² = (2 ∓ √2) g / l for equal masses and lengths (Landau and Lifshitz, Mechanics, § 23)."""
    scene, length = gauss.Scene("two points", gravity=(0.0, -G, 0.0)), 0.7
    for k, (above, name) in enumerate((("ground", "upper"), ("upper", "lower"))):
        body = scene.body(name, 1.3, (0.0, 0.0, 0.0), com=(0.0, -length, 0.0), position=(0.0, -k * length, 0.0))
        scene.revolute(f"R{k}", above, body, at=(0.0, -k * length, 0.0))
    found = gauss.linearise(scene).modes()
    wanted = np.sqrt((2.0 + np.array([-1.0, 1.0]) * np.sqrt(2.0)) * G / length)
    assert 2.0 * np.pi * found.frequencies == pytest.approx(wanted, rel=CLOSED)


def governor(speed):
    """Watt's governor: an arm with a ball on a shaft that turns with a prescribed speed; at rest it hangs down."""
    scene, length = gauss.Scene("governor", gravity=(0.0, 0.0, -G)), 0.4
    scene.revolute("shaft", "ground", scene.body("shaft", 1.0, (0.1, 0.1, 0.1)), axis=(0.0, 0.0, 1.0))
    scene.revolute("arm", "shaft", scene.body("ball", 0.8, (0.0, 0.0, 0.0), com=(0.0, 0.0, -length)), axis=(0.0, 1.0, 0.0))
    scene.drive("shaft", angle=lambda t: speed * t)
    return scene, length


@pytest.mark.slow
@pytest.mark.parametrize("speed", [6.0, 9.0])
def test_a_governor_swings_about_the_angle_of_its_speed(speed):
    """cos θ = g / (l Ω²), and ω = Ω sin θ about it; hanging, it is unstable beyond Ω² = g / l."""
    scene, length = governor(speed)
    system = gauss.compile_scene(scene)
    angle = np.arccos(G / (length * speed**2))
    arm = system.column("arm")
    model = gauss.linearise(system, system.state(np.eye(2)[arm] * angle, np.eye(2)[1 - arm] * speed))
    assert model.states == ("arm", "arm rate") and model.is_equilibrium
    assert model.eigenvalues.imag.max() == pytest.approx(speed * np.sin(angle), rel=CLOSED)
    hanging = gauss.linearise(system, system.state(np.zeros(2), np.eye(2)[1 - arm] * speed))
    assert hanging.eigenvalues.real.max() == pytest.approx(np.sqrt(speed**2 - G / length), rel=CLOSED)


def two_armed_governor(speed, angle=0.6):
    """Watt's governor with a collar below: two arms with balls, and a rod of its mass there from each to the collar."""
    scene, length = gauss.Scene("collar", gravity=(0.0, 0.0, -G)), 0.3
    scene.revolute("shaft", "ground", scene.body("shaft", 1.0, (0.1, 0.1, 0.1)), axis=(0.0, 0.0, 1.0))
    scene.drive("shaft", angle=lambda t: speed * t)
    across, down, y = length * np.sin(angle), -length * np.cos(angle), (0.0, 1.0, 0.0)
    collar = scene.body("collar", 0.5, (0.01, 0.01, 0.01), position=(0.0, 0.0, 2.0 * down))
    scene.prismatic("slide", "shaft", collar, axis=(0.0, 0.0, 1.0))
    for side, x in (("left", across), ("right", -across)):
        ball = scene.body(f"ball {side}", 0.8, (0.0, 0.0, 0.0), com=(x, 0.0, down))
        scene.revolute(side, "shaft", ball, axis=y)
        rod = scene.body(f"rod {side}", 0.2, (1e-3, 1e-3, 1e-3), position=(x, 0.0, down))
        scene.revolute(f"knee {side}", ball, rod, at=(x, 0.0, down), axis=y)
        scene.revolute(f"foot {side}", rod, collar, at=(0.0, 0.0, 2.0 * down), axis=y)
    return scene, length


@pytest.mark.slow
@pytest.mark.parametrize("speed", [9.0, 12.0])
def test_a_governor_with_a_collar_swings_about_the_angle_of_its_speed(speed):
    """With 2 m (l θ̇)² / 2 + M (2 l sin θ θ̇)² / 2 and cos θ = (m + M) g / (m l Ω²), at a pose far from that of the scene."""
    scene, length = two_armed_governor(speed)
    system, m, M = gauss.compile_scene(scene), 1.0, 0.5
    angle = np.arccos((m + M) * G / (m * length * speed**2))
    at, unit = {name: system.column(name) for name in ("shaft", "left")}, np.eye(system.n_v)
    state = system.initial_state(unit[at["left"]] * (0.6 - angle), unit[at["shaft"]] * speed, keep=["left", "shaft"])
    model = gauss.linearise(system, state)
    stiffness = 2.0 * (m + M) * G * length * np.cos(angle) - 2.0 * m * (length * speed) ** 2 * np.cos(2.0 * angle)
    inertia = 2.0 * (m * length**2 + 1e-3) + M * (2.0 * length * np.sin(angle)) ** 2
    assert model.is_equilibrium and len(model.states) == 2
    assert model.eigenvalues.imag.max() == pytest.approx(np.sqrt(stiffness / inertia), rel=CLOSED)


def bicycle(speed):
    """The benchmark bicycle of Meijaard, Papadopoulos, Ruina and Schwab (Proc. R. Soc. A 463, 2007), z up."""
    scene, tilt, base, trail, r, R = gauss.Scene("bicycle", gravity=(0.0, 0.0, -G)), np.pi / 10.0, 1.02, 0.08, 0.3, 0.35

    def body(name, mass, xx, xz, yy, zz, com, at):
        inertia = [[xx, 0.0, -xz], [0.0, yy, 0.0], [-xz, 0.0, zz]]
        return scene.body(name, mass, np.array(inertia), com=np.subtract(com, at), position=at)

    hub, steering, front = (0.0, 0.0, r), (base + trail, 0.0, 0.0), (base, 0.0, R)
    x, y, z, on = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), "ground"
    for name, kind, axis in (
        ("x", "prismatic", x), ("y", "prismatic", y), ("z", "prismatic", z), ("yaw", "revolute", z), ("lean", "revolute", x)
    ):  # fmt: skip
        carrier = scene.body(f"carrier of {name}", 0.0, (0.0, 0.0, 0.0), position=hub)
        getattr(scene, kind)(name, on, carrier, at=hub, axis=axis)
        on = carrier
    frame = body("frame", 85.0, 9.2, 2.4, 11.0, 2.8, (0.3, 0.0, 0.9), hub)
    fork = body("fork", 4.0, 0.05892, -0.00756, 0.06, 0.00708, (0.9, 0.0, 0.7), steering)
    behind = body("rear wheel", 2.0, 0.0603, 0.0, 0.12, 0.0603, hub, hub)
    ahead = body("front wheel", 3.0, 0.1405, 0.0, 0.28, 0.1405, front, front)
    scene.revolute("pitch", on, frame, at=hub, axis=y)
    scene.revolute("rear", frame, behind, at=hub, axis=y)
    scene.revolute("steer", frame, fork, at=steering, axis=(-np.sin(tilt), 0.0, np.cos(tilt)))
    scene.revolute("front", fork, ahead, at=front, axis=y)
    scene.rolling("rear contact", behind, "ground", r, crown=0.0, axis=y)
    scene.rolling("front contact", ahead, "ground", R, crown=0.0, axis=y)
    system = gauss.compile_scene(scene)
    v = np.zeros(system.n_v)
    for name, rate in (("x", speed), ("rear", speed / r), ("front", speed / R)):
        v[system.column(name)] = rate
    return system, system.initial_state(np.zeros(system.n_q), v)


@pytest.mark.slow
def test_a_bicycle_has_the_eigenvalues_of_the_benchmark():
    """Two wheels that roll close a loop through the ground; table 2 of the benchmark at 5 m/s."""
    found = gauss.linearise(*bicycle(5.0)).eigenvalues
    for wanted in (-0.775341882195845 + 4.46486771378823j, -0.322866429004087, -14.0783896927982):
        assert np.abs(found - wanted).min() <= CLOSED * abs(wanted)


@pytest.mark.slow
@pytest.mark.parametrize("spin", [1.0, 2.0, 3.0, 8.0])
def test_a_disk_rolls_upright_beyond_a_speed(spin):
    """λ² = (4 / 5) g / r − (12 / 5) Ω² of a thin disk: stable beyond Ω² = g / (3 r) (Routh, Advanced Rigid Dynamics).

    In joints of heading, lean and spin, for axes that turn with the disk have no constant linear model.
    """
    scene, r = gauss.Scene("disk", gravity=(0.0, 0.0, -G)), 0.5
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    chain = [("prismatic", "x"), ("prismatic", "y"), ("prismatic", "z"), ("revolute", "z"), ("revolute", "x")]
    on = "ground"
    for k, (kind, axis) in enumerate(chain):
        carrier = scene.body(f"carrier {k}", 0.0, (0.0, 0.0, 0.0), position=(0.0, 0.0, r))
        getattr(scene, kind)(f"{kind} {axis}", on, carrier, at=(0.0, 0.0, r), axis=axes[axis])
        on = carrier
    disk = scene.body("disk", 1.0, (0.25 * r**2, 0.5 * r**2, 0.25 * r**2), position=(0.0, 0.0, r))
    scene.revolute("spin", on, disk, at=(0.0, 0.0, r), axis=axes["y"])
    scene.rolling("contact", disk, "ground", r, crown=0.0, axis=axes["y"])
    system = gauss.compile_scene(scene)
    v = np.zeros(system.n_v)
    v[system.column("prismatic x")], v[system.column("spin")] = spin * r, spin
    model = gauss.linearise(system, system.initial_state(np.zeros(system.n_q), v))
    square = 0.8 * G / r - 2.4 * spin**2
    assert np.abs(model.eigenvalues - np.sqrt(complex(square))).min() <= CLOSED * np.sqrt(abs(square))
    others = model.eigenvalues[np.abs(model.eigenvalues**2 - square) > 0.1 * abs(square)]
    assert len(others) == len(model.eigenvalues) - 2 and np.abs(others).max() <= ROOTS * spin


def test_furutas_pendulum_has_its_closed_form():
    """Upright: M = [[J + m r², m r l], [m r l, m l²]] along arm and pendulum, and m g l φ (Furuta et al. 1992)."""
    scene, J, m, r, length = gauss.Scene("furuta", gravity=(0.0, 0.0, -G)), 0.02, 0.15, 0.25, 0.3
    arm = scene.body("arm", 0.5, (J, J, J))
    pole = scene.body("pole", m, (0.0, 0.0, 0.0), position=(r, 0.0, 0.0), com=(0.0, 0.0, length))
    scene.revolute("arm", "ground", arm, axis=(0.0, 0.0, 1.0))
    scene.revolute("pole", arm, pole, at=(r, 0.0, 0.0), axis=(-1.0, 0.0, 0.0))
    scene.input("motor", "arm")
    model = gauss.linearise(scene)
    M = np.array([[J + m * r**2, m * r * length], [m * r * length, m * length**2]])
    by_angles = np.linalg.solve(M, np.diag([0.0, m * G * length]))
    assert model.states == ("arm", "pole", "arm rate", "pole rate")
    assert model.A[2:, :2] == pytest.approx(by_angles, rel=CLOSED)
    assert model.B[2:, 0] == pytest.approx(np.linalg.solve(M, [1.0, 0.0]), rel=CLOSED)
    K = model.lqr(Q=[1.0, 10.0, 1.0, 1.0])
    assert np.linalg.eigvals(model.A - model.B @ K).real.max() < 0.0
