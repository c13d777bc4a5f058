"""Coulomb friction by time stepping: closed forms of sliding and sticking, an independent cone programme, Painlevé's rod."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

import gauss
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.contact.moreau_step import advance_positions, advance_rates, moreau_stepper
from gauss.dynamics.gap_functions import gaps, slips
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import PainleveWarning, SceneError, SimulationError, StateError
from gauss.simulation.moreau.moreau_jean import contact_parts

g = 9.81
EXACT = 1e-8  # rates under constant forces, which a step of any length has right; the sliding is found to 1e-9
STEPPING = {"integrator": "time_stepping"}


@pytest.mark.slow
def test_a_block_slides_up_stops_and_slides_back():
    scene, h = gauss.load("block_on_incline"), 0.01
    trajectory = gauss.simulate(scene, 1.0, step=h, **STEPPING)
    down, element = g * np.sin(0.6), 0.5 * g * np.cos(0.6)
    turn = 3.0 / (down + element)
    v = np.where(trajectory.t < turn, -3.0 + (down + element) * trajectory.t, (down - element) * (trajectory.t - turn))
    # in the step in which it turns, friction changes sign at its end only
    late = trajectory.t > turn + h
    delay = v[late] - trajectory.v[late, 0]
    assert trajectory.v[~late, 0][:-2] == pytest.approx(v[~late][:-2], abs=EXACT)
    assert np.ptp(delay) < EXACT
    assert 0.0 <= delay[0] <= 2 * element * h
    assert np.abs(trajectory.v[:, 1:]).max() < EXACT
    assert np.abs(trajectory.q[:, 2]).max() < EXACT  # the convex relaxation alone would lift it by h μ s
    assert (trajectory.stats.plan.driver, trajectory.stats.plan.dynamics) == ("time stepping", "compiled")
    assert "relaxation" not in trajectory.stats.method


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "sticks"), [(0.68, False), (0.69, True)])  # tan 0.6 = 0.684
def test_a_block_at_rest_sticks_up_to_the_angle_of_friction(friction, sticks):
    scene = _incline(friction)
    trajectory = gauss.simulate(scene, 0.1, step=0.01, **STEPPING)
    expected = 0.0 if sticks else g * (np.sin(0.6) - friction * np.cos(0.6)) * 0.1
    assert trajectory.v[-1, 0] == pytest.approx(expected, abs=EXACT)
    pulled, weight = gauss.friction_forces(trajectory, "C"), 2.0 * g
    assert pulled[:-1].sum(axis=1) == pytest.approx(
        np.tile([-weight * min(np.sin(0.6), friction * np.cos(0.6)), 0, 0], (10, 1)), abs=1e-6
    )
    assert gauss.contact_forces(trajectory, "C").sum(axis=1) == pytest.approx(weight * np.cos(0.6), rel=1e-8)


def _incline(friction):
    scene = gauss.load("block_on_incline")
    scene.start("block moves")
    scene.contacts.clear()
    scene.contact("C", "sides", "slope", friction=friction)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("heading", [0.0, 0.3, 2.0])  # none but the first along a facet
def test_a_ball_rolls_after_sliding_with_five_sevenths_of_its_speed(heading):
    scene = gauss.load("rolling_ball")
    along = np.array([np.cos(heading), np.sin(heading)])
    scene.start("ball moves", rate=(*(3.0 * along), 0, 0, 0, 0))
    trajectory = gauss.simulate(scene, 0.6, step=0.01, **STEPPING)
    rolls = 2 * 3.0 / (7 * 0.2 * g)
    v = trajectory.v[:, :2]
    sliding = trajectory.t < rolls - 0.01
    assert v[sliding] == pytest.approx(np.outer(3.0 - 0.2 * g * trajectory.t[sliding], along), abs=EXACT)
    assert v[-1] == pytest.approx(15 / 7 * along, abs=EXACT)
    assert trajectory.v[-1, 3:5] * 0.1 == pytest.approx([-v[-1, 1], v[-1, 0]], abs=1e-6)  # in axes that turn with it
    found = gauss.energy(trajectory)
    assert found.dissipated[-1] == pytest.approx(0.5 * 9.0 * (2 / 7), abs=1e-6)  # 2/7 of the energy
    assert np.abs(found.balance).max() < 1e-6


@pytest.mark.slow
def test_a_bounce_has_its_restitution_and_the_impulse_of_friction():
    """Oblique impact of a ball without spin that slides throughout: Δv_t = μ Δv_n."""
    scene, h = gauss.load("rolling_ball"), 0.01
    scene.contacts.clear()
    scene.contact("C", "round", "table", restitution=0.8, friction=0.1)
    scene.start("ball moves", position=(0, 0, 0.025, 1, 0, 0, 0), rate=(3.0, 0, -2.0, 0, 0, 0))
    trajectory = gauss.simulate(scene, 0.03, step=h, **STEPPING)
    hit = np.flatnonzero(np.diff(trajectory.v[:, 2]) > 0)[0]
    before, after = trajectory.v[hit], trajectory.v[hit + 1]
    assert after[2] == pytest.approx(-0.8 * before[2], abs=EXACT)
    assert before[0] - after[0] == pytest.approx(0.1 * (after[2] - before[2] + g * h), abs=EXACT)  # bears its weight, too


def test_a_spinning_tripod_agrees_with_an_independent_cone_programme():
    """Three rough feet: forces by maximal dissipation in the round cone, found by another method in the space of forces."""
    scene = gauss.Scene("tripod", gravity=(1.0, 0.5, -g))
    scene.body("top", 1.3, (0.02, 0.03, 0.04), com=(0.02, -0.01, 0.1))
    scene.free("F", "ground", "top")
    scene.points("feet", "top", [(0.2, 0, 0), (-0.1, 0.15, 0), (-0.1, -0.17, 0)])
    scene.half_space("floor")
    scene.contact("C", "feet", "floor", friction=0.4)
    scene.start("F", rate=(0.3, -0.2, 0.0, 0.0, 0.0, 1.5))
    system, h, mu = gauss.compile_scene(scene), 1e-3, 0.4
    start = system.initial_state()
    step = moreau_stepper(system).step(start, h)
    assert step.error < 1e-9
    middle = advance_positions(system, start, h, step.share)
    motion = kinematics(system, middle)
    pushed = kinematics(system, advance_rates(middle, step.acceleration, h, step.share))
    problem = assemble_motion(pushed, Applied(pushed))  # forces that depend on rates are those of the middle of the step
    normals, friction = contact_parts(motion, step.force)
    # generalised forces r = (normal, two along) of each foot; its rates after the step are W r + b
    gap, slip = gaps(motion), slips(motion)
    J = np.concatenate([np.vstack([gap.J[i], slip.J[i]]) for i in range(3)])
    D = np.concatenate([[gaps(pushed).D[i], *slips(pushed).D[i]] for i in range(3)])
    now = np.concatenate([[gap.rate[i], *slip.rate[i]] for i in range(3)])
    free = gauss.solve(problem)
    x = np.concatenate([free.a, free.qdd])
    n, responses = problem.Phi.size, []
    for row in J:
        under = gauss.solve(_pushed(problem, row[:n], row[n:]))
        responses.append(np.concatenate([under.a, under.qdd]) - x)
    first, later = (moreau_stepper(system).kernel(at.state).bias for at in (motion, pushed))  # changes rates without any q̈
    bias = np.concatenate(
        [[x[i], *x[3 + 2 * i : 5 + 2 * i]] for x in ((1.0 - step.share) * first - later,) for i in range(3)]
    )
    W, b = h * J @ np.array(responses).T, now + h * (J @ x - D + bias)
    forces = np.concatenate([[normals[i], *(slip.axes[i] @ friction[i])] for i in range(3)])
    after = W @ forces + b
    for i in range(3):
        normal, along, s = forces[3 * i], forces[3 * i + 1 : 3 * i + 3], after[3 * i + 1 : 3 * i + 3]
        assert after[3 * i] == pytest.approx(0.0, abs=1e-9)
        assert along == pytest.approx(-mu * normal * s / np.linalg.norm(s), abs=1e-6)  # against the sliding, all of μ N
    # the convex programme whose cone is lifted by the sliding, by another optimiser
    lift = b + np.array(
        [mu * np.hypot(*after[3 * i + 1 : 3 * i + 3]) if k == 0 else 0.0 for i in range(3) for k in range(3)]
    )
    cones = [
        {"type": "ineq", "fun": lambda r, i=i: mu * r[3 * i] - np.sqrt(r[3 * i + 1] ** 2 + r[3 * i + 2] ** 2 + 1e-16)}
        for i in range(3)
    ]
    start = np.tile([4.0, 0.0, 0.0], 3)
    scale = 1.0 / np.abs(W).max()
    found = minimize(lambda r: scale * (0.5 * r @ W @ r + lift @ r), start, constraints=cones, tol=1e-14).x
    assert found == pytest.approx(forces, abs=2e-4)  # of 4 N: what that optimiser reaches


def _pushed(problem, force, effort):
    return replace(problem, impressed=problem.impressed + force, P=problem.P + effort)


@pytest.mark.slow
@pytest.mark.parametrize("heading", [0.0, 0.2, 0.7])
def test_sticking_in_any_direction_holds_up_to_the_cone_and_no_more(heading):
    ends = []
    for share in (0.9999, 1.1):
        scene = gauss.load("rolling_ball")
        scene.contacts.clear()
        scene.starts.clear()
        scene.points("feet", "ball", [(0.1, 0, -0.1), (-0.1, 0.1, -0.1), (-0.1, -0.1, -0.1)])
        scene.contact("C", "feet", "table", friction=0.2)
        push = share * 0.2 * g * np.array([np.cos(heading), np.sin(heading), 0.0])
        scene.force("push", "ball", force=push, at=(0, 0, -0.1))
        ends.append(np.linalg.norm(gauss.simulate(scene, 0.02, step=0.01, **STEPPING).v[-1, :2]))
    assert ends[0] < EXACT
    assert ends[1] == pytest.approx(0.1 * 0.2 * g * 0.02, abs=EXACT)


@pytest.mark.slow
def test_closed_loops_and_stops_step_too():
    scene = gauss.load("four_bar")
    joint = next(iter(scene.joints))
    highest = float(gauss.compile_scene(scene).initial_state().q[0]) + 0.3
    scene.stop(joint, highest=highest)
    h = 4e-3
    stepped = gauss.simulate(scene, 0.2, step=h, **STEPPING)
    exact = gauss.simulate(scene, 0.2, rtol=1e-8, times=stepped.t[1:])
    assert [event.kind for event in exact.events] == ["impact"]
    assert stepped.coordinate(joint)[1:] == pytest.approx(
        exact.coordinate(joint), abs=10.0 * h
    )  # its rate is about 10 rad/s
    assert stepped.coordinate(joint).max() <= highest + 100.0 * h * h  # as are its accelerations 100 rad/s²


def _rod(friction, speed, spin=0.0):
    scene = gauss.load("painleve_rod")
    scene.contacts.clear()
    scene.contact("C", "end", "floor", friction=friction)
    scene.start("plane", rate=(speed, 0.0, spin))
    return gauss.compile_scene(scene)


# K m = 1 + 3 cos θ (cos θ ± μ sin θ), 1.1 rad: negative beyond μ = 1.334, sliding ahead
@pytest.mark.slow
@pytest.mark.parametrize(
    ("friction", "speed", "spin", "kind"),
    [
        (1.33, -1.0, 0.0, None),
        (1.34, -1.0, 0.0, "no accelerations"),
        (1.34, 1.0, 0.0, None),
        (1.34, -1.0, 4.0, "two accelerations"),  # it turns so fast that the end lifts off by itself
        (1.33, -1.0, 4.0, None),
    ],
)
def test_painleves_paradox_begins_where_theory_says(friction, speed, spin, kind):
    system = _rod(friction, speed, spin=spin)
    found = gauss.paradoxes(system, system.initial_state())
    assert [(paradox.gaps, paradox.kind) for paradox in found] == ([] if kind is None else [(("C",), kind)])


@pytest.mark.slow
def test_painleves_rod_is_reported_and_jams():
    with pytest.warns(PainleveWarning, match="t = 0 s: .*'C'"):
        trajectory = gauss.simulate(gauss.load("painleve_rod"), 0.05, step=5e-3, **STEPPING)
    assert trajectory.v[0, 0] == -1.0
    assert np.abs(trajectory.v[1:, :2]).max() < EXACT  # the end stands still after one step
    assert (trajectory.v[1:, 2] > 0.5).all()  # the rod turns about it: what is left of its momentum


@pytest.mark.slow
def test_reactions_bear_their_share_of_friction():
    """Two welded blocks on one plane, the first rough: the weld drags the second along."""
    scene = gauss.Scene("train", gravity=(3.0, 0, -g))
    for i, name in enumerate(("rough", "smooth")):
        place = (float(i), 0, 0.1)
        scene.body(name, 1.0 + i, (0.1, 0.1, 0.1), position=place)
        scene.box(f"box {name}", name, (0.4, 0.4, 0.2))
    scene.free("F", "ground", "rough", at=(0, 0, 0.1))
    scene.prismatic("weld", "rough", "smooth", at=(0.5, 0, 0.1), axis=(0, 0, 1))
    scene.half_space("floor")
    scene.contact("C", "box rough", "floor", friction=0.2)
    scene.contact("D", "box smooth", "floor")
    scene.start("F", rate=(1.0, 0, 0, 0, 0, 0))
    trajectory = gauss.simulate(scene, 0.02, step=0.01, **STEPPING)
    force, _ = gauss.reactions(trajectory, "weld")
    acceleration = 3.0 - 0.2 * g / 3.0
    assert np.diff(trajectory.v[:, 0]) / 0.01 == pytest.approx(acceleration, abs=1e-6)
    assert force[0] == pytest.approx([2.0 * (acceleration - 3.0), 0, 0], abs=1e-6)


def test_a_block_has_no_paradox():
    with warnings.catch_warnings():
        warnings.simplefilter("error", PainleveWarning)
        gauss.simulate(gauss.load("block_on_incline"), 0.02, step=0.01, **STEPPING)


MISTAKES = {
    "negative": (lambda s: s.contact("D", "sides", "slope", friction=-0.1), SceneError, "friction: expected a non-negative"),
    "one body": (
        lambda s: (s.sphere("more", "block", 0.1), s.contact("D", "sides", "more")),
        SceneError,
        "both shapes are on 'block'",
    ),
    "adaptive": (lambda s: gauss.simulate(s, 0.1), SimulationError, "'dop853' takes no friction.*time_stepping.*C"),
    "accelerations": (
        lambda s: gauss.compile_scene(s).accelerations(gauss.compile_scene(s).initial_state()),
        SceneError,
        "C: friction, clutches, limited drives and losses are no rows",
    ),
    "no step": (lambda s: gauss.simulate(s, 0.1, **STEPPING), SimulationError, "step="),
    "friction of another motion": (
        lambda s: gauss.friction_forces(gauss.simulate(gauss.load("slack_rope"), 0.01), "rope"),
        StateError,
        "time_stepping",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make(gauss.load("block_on_incline"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "held", [{"angle": 0.0}, {"angle": 0.3}, {"speed": 0.0}, {"angle": lambda t: 0.3 * np.sin(3.0 * t)}]
)
def test_friction_of_a_joint_that_a_drive_moves_changes_nothing_but_its_torque(held):
    """The drive takes whatever is beyond the limit of friction, at rest too: nothing sets out or comes to a standstill."""
    motions = []
    for limit in (None, 0.5):  # N m; the drive holds up to 3
        scene = gauss.Scene("held")
        scene.body("upper", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0))
        scene.body("lower", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0), on="upper", position=(1, 0, 0))
        scene.revolute("R", "ground", "upper", axis=(0, 1, 0))
        scene.revolute("S", "upper", "lower", axis=(0, 1, 0))
        scene.drive("S", **held)
        if limit:
            scene.joint_friction("S", limit)
        motions.append(gauss.simulate(scene, 0.5))
    free, rubbed = (motion.state(-1) for motion in motions)
    assert rubbed.q == pytest.approx(free.q, abs=1e-10) and rubbed.v == pytest.approx(free.v, abs=1e-10)


PRESCRIBED_SLIPS = {  # how an element is made, and its loss [J]: what one drive takes from another is no loss
    "clutch": (lambda scene: scene.clutch("element", "to a", "to b", torque=2.0), 2.0),
    "joint friction": (lambda scene: scene.joint_friction("to b", 2.0, name="element"), 2.0),
    "limited drive": (lambda scene: scene.drive("to b", speed=0.0, limit=2.0, name="element"), 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["auto", "recursion"])
@pytest.mark.parametrize("element", PRESCRIBED_SLIPS)
def test_an_element_slips_on_through_a_standstill_that_prescribed_motions_do_not_let_it_hold(element, backend):
    """Both shafts turn as prescribed, one at 1 − t: 2 N m lose 2 ∫ |1 − t| dt = 2 J in 2 s, which the drive gives."""
    make, loss = PRESCRIBED_SLIPS[element]
    scene = gauss.Scene("shafts")
    for name in ("a", "b"):
        scene.body(name, 1.0, (1.0, 1.0, 1.0))
        scene.revolute(f"to {name}", "ground", name, axis=(1.0, 0.0, 0.0))
    scene.drive("to a", angle=0.0)
    scene.drive("to b", speed=lambda t: 1.0 - t)
    make(scene)
    motion = gauss.simulate(scene, 2.0, backend=backend, progress=False)
    assert [(event.kind, event.gaps) for event in motion.events] == [("slips", ("element",))]
    assert motion.events[0].t == pytest.approx(1.0, abs=1e-9)
    assert motion.rate("to b")[-1] == pytest.approx(-1.0, abs=1e-9)
    assert motion.work[-1] == pytest.approx([loss, 0.0, loss], abs=1e-7)
