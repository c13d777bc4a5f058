"""Mechanisms with loops against Pinocchio's constraintDynamics, closed forms and first integrals."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.analysis.crosscheck import random_states
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.mobility import Redundancy
from tests.support import mechanisms
from tests.support.welded import Welded

STATES = 100
AGREEMENT = 1e-9  # relative to the largest acceleration; both sides meet the same states to 1e-13
BALANCE = 1e-8  # of the energies, at rtol 1e-10

SCENES = {
    "four-bar": mechanisms.four_bar,
    "ladder": lambda: gauss.load("n_four_bar", n=3),
    "Bricard": lambda: gauss.load("bricard"),
    "Stewart platform": lambda: _without_springs(gauss.load("stewart_platform")),
    "delta robot": lambda: gauss.load("delta_robot"),
}


def _without_springs(scene):
    scene.loads.clear()
    return scene


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("scene", SCENES)
def test_accelerations_are_those_of_constraint_dynamics(scene):
    model, worst = Welded(SCENES[scene]()), 0.0
    for state in random_states(model.system, STATES, seed=1):
        ours, theirs = model.system.accelerations(state), model.dynamics(state)[1]
        worst = max(worst, np.abs(ours - theirs).max() / np.abs(ours).max())
    assert worst <= AGREEMENT


@pytest.mark.slow
def test_an_overconstrained_four_bar_moves_like_the_planar_one():
    """Spatial hinges all around, or a last hinge of two rows in the plane: the same motion, and explain names the rest."""
    planar = mechanisms.four_bar()
    del planar.joints["D"]
    planar.on_line("D", "rocker", "ground", other_at=(1.2, 0, 0), axis=(0, 0, 1))
    spatial = mechanisms.four_bar()
    systems = [gauss.compile_scene(scene) for scene in (spatial, planar)]
    one, two = (gauss.simulate(s, 0.15, times=np.linspace(0, 0.15, 6), rtol=1e-11, atol=1e-12) for s in systems)
    for joint in "ABC":
        assert np.abs(one.coordinate(joint) - two.coordinate(joint)).max() <= 1e-10
        assert np.abs(one.rate(joint) - two.rate(joint)).max() <= 1e-8
    found = [gauss.mobility(system) for system in systems]
    assert [(one.freedoms, one.counted) for one in found] == [(1, -2), (1, 1)]
    assert found[0].redundant == (Redundancy(("A", "B", "C", "D"), 3),) and found[1].redundant == ()
    for one, system in zip(found, systems, strict=True):
        assert str(one).splitlines()[0] in system.explain()


def _balanced(trajectory):
    energy = gauss.energy(trajectory)
    assert np.abs(energy.balance).max() <= BALANCE * energy.scale


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["parallelogram", "bricard", "planetary_gears", "rolling_disk", "stewart_platform", "delta_robot"]
)
def test_shipped_mechanisms_keep_their_energy(name):
    scene = gauss.load(name)
    duration = 0.05 if name in ("stewart_platform", "delta_robot") else 0.3
    _balanced(gauss.simulate(scene, duration, rtol=1e-10, atol=1e-12))


# freedoms by counting, freedoms by rank
FREEDOMS = {
    "parallelogram": (-2, 1),
    "bricard": (0, 1),
    "planetary_gears": (-1, 1),
    "rolling_disk": (3, 3),
    "stewart_platform": (6, 6),
    "delta_robot": (3, 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FREEDOMS)
def test_freedoms_of_shipped_mechanisms(name):
    found = gauss.mobility(gauss.compile_scene(gauss.load(name)))
    assert (found.counted, found.freedoms) == FREEDOMS[name] and not found.is_singular


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2])
def test_a_ladder_follows_the_reference_up_to_the_flat_posture(n):
    """IFToMM A02: all cranks turn alike, ((N+1)/3 + N) l θ̈ = g ((N+1)/2 + N) sin θ; the table until θ = 90°."""
    data = mechanisms.reference("n-four-bar")["table"]
    t, angles = np.array(data["t"]), np.array(data[str(n)]["theta"])
    before = angles < 1.4
    kept = np.logical_and.accumulate(before)
    trajectory = gauss.simulate(gauss.load("n_four_bar", n=n), t[kept][-1], times=t[kept], rtol=1e-10, atol=1e-12)
    for crank in range(n + 1):
        assert np.abs(-trajectory.coordinate(f"A{crank}") - angles[kept]).max() <= 1e-8


def test_a_parallelogram_is_a_pendulum():
    """Both cranks turn alike, the coupler shifts: (2/3 + 1) m l θ̈ = −2 m g cos θ · l/l, θ the angle from the x-axis."""
    system = gauss.compile_scene(gauss.load("parallelogram"))
    state = system.initial_state()
    theta = state.q[0] + np.pi / 2
    assert system.accelerations(state)[0] == pytest.approx(-2 * 9.81 * np.cos(theta) / (5 / 3), rel=1e-12)


@pytest.mark.slow
def test_a_cardan_joint_turns_unevenly():
    """ω₂/ω₁ = cos β/(1 − sin²β cos²φ) at the bend β, φ measured from where the driving fork stands in the plane of both."""
    trajectory = gauss.simulate(gauss.load("cardan"), 0.2, rtol=1e-10, atol=1e-12)
    beta, phi = 0.4, trajectory.coordinate("input")
    candidates = [np.cos(beta) / (1 - np.sin(beta) ** 2 * f(phi) ** 2) for f in (np.cos, np.sin)]
    ratio = trajectory.rate("output")[:, 0] / trajectory.rate("input")
    assert min(np.abs(ratio - c).max() for c in candidates) <= 1e-10
    assert np.ptp(ratio) > 0.1


@pytest.mark.slow
def test_planets_share_a_torque_that_only_their_sum_decides():
    """Willis at the model: the carrier turns at a third; tooth forces of single planets are open, their sum is not."""
    scene = gauss.load("planetary_gears")
    trajectory = gauss.simulate(scene, 0.5, rtol=1e-11, atol=1e-12)
    assert trajectory.rate("carrier axle") == pytest.approx(trajectory.rate("sun axle") / 3, rel=1e-11, abs=1e-13)
    with pytest.warns(gauss.errors.NonUniqueReactionWarning, match="'sun mesh 1'"):
        gauss.constraint_forces(trajectory, "sun mesh 1")
    with warnings.catch_warnings(action="ignore"):
        teeth = [gauss.constraint_forces(trajectory, f"sun mesh {k}")[:, 0] for k in (1, 2, 3)]
    system = trajectory.system
    acceleration = np.array([system.accelerations(trajectory.state(k))[0] for k in range(len(trajectory))])
    assert 0.12 * np.abs(sum(teeth)) == pytest.approx(np.abs(2.0 - 0.01 * acceleration), rel=1e-8)


@pytest.mark.slow
def test_a_stewart_platform_stands_where_its_legs_put_it():
    """Legs of equal length carry the platform level; prescribed alike they lift it straight."""
    scene = _without_springs(gauss.load("stewart_platform"))
    for k in range(1, 7):
        scene.drive(f"leg{k}", displacement=lambda t: 0.1 * t)
    system = gauss.compile_scene(scene)
    trajectory = gauss.simulate(system, 0.5, integrator="rk4", step=0.1)
    pose = trajectory.body("platform")
    assert np.abs(pose.position[:, :2]).max() <= 1e-12
    assert np.abs(pose.rotation - np.eye(3)).max() <= 1e-11
    foot, head = (
        np.array([np.cos(np.deg2rad(10)), np.sin(np.deg2rad(10))]),
        0.6 * np.array([np.cos(np.deg2rad(50)), np.sin(np.deg2rad(50))]),
    )
    across = np.linalg.norm(foot - head)
    length = np.hypot(across, 1.0) + 0.1 * trajectory.t
    assert pose.position[:, 2] == pytest.approx(np.sqrt(length**2 - across**2), abs=1e-12)


def test_a_stewart_platform_at_rest_by_virtual_work():
    """The force of each leg that carries the platform and the rods: Σ F_k δl_k = δV for a vertical motion."""
    scene = _without_springs(gauss.load("stewart_platform"))
    system = gauss.compile_scene(scene)
    legs = [f"leg{k}" for k in range(1, 7)]
    found = gauss.inverse_dynamics(system, system.initial_state(), np.zeros(system.n_v), legs)
    assert found.is_unique and found.forces == pytest.approx([found.forces[0]] * 6, rel=1e-10)

    def height(lift):
        moved = gauss.compile_scene(_without_springs(gauss.load("stewart_platform")))
        state = moved.initial_state(_lifted(moved, lift), keep=legs)
        motion = kinematics(moved, state)
        return sum(m * x[2] for m, x in zip(moved.Phi[3::6], motion.x, strict=False))

    h = 1e-5
    slope = 9.81 * (height(h) - height(-h)) / (2 * h)
    assert found.forces.sum() == pytest.approx(slope, rel=1e-7)


def _lifted(system, lift):
    """Coordinates with every leg longer by the same amount; the rest follows."""
    q = system.reference.q
    for k in range(1, 7):
        q[system.joint(f"leg{k}").q] = lift
    return q


@pytest.mark.slow
def test_a_delta_robot_does_not_turn_its_platform():
    scene = gauss.load("delta_robot")
    scene.drive("hip1", angle=lambda t: 0.4 * np.sin(2 * t))
    scene.drive("hip2", angle=lambda t: 0.2 * t)
    scene.drive("hip3", angle=lambda t: -0.1 * t * t)
    trajectory = gauss.simulate(scene, 1.0, integrator="rk4", step=0.1)
    platform = trajectory.body("platform")
    assert np.abs(platform.rotation - np.eye(3)).max() <= 1e-11
    # each wrist is the length of a forearm away from its elbow
    for i, angle in enumerate(2 * np.pi * np.arange(3) / 3):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        hip = trajectory.coordinate(f"hip{i + 1}")
        elbow = 0.2 * out + 0.25 * (np.cos(hip)[:, None] * out - np.sin(hip)[:, None] * np.eye(3)[2])
        assert np.linalg.norm(platform.position + 0.05 * out - elbow, axis=1) == pytest.approx(0.5, abs=1e-11)
