"""Joint friction and drives of limited force: closed forms, another integrator, the conditions of sticking, loops, files."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gauss
from gauss.dynamics.contact.mode_selection import mode_selector
from gauss.errors import NonUniqueReactionWarning, SceneError, SimulationError, StateError
from gauss.system import ContactMode, phase_scene

pytestmark = pytest.mark.slow

g = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
HELD = 1e-20  # m, m/s: rounding of forces that balance, over the mass and for a tenth of a second
EXACT = 1e-9  # a motion at rtol 1e-10 against its closed form
ROUNDING = 1e-14
RELEASE = 1e-8  # s: an element lets go when its force exceeds the limit by 1e-9


def test_every_half_swing_is_shorter_by_the_same_until_friction_holds():
    trajectory = gauss.simulate(gauss.load("friction_oscillator"), 1.8, **TIGHT)
    half, turns = np.pi / 10, np.array([0.21 - 0.04 * k for k in range(6)])
    assert [event.kind for event in trajectory.events] == ["slips"] * 4 + ["holds"]
    assert [event.t for event in trajectory.events] == pytest.approx(half * np.arange(1, 6), abs=EXACT)
    for k, event in enumerate(trajectory.events, start=1):
        at = np.searchsorted(trajectory.t, event.t)
        assert trajectory.q[at, 0] == pytest.approx((-1) ** k * turns[k], abs=EXACT)
    assert trajectory.q[-1, 0] == pytest.approx(-turns[-1], abs=EXACT)
    assert abs(trajectory.v[-1, 0]) < HELD
    found = gauss.energy(trajectory)
    assert np.abs(found.balance).max() < EXACT
    assert found.dissipated[-1] == pytest.approx(50.0 * (0.21**2 - turns[-1] ** 2), abs=EXACT)
    force = gauss.set_valued_forces(trajectory, "friction of rail")
    assert force[0] == 2.0  # against the motion that begins
    assert force[-1] == pytest.approx(100.0 * trajectory.q[-1, 0], abs=EXACT)  # no more than it takes


@pytest.mark.parametrize("push", [1.999, 2.001, -2.001])
def test_a_joint_sticks_up_to_its_limit(push):
    scene = gauss.load("friction_oscillator")
    scene.start("rail", position=0.0)
    scene.drive("rail", force=push)
    trajectory = gauss.simulate(scene, 0.1, **TIGHT)
    sticks = abs(push) < 2.0
    expected = 0.0 if sticks else 1e-5 * (1 - np.cos(1.0))
    assert np.abs(trajectory.q).max() == pytest.approx(expected, rel=1e-6, abs=HELD)
    force = gauss.set_valued_forces(trajectory, "friction of rail")
    assert force == pytest.approx(-push if sticks else -2.0 * np.sign(push), abs=EXACT)


def test_a_rising_push_breaks_loose_when_it_should():
    scene = gauss.load("friction_oscillator")
    scene.start("rail", position=0.0)
    scene.drive("rail", force=lambda t: 4.0 * t)
    trajectory = gauss.simulate(scene, 1.0, **TIGHT)
    assert [event.kind for event in trajectory.events] == ["slips"]
    assert trajectory.events[0].t == pytest.approx(0.5, abs=RELEASE)
    late = np.maximum(trajectory.t - 0.5, 0.0)  # ẍ + 100 x = 4 late, from rest
    assert trajectory.q[:, 0] == pytest.approx(0.04 * late - 0.004 * np.sin(10 * late), abs=EXACT)


@pytest.mark.peer
def test_a_double_pendulum_with_friction_moves_as_another_integrator_says():
    frictions = np.array([0.8, 0.4])
    scene = gauss.load("double_pendulum_stops")
    scene.contacts.clear()
    for joint, limit in zip("AB", frictions, strict=True):
        scene.joint_friction(joint, float(limit))
    trajectory = gauss.simulate(scene, 0.4, times=np.linspace(0, 0.4, 21), **TIGHT)
    plain = gauss.load("double_pendulum_stops")
    plain.contacts.clear()
    system = gauss.compile_scene(plain)

    def rhs(t, y):
        return np.concatenate([y[2:], system.accelerations(system.state(y[:2], y[2:]), -frictions * np.sign(y[2:]))])

    # the first joint slips at once; the lower one too, as soon as its limit is passed: both move one way in this time
    moving = trajectory.v[1:]
    assert (np.sign(moving) == np.sign(moving[0])).all()
    start = np.concatenate([trajectory.q[1], trajectory.v[1]])
    other = solve_ivp(rhs, (0.02, 0.4), start, "DOP853", t_eval=trajectory.t[1:], rtol=1e-11, atol=1e-13).y.T
    assert np.column_stack([trajectory.q, trajectory.v])[1:] == pytest.approx(other, abs=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_what_holds_minimises_the_compulsion_with_friction(seed):
    """Against a search over all cases of three joints at rest: the least of ½|a − a_free|² − Pᵀq̈ + Σ limit |q̈|."""
    rng = np.random.default_rng(seed)
    scene = gauss.load("n_pendulum", n=3)
    joints = list(scene.joints)
    for joint in joints:
        scene.joint_friction(joint, float(rng.uniform(0.5, 10.0)))
        scene.start(joint, position=float(rng.uniform(-2, 2)))
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    selected = mode_selector(system).choose(state, np.zeros(0, dtype=int), "auto")
    limits = np.array([element.limit for element in scene.set_valued.values()])

    costs = {}
    for case in product((-1, 0, 1), repeat=3):
        mode = phase_scene(scene, (), ContactMode(set_valued=dict(zip(scene.set_valued, case, strict=True))))
        bare = gauss.compile_scene(mode)
        found = gauss.solve(gauss.assemble(bare, bare.initial_state()))
        deviation = found.a - found.compulsion.a_free
        costs[case] = 0.5 * deviation @ (system.Phi * deviation) + limits @ np.abs(found.qdd)
    assert tuple(selected.mode.set_valued.values()) == min(costs, key=costs.get)
    assert (np.abs(list(selected.forces.values())) <= limits * (1 + 1e-12)).all()


def test_a_limited_drive_keeps_its_speed_as_long_as_it_can():
    scene = gauss.Scene("winch", gravity=(0, 0, 0))
    scene.body("drum", 1.0, (1.0, 1.0, 2.0))
    scene.revolute("A", "ground", "drum")
    scene.drive("A", speed=3.0, limit=4.0)
    scene.force("load", "drum", moment=lambda t: (0.0, 0.0, -2.0 * t))
    trajectory = gauss.simulate(scene, 3.5, **TIGHT)
    # 2 ω̇ = 4 − 2 t until ω = 3: never; it falls behind, ω = 2 t − t²/2 (2 at most), and is driven by its limit throughout
    assert trajectory.v[:, 0] == pytest.approx(2 * trajectory.t - trajectory.t**2 / 2, abs=EXACT)
    assert gauss.drive_forces(trajectory, "A") == pytest.approx(4.0)
    scene.start("A", rate=3.0)
    trajectory = gauss.simulate(scene, 3.0, **TIGHT)
    assert trajectory.events[0].kind == "slips"
    assert trajectory.events[0].t == pytest.approx(2.0, abs=RELEASE)  # where 2 t = 4
    late = np.maximum(trajectory.t - 2.0, 0.0)
    assert trajectory.v[:, 0] == pytest.approx(3.0 - late**2 / 2, abs=EXACT)
    assert gauss.drive_forces(trajectory, "A") == pytest.approx(np.minimum(2 * trajectory.t, 4.0), abs=EXACT)
    found = gauss.energy(trajectory)
    assert np.abs(found.balance).max() < 1e-8
    assert found.dissipated[-1] == 0.0  # it is a drive


def test_an_effort_is_cut_off_at_its_limit_by_compiled_code_too():
    scene = gauss.Scene("motor", gravity=(0, 0, 0))
    scene.body("rotor", 1.0, (1.0, 1.0, 2.0))
    scene.revolute("A", "ground", "rotor")
    scene.drive("A", torque=lambda t: 3.0 * t, limit=1.5)
    ends = [gauss.simulate(scene, 2.0, backend=backend, **TIGHT) for backend in ("auto", "recursion")]
    assert ends[0].stats.plan.dynamics == "compiled" and ends[1].stats.plan.dynamics == "certified"
    for trajectory in ends:
        assert trajectory.v[-1, 0] == pytest.approx((0.5 * 1.5 * 0.5 + 1.5 * 1.5) / 2.0, abs=1e-8)
        assert gauss.drive_forces(trajectory, "A").max() == 1.5


def test_friction_in_every_joint_of_a_loop_holds_though_its_shares_are_open():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    scene.loads.clear()
    for joint in list(scene.joints):
        scene.joint_friction(joint, 40.0)
    trajectory = gauss.simulate(scene, 0.2)
    assert np.abs(trajectory.v).max() < 1e-12
    for joint in scene.joints:
        assert np.abs(gauss.set_valued_forces(trajectory, f"friction of {joint}")).max() <= 40.0
    with pytest.warns(NonUniqueReactionWarning):
        gauss.reactions(trajectory, next(iter(scene.joints)))


def test_a_stop_with_friction_and_reactions_of_what_holds():
    """A beam on a hinge with friction, at rest against a stop: the stop bears what friction leaves."""
    scene = gauss.Scene("beam", gravity=(0, -g, 0))
    scene.body("beam", 2.0, (0.01, 0.1, 0.1), com=(0.5, 0, 0))
    scene.revolute("A", "ground", "beam")
    scene.stop("A", lowest=0.0)
    scene.joint_friction("A", 3.0)
    trajectory = gauss.simulate(scene, 0.1)
    assert np.abs(trajectory.v).max() < EXACT
    force, _ = gauss.reactions(trajectory, "A")
    assert force[-1] == pytest.approx([0.0, 2.0 * g, 0.0], abs=1e-9)
    instant = gauss.solve(gauss.assemble(trajectory.system, trajectory.state(0)))
    assert np.abs(instant.qdd).max() < EXACT


def test_time_stepping_takes_joint_friction_and_converges_with_the_step():
    scene = gauss.load("friction_oscillator")
    exact, errors = gauss.simulate(scene, 1.8, times=[1.8], **TIGHT), []
    for h in (1e-2, 2e-3):
        motion = gauss.simulate(scene, 1.8, integrator="time_stepping", step=h, progress=False)
        errors.append(abs(motion.q[-1, 0] - exact.q[-1, 0]))
        force = gauss.set_valued_forces(motion, "friction of rail")
        assert np.abs(force).max() <= 2.0 + EXACT
        slides = np.abs(motion.v[1:, 0]) > 1e-6
        assert force[:-1][slides] == pytest.approx(-2.0 * np.sign(motion.v[1:, 0][slides]), abs=EXACT)
    assert errors[0] < 1e-3
    assert errors[1] < 0.25 * errors[0]  # of order h or better


def test_time_stepping_sticks_exactly_and_bears_what_it_takes():
    scene = gauss.load("friction_oscillator")
    scene.start("rail", position=0.0)
    scene.drive("rail", force=1.9)
    motion = gauss.simulate(scene, 0.5, integrator="time_stepping", step=1e-2)
    assert np.abs(motion.q).max() < ROUNDING
    assert gauss.set_valued_forces(motion, "friction of rail") == pytest.approx(-1.9, abs=EXACT)


def test_a_drive_of_limited_force_pulls_a_block_over_rough_ground():
    """4 N against friction of 0.1 · 2 · 9.81 N until the speed is 1 m/s, then what friction takes; its work is that."""
    scene, h = gauss.Scene("tug", gravity=(0, 0, -g)), 1e-2
    scene.body("sled", 2.0, (0.1, 0.1, 0.1), position=(0, 0, 0.1))
    scene.planar("P", "ground", "sled", axis=(0, -1, 0))
    scene.points("runner", "sled", [(0, 0, -0.1)])
    scene.half_space("ice")
    scene.contact("C", "runner", "ice", friction=0.1)
    scene.body("rope end", 1e-3, (1e-6, 1e-6, 1e-6))
    scene.prismatic("winch", "ground", "rope end", axis=(1, 0, 0))
    scene.constrain("tow", position=lambda at: at.position("rope end")[0] - at.position("sled")[0])
    scene.joint_friction("P.angle", 10.0, name="upright")
    scene.drive("winch", speed=1.0, limit=4.0, name="tug")
    motion = gauss.simulate(scene, 2.0, integrator="time_stepping", step=h)
    rub, mass = 0.1 * 2.0 * g, 2.001
    reached = mass * 1.0 / (4.0 - rub)
    speed = np.minimum(motion.t * (4.0 - rub) / mass, 1.0)
    assert motion.body("sled").velocity[:, 0] == pytest.approx(speed, abs=1e-6)
    pull = gauss.set_valued_forces(motion, "tug")
    assert pull[motion.t < reached - h] == pytest.approx(4.0, abs=1e-6)
    assert pull[-2] == pytest.approx(rub, abs=1e-6)
    assert np.abs(gauss.energy(motion).balance).max() < 1e-6


MISTAKES = {
    "negative": (lambda s: s.joint_friction("rail", -1.0, name="x"), SceneError, "'x': limit: expected a positive"),
    "no such joint": (lambda s: s.joint_friction("rial", 1.0), SceneError, "no joint 'rial'"),
    "limit of an angle": (lambda s: s.drive("rail", displacement=0.1, limit=3.0), SceneError, "limit= goes with"),
    "fixed step": (
        lambda s: gauss.simulate(s, 0.1, integrator="rk4", step=0.1),
        SimulationError,
        "'rk4' does not locate the events.*friction of rail",
    ),
    "no such element": (
        lambda s: gauss.set_valued_forces(gauss.simulate(s, 0.01), "friction of rial"),
        StateError,
        "Did you mean 'friction of rail'",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make(gauss.load("friction_oscillator"))
