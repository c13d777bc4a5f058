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
