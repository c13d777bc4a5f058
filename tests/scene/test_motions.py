"""Motions prescribed in time: the motion is met to rounding, the effort is that of closed forms and reference tables."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import gauss
from gauss import math as gm
from gauss.errors import NonUniqueReactionWarning, SceneError, StateError
from tests.support import mechanisms

FOLLOWED = 1e-12  # rad: a prescribed coordinate is projected onto its law after every step
TABLE = 1e-9  # of the largest entry: what the spec of the tables asks for; they are exact to 1e-12
BALANCE = 1e-9  # of the energies, at rtol 1e-11


def _driven_four_bar(drive):
    scene = mechanisms.four_bar()
    scene.starts.clear()
    scene.force("resistance", "rocker", moment=(0, 0, -100.0))
    scene.drive("A", **drive)
    return scene


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.NonUniqueReactionWarning")
def test_four_bar_at_constant_speed_against_the_table():
    """Crank torque and bearing forces over a cycle: linkage-fourbar.json, from groups of links in the plane."""
    data = mechanisms.reference("linkage-fourbar")["table"]
    t = np.array(data["crank_angle"]) / 10.0
    scene = _driven_four_bar({"angle": lambda t: 10.0 * t})
    trajectory = gauss.simulate(scene, t[-1], integrator="rk4", step=0.02, times=t)  # the constraints decide the motion
    assert np.abs(trajectory.coordinate("A") - 10.0 * t).max() <= FOLLOWED
    torque = gauss.drive_forces(trajectory, "A")
    assert np.abs(torque - data["M1"]).max() <= TABLE * np.abs(data["M1"]).max()
    for joint, sign in (("A", 1.0), ("B", 1.0), ("C", -1.0), ("D", 1.0)):  # C: on the coupler, which is its parent
        force = sign * gauss.reactions(trajectory, joint).force
        expected = np.column_stack([data[f"R_{joint}_x"], data[f"R_{joint}_y"]])
        assert np.abs(force[:, :2] - expected).max() <= TABLE * np.abs(expected).max()


@pytest.mark.slow
def test_work_of_a_prescribed_drive_closes_the_balance():
    trajectory = gauss.simulate(
        _driven_four_bar({"speed": lambda t: 10.0 + 3.0 * np.sin(5 * t)}), 0.2, rtol=1e-11, atol=1e-12
    )
    energy = gauss.energy(trajectory)
    assert np.abs(energy.balance).max() <= BALANCE * energy.scale
    assert np.abs(energy.drives[-1]) > 1.0
    exact = 10.0 * trajectory.t + 0.6 * (1.0 - np.cos(5 * trajectory.t))
    assert np.abs(trajectory.coordinate("A") - exact).max() <= 1e-10


def _pendulum(**drive):
    scene = gauss.Scene("pendulum", gravity=(0, -9.81, 0))
    scene.body("rod", mass=2.0, inertia=(0.0, 0.2, 0.2), com=(0.5, 0, 0))
    scene.revolute("A", "ground", "rod")
    scene.drive("A", **drive)
    return scene


TIMES = np.linspace(0.0, 2.0, 9)
TABLE_OF_ANGLES = CubicSpline(TIMES, np.sin(TIMES), bc_type="natural")
LAWS = {
    "numpy": (lambda t: 0.3 * np.sin(2 * t), lambda t: (0.3 * np.sin(2 * t), -1.2 * np.sin(2 * t))),
    "constant": (0.4, lambda t: (0.4 + 0 * t, 0 * t)),
    "spline": (TABLE_OF_ANGLES, lambda t: (TABLE_OF_ANGLES(t), TABLE_OF_ANGLES(t, 2))),
    "two pieces": (
        lambda t: gm.where(t < 1.0, t**3, 3 * t - 2),
        lambda t: (np.where(t < 1, t**3, 3 * t - 2), np.where(t < 1, 6 * t, 0)),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_effort_of_a_driven_pendulum(law):
    """τ = J φ̈ + m g l cos φ with φ, φ̈ of the law."""
    angle, exact = LAWS[law]
    t = np.linspace(0.0, 1.9, 12)
    # the constraint decides the motion, whatever the step
    trajectory = gauss.simulate(_pendulum(angle=angle), 1.9, integrator="rk4", step=0.05, times=t)
    phi, acceleration = exact(t)
    assert np.abs(trajectory.coordinate("A") - phi).max() <= FOLLOWED
    expected = (0.2 + 2.0 * 0.25) * acceleration + 2.0 * 9.81 * 0.5 * np.cos(phi)
    assert gauss.drive_forces(trajectory, "A") == pytest.approx(expected, rel=1e-12, abs=1e-11)


@pytest.mark.slow
def test_one_coordinate_of_many_is_driven():
    scene = gauss.Scene("wrist", gravity=(0, 0, 0))
    scene.body("hand", 1.0, (0.1, 0.2, 0.25))
    scene.universal("U", "ground", "hand", axis=(0, 0, 1), second_axis=(1, 0, 0))
    scene.drive("U.angle1", speed=2.0)
    scene.drive("U", torque=(0.1, 0.0))
    trajectory = gauss.simulate(scene, 0.5, times=[0.0, 0.5])
    assert trajectory.rate("U")[:, 0] == pytest.approx([2.0, 2.0], abs=1e-12)
    efforts = gauss.drive_forces(trajectory, "U")
    assert efforts.shape == (2, 2) and efforts[:, 1] == pytest.approx([0.0, 0.0])
    constraint = gauss.constraint_forces(trajectory, "drive of U.angle1")[:, 0]
    assert efforts[:, 0] == pytest.approx(constraint + 0.1, abs=1e-12)


@pytest.mark.slow
def test_a_point_led_along_a_path_carries_its_weight():
    """A bob whose point is led around a circle: the guide's force is m (p̈ − g)."""
    scene = gauss.Scene("led", gravity=(0, 0, -9.81))
    scene.body("bob", 1.5, (0.1, 0.1, 0.1))
    scene.free("F", "ground", "bob")
    scene.guide("hand", "bob", lambda t: (np.cos(3 * t), np.sin(3 * t), t**2))
    scene.start("F", position=(1.0, 0, 0, 1, 0, 0, 0))
    t = np.linspace(0, 1, 7)
    trajectory = gauss.simulate(scene, 1.0, times=t)
    force = gauss.constraint_forces(trajectory, "hand")
    expected = 1.5 * np.column_stack([-9 * np.cos(3 * t), -9 * np.sin(3 * t), 2.0 + 9.81 + 0 * t])
    assert force == pytest.approx(expected, rel=1e-11)
    energy = gauss.energy(trajectory)
    assert np.abs(energy.balance).max() <= 1e-8 * energy.scale


@pytest.mark.slow
def test_reactions_in_the_axes_of_a_body():
    trajectory = gauss.simulate(_pendulum(angle=lambda t: t), 1.0, times=[0.0, 0.5, 1.0])
    world, own = gauss.reactions(trajectory, "A"), gauss.reactions(trajectory, "A", axes="rod")
    R = trajectory.body("rod").rotation
    assert np.einsum("kij,kj->ki", R, own.force) == pytest.approx(world.force, abs=1e-12)
    assert own.force[:, 0] == pytest.approx(-2.0 * 0.5 + 2.0 * 9.81 * np.sin(trajectory.t), abs=1e-10)


@pytest.mark.slow
def test_redundant_loops_say_which_reactions_are_open():
    trajectory = gauss.simulate(_driven_four_bar({"speed": 10.0}), 0.1, times=[0.0, 0.1])
    with pytest.warns(NonUniqueReactionWarning, match="'B'.*not unique in moment x, moment y, force z"):
        gauss.reactions(trajectory, "B")


MISTAKES = {
    "two motions": (lambda s: s.drive("A", angle=1.0, speed=1.0), "either torque=.*got angle, speed"),
    "math.sin": (lambda s: s.drive("A", angle=lambda t: __import__("math").sin(t)), "cannot be differentiated.*np.sin"),
    "an if": (lambda s: s.drive("A", angle=lambda t: 1.0 if float(t) < 1 else 2.0), "cannot be differentiated"),
    "a vector": (lambda s: s.drive("A", angle=lambda t: (t, t)), "must return 1 number"),
    "not a law": (lambda s: s.drive("A", angle="fast"), "expected a number"),
    "no joint": (lambda s: s.drive("B", angle=1.0), "no joint 'B'"),
    "a joint of many": (lambda s: (s.ball("B", "ground", "rod"), s.drive("B", speed=1.0)), "B.wx, B.wy, B.wz"),
    "name taken": (lambda s: s.drive("A", speed=1.0, name="A"), "taken"),
    "no body": (lambda s: s.guide("g", "rood", (0, 0, 0)), "Did you mean 'rod'"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_are_refused(case):
    make, words = MISTAKES[case]
    scene = gauss.Scene("scene")
    scene.body("rod", 1.0, (0.1, 0.1, 0.1))
    scene.revolute("A", "ground", "rod")
    with pytest.raises(SceneError, match=words):
        make(scene)


def test_forces_of_what_is_not_there():
    trajectory = gauss.simulate(mechanisms.rods(1), 0.1, times=[0.0])
    with pytest.raises(StateError, match="nothing drives joint 'J1'"):
        gauss.drive_forces(trajectory, "J1")
    with pytest.raises(StateError, match="For a joint use gauss.reactions"):
        gauss.constraint_forces(trajectory, "J1")


@pytest.mark.slow
def test_a_law_without_a_value_is_named():
    scene = _pendulum(angle=lambda t: np.sqrt(0.5 - t))
    with pytest.raises(gauss.GaussError, match="'drive of A' has no finite value"):
        gauss.simulate(scene, 1.0, integrator="rk4", step=0.1)


def test_prescribed_motions_are_kept_in_files(tmp_path):
    scene = _pendulum(speed=2.0)
    assert gauss.load(gauss.save(scene, tmp_path / "scene.toml")) == scene
    with pytest.raises(gauss.GaussError, match="Python function"):
        gauss.save(_pendulum(angle=lambda t: t), tmp_path / "law.toml")
