"""One-sided constraints: rows, events, impacts and releases against closed forms, invariants and a second integrator."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gauss
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics
from gauss.errors import FileError, SceneError, SimulationError, StateError
from gauss.simulation.phases.event_location import first_hit
from gauss.system import random_state, retract
from tests.support import mechanisms

g = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
EXACT = 1e-9  # a motion at rtol 1e-10 over a second or two against its closed form
CENTRAL_DIFFERENCE = 2e-7  # h² of a step 1e-5 times third derivatives, plus rounding/h
ROUNDING = 1e-12
RELEASE = (
    1e-6  # [s]: a gap opens when it does so with 1e-7 of the accelerations, see LEAVING; what follows is off by its cube
)
QP_BACKENDS = ("daqp", "quadprog", "clarabel", "piqp", "proxqp", "osqp")
QP_TOLERANCE = 1e-7  # of backends asked for 1e-9


def _two(seed=0):
    """Two free bodies in skew positions, one of which carries a slider."""
    rng, scene = np.random.default_rng(seed), gauss.Scene("two", gravity=(0.3, -0.2, -9.81))
    for name in ("a", "b"):
        pose = {"position": rng.normal(size=3), "rotation": rng.normal(size=3)}
        scene.body(name, 1.0, mechanisms.inertia(rng), rng.normal(size=3), **pose)
        scene.free(name.upper(), "ground", name, at=rng.normal(size=3))
    scene.body("slider", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("S", "a", "slider", axis=rng.normal(size=3))
    return scene


POINTS = {"at": (0.3, -0.2, 0.5), "other_at": (-0.4, 0.1, 0.2)}


def _touching(first, second):
    """Builder of a contact between a shape of each of the two bodies."""

    def build(scene):
        SHAPES[first](scene, "one", "a", (0.3, -0.2, 0.5))
        SHAPES[second](scene, "two", "b", (-0.4, 0.1, 0.2))
        scene.contact("r", "one", "two")

    return build


SHAPES = {
    "sphere": lambda s, name, body, at: s.sphere(name, body, 0.3, at),
    "capsule": lambda s, name, body, at: s.capsule(name, body, 0.2, 1.0, at, (1, 2, -1)),
    "box": lambda s, name, body, at: s.box(name, body, (1, 2, 3), at, (0.1, 0.2, 0.3)),
    "points": lambda s, name, body, at: s.points(name, body, [(0, 0, 1), (0, 1, -1)], 0.1, at),
    "half-space": lambda s, name, body, at: s.half_space(name, body, at, (1, 2, -1)),
}
PAIRS = [(one, "half-space") for one in ("sphere", "points", "capsule", "box")]
PAIRS += [(one, two) for one in ("sphere", "points", "capsule") for two in ("sphere", "points", "capsule")]
PAIRS += [("sphere", "box"), ("box", "sphere"), ("half-space", "box"), ("points", "box"), ("capsule", "box"), ("box", "box")]
KINDS = {
    "stop": lambda s: s.stop("S", lowest=-0.3, highest=0.4),
    "rope": lambda s: s.rope("r", "a", "slider", length=2.0, **POINTS),
    "your own": lambda s: s.one_sided("r", lambda at: at.position("a")[2] - at.position("b")[0] ** 2 - at.t),
} | {f"{one} and {two}": _touching(one, two) for one, two in PAIRS}


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_gaps_are_their_derivatives(kind):
    scene = _two()
    KINDS[kind](scene)
    system = gauss.compile_scene(scene)
    rng = np.random.default_rng(1)
    state, rate, h = random_state(system, rng), rng.standard_normal(system.n_v), 1e-5

    def moved(s):  # with constant accelerations of the coordinates
        theta = s * state.v + 0.5 * s * s * rate
        return gaps(kinematics(system, replace(state, t=s, q=retract(system, state.q, theta), v=state.v + s * rate)))

    here, before, after = moved(0.0), moved(-h), moved(h)
    assert here.rate == pytest.approx(
        (after.width - before.width) / (2 * h), abs=CENTRAL_DIFFERENCE * np.abs(here.rate).max()
    )
    motion = kinematics(system, replace(state, t=0.0))
    one, two = (
        kinematics(system, replace(state, q=retract(system, state.q, s * state.v), v=state.v + s * rate)) for s in (-h, h)
    )
    a = (two.quasi_velocities() - one.quasi_velocities()) / (2 * h)
    assert motion.state.v is not None and here.J.shape == (len(here.width), a.size + rate.size)
    acceleration = here.J @ np.concatenate([a, rate]) - here.D
    assert acceleration == pytest.approx((after.rate - before.rate) / (2 * h), abs=CENTRAL_DIFFERENCE * 100)


def _ball(restitution, height=1.0):
    scene = gauss.Scene("ball", gravity=(0, 0, -g))
    scene.body("ball", 2.0, (0.1, 0.1, 0.1), position=(0, 0, height))
    scene.free("F", "ground", "ball", at=(0, 0, height))
    scene.sphere("round", "ball", 0.25)
    scene.half_space("floor")
    scene.contact("bounce", "round", "floor", restitution)
    return scene


def test_a_bouncing_ball_hits_when_it_should_and_comes_to_rest():
    e, drop = 0.5, 0.75
    trajectory = gauss.simulate(_ball(e), 2.0, **TIGHT)
    hits = np.array([event.t for event in trajectory.events if event.kind == "impact"])
    fall, n = np.sqrt(2 * drop / g), np.arange(len(hits))
    assert hits[:12] == pytest.approx((fall + 2 * fall * e * (1 - e**n) / (1 - e))[:12], abs=EXACT)
    assert trajectory.events[-1].kind == "closes"
    assert trajectory.events[-1].t == pytest.approx(fall * (1 + e) / (1 - e), abs=1e-6)  # of the bounces that are left out
    assert trajectory.q[-1, 2] == pytest.approx(0.25 - 1.0, abs=ROUNDING)
    losses = [event.loss for event in trajectory.events[:5]]
    assert losses == pytest.approx([2.0 * g * drop * (1 - e**2) * e ** (2 * k) for k in range(5)], rel=EXACT)
    assert np.abs(gauss.energy(trajectory).balance).max() < EXACT


def test_a_ball_without_loss_keeps_its_energy_and_its_period():
    trajectory = gauss.simulate(_ball(1.0), 4.0, **TIGHT)
    hits = [event.t for event in trajectory.events]
    assert np.diff(hits) == pytest.approx(2 * np.sqrt(1.5 / g), abs=EXACT)
    assert trajectory.work[-1, 2] == pytest.approx(0.0, abs=EXACT)


def test_a_stop_lets_go_when_the_drive_turns():
    scene = gauss.Scene("door", gravity=(0, 0, 0))
    scene.body("door", 1.0, (1.0, 1.0, 2.0))
    scene.revolute("A", "ground", "door")
    scene.drive("A", torque=lambda t: t - 1.0)
    scene.stop("A", lowest=0.0)
    trajectory = gauss.simulate(scene, 2.0, times=np.linspace(0, 2, 9), **TIGHT)
    closes, opens = trajectory.events
    assert (closes.t, closes.kind, opens.kind) == (0.0, "closes", "opens")
    assert opens.t == pytest.approx(1.0, abs=RELEASE)
    late = np.maximum(trajectory.t - 1.0, 0.0)
    assert trajectory.coordinate("A") == pytest.approx(late**3 / 12.0, abs=EXACT)
    force = gauss.contact_forces(trajectory, "stop of A")
    assert force[:, 0] == pytest.approx(np.maximum(1.0 - trajectory.t, 0.0), abs=EXACT)


def _double_pendulum_with_stops(t_end):
    """The same by scipy's integrator, in closed form: M(B) (Ä, B̈) = f, and M Δv = row · impulse at the stops."""
    L, c, J, m = 1.0, 0.5, 1.0 / 12.0, 1.0
    e, stop = 0.6, 0.5

    def mass(B):
        k = m * L * c * np.cos(B)
        second = J + m * c * c
        return np.array([[second + second + m * L * L + 2 * k, second + k], [second + k, second]])

    def rhs(t, y):
        A, B, a, b = y
        k = m * L * c * np.sin(B)
        upper, lower = m * g * np.cos(A), m * g * c * np.cos(A + B)
        force = [k * (2 * a + b) * b - upper * c - upper * L - lower, -k * a * a - lower]
        return [a, b, *np.linalg.solve(mass(B), force)]

    def low(t, y):
        return y[1] + stop

    def high(t, y):
        return stop - y[1]

    low.terminal = high.terminal = True
    low.direction = high.direction = -1.0
    t, y, hits = 0.0, np.array([0.4, -0.3, 0.0, 0.0]), []
    while t < t_end:
        found = solve_ivp(rhs, (t, t_end), y, "DOP853", events=(low, high), rtol=1e-12, atol=1e-13)
        t, y = found.t[-1], found.y[:, -1]
        if found.status == 1:
            hits.append(t)
            inverse = np.linalg.inv(mass(y[1]))
            y[2:] -= inverse[:, 1] / inverse[1, 1] * (1 + e) * y[3]
    return np.array(hits), y


def test_double_pendulum_with_stops_moves_as_another_integrator_says():
    trajectory = gauss.simulate(gauss.load("double_pendulum_stops"), 2.0, **TIGHT)
    hits, end = _double_pendulum_with_stops(2.0)
    assert len(hits) >= 3
    assert [event.t for event in trajectory.events] == pytest.approx(hits, abs=1e-8)  # impacts amplify errors of 1e-10
    assert np.concatenate([trajectory.q[-1], trajectory.v[-1]]) == pytest.approx(end, abs=1e-7)
    assert np.abs(trajectory.coordinate("B")).max() <= 0.5 + ROUNDING
    assert np.abs(gauss.energy(trajectory).balance).max() < 1e-8


def test_a_rope_goes_slack_where_it_should_and_flies_on_a_parabola():
    trajectory = gauss.simulate(gauss.load("slack_rope"), 1.5, **TIGHT)
    closes, slack, jerk, taut = trajectory.events
    assert [event.kind for event in trajectory.events] == ["closes", "opens", "impact", "closes"]
    at = np.searchsorted(trajectory.t, slack.t)
    p, u = trajectory.body("bob").position[at, :2], trajectory.body("bob").velocity[at, :2]
    height = (3.5 - 2.0) / 3.0  # where m v² / l = m g · height
    assert p == pytest.approx([np.sqrt(1 - height**2), height], abs=RELEASE * 10)
    flight = jerk.t - slack.t
    landing = p + u * flight - [0, 0.5 * g * flight**2]
    assert np.linalg.norm(landing) == pytest.approx(1.0, abs=EXACT)
    speed = (u - [0, g * flight]) @ landing
    assert jerk.loss == pytest.approx(0.5 * speed**2, rel=1e-7)
    distance = np.linalg.norm(trajectory.body("bob").position, axis=1)
    assert distance.max() <= 1.0 + EXACT
    tension = gauss.contact_forces(trajectory, "rope")
    assert tension[0, 0] == pytest.approx(4.5 * g, rel=EXACT)  # m g + m v² / l
    assert (tension[(trajectory.t > slack.t) & (trajectory.t < jerk.t)] == 0.0).all()


@pytest.mark.parametrize("backend", ["kkt", "quadprog"])
def test_a_backend_chosen_for_a_motion_solves_its_phases(backend):
    trajectory = gauss.simulate(_ball(0.0), 1.0, backend=backend, **TIGHT)
    assert [event.kind for event in trajectory.events] == ["impact", "closes"]
    assert trajectory.v[-1] == pytest.approx(np.zeros(6), abs=1e-8)


def test_the_last_ball_of_the_cradle_takes_it_all():
    trajectory = gauss.simulate(gauss.load("newtons_cradle"), 1.2, **TIGHT)
    assert [event.gaps for event in trajectory.events] == [("C1",), ("C2",), ("C3",), ("C4",)]
    after = np.flatnonzero(trajectory.t >= trajectory.events[-1].t)[-1]
    assert trajectory.v[after, :4] == pytest.approx(np.zeros(4), abs=1e-3)  # they swing through their gaps of 0.1 mm
    assert trajectory.coordinate("J5").max() == pytest.approx(0.5, abs=2e-3)
    assert np.abs(gauss.energy(trajectory).balance).max() < EXACT


@pytest.mark.parametrize("n", [2, 3, 5])
def test_balls_that_touch_are_struck_at_once_by_least_compulsion(n):
    """All gaps open with −e ḋ or more at the same instant: v₁ = (1 − 2/n′)…, the known outcome of Moreau's impact."""
    scene = gauss.Scene("row", gravity=(0, 0, 0))
    for i in range(n):
        x = 0.1 * i + (0.0 if i else -0.05)
        scene.body(f"b{i}", 1.0, (0.1, 0.1, 0.1), position=(x, 0, 0))
        scene.prismatic(f"S{i}", "ground", f"b{i}", axis=(1, 0, 0))
        scene.sphere(f"s{i}", f"b{i}", 0.05)
        if i:
            scene.contact(f"C{i}", f"s{i - 1}", f"s{i}", restitution=1.0)
    scene.start("S0", rate=1.0)
    trajectory = gauss.simulate(scene, 0.1, **TIGHT)
    # the first against a block of n − 1 balls: momentum and energy
    block = 2.0 / n
    assert trajectory.v[-1] == pytest.approx([1.0 - block * (n - 1), *[block] * (n - 1)], abs=EXACT)


def test_events_are_kept_on_disk(tmp_path):
    trajectory = gauss.simulate(_ball(0.0), 0.5)
    kept = np.load(gauss.save(trajectory, tmp_path / "ball.npz"))
    assert list(kept["event_kind"]) == ["impact", "closes"]
    assert list(kept["event_gaps"]) == ["bounce", "bounce"]
    assert kept["event_t"][0] == trajectory.events[0].t
    assert kept["event_loss"][0] == trajectory.events[0].loss > 0.0


def test_stops_hold_in_a_closed_loop_and_in_maximal_coordinates():
    scene = gauss.load("four_bar")
    joint = next(iter(scene.joints))
    start = gauss.compile_scene(scene).initial_state()
    scene.stop(joint, highest=float(start.q[0]) + 0.3, restitution=0.0)
    motions = {}
    for coordinates in ("tree", "maximal"):
        if coordinates == "maximal" and not all(body.principal()[0].all() for body in scene.bodies.values()):
            continue
        motions[coordinates] = gauss.simulate(gauss.compile_scene(scene, coordinates), 0.5, rtol=1e-9, atol=1e-11)
    for motion in motions.values():
        assert motion.coordinate(joint).max() <= start.q[0] + 0.3 + 1e-8
        assert np.abs(gauss.energy(motion).balance).max() < 1e-7 * gauss.energy(motion).scale


def test_a_short_visit_within_one_step_is_seen():
    """A gap t² − 2 t + 0.99 is below zero between 0.9 and 1.1 only."""

    def at(t):
        return np.array([[t * t - 2 * t + 0.99], [2 * t - 2]])

    t, which = first_hit(at, 0.0, 5.0, np.array([0]))
    assert (t, which) == (pytest.approx(0.9, abs=ROUNDING), 0)


@pytest.mark.parametrize("begin", [-4e-17, 0.0, 4e-17, 1e-12])
def test_a_gap_that_opens_from_a_width_of_rounding_closes_at_the_end_of_its_bounce(begin):
    def at(t):  # closes again after 2 ms, long before the second look at 125 ms
        rounding = 1e-16 if 0.0 < t < 1e-13 else 0.0
        return np.array([[begin - rounding + 1e-3 * t - 0.5 * t * t], [1e-3 - t]])

    t, which = first_hit(at, 0.0, 1.0, np.array([0]))
    assert which == 0 and t == pytest.approx(2e-3, abs=max(2e3 * begin, 1e-12))


def _driven_arm(**elbow):
    scene = gauss.Scene("arm", gravity=(0, 0, 0))
    for name, before, place in (("upper", "ground", 0.0), ("lower", "upper", 1.0)):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.5, 0, 0), position=(place, 0, 0))
        scene.revolute(f"to {name}", before, name, at=(place, 0, 0))
    scene.drive("to upper", speed=1.0)
    if elbow:
        scene.drive("to lower", **elbow)
    return scene


JAMS = {
    "stop": lambda s: s.stop("to upper", highest=0.5, name="end"),
    "rebounding stop": lambda s: s.stop("to upper", highest=0.5, restitution=0.5, name="end"),
    "rope": lambda s: s.rope("end", "upper", "ground", (1, 0, 0), (0.5, -0.5, 0), length=1.0),
    "gap": lambda s: s.one_sided("end", lambda at: 0.5 - at.coordinate("to upper")),
}


@pytest.mark.parametrize("elbow", [{}, {"speed": 0.0}])
@pytest.mark.parametrize("jam", JAMS)
def test_a_motion_that_is_prescribed_into_what_is_solid_is_refused_by_name(jam, elbow):
    scene = _driven_arm(**elbow)
    JAMS[jam](scene)
    with pytest.raises(SimulationError, match=r"impact at t = .* jams at 'end.*', .* closing with") as refused:
        gauss.simulate(scene, 2.0, rtol=1e-8, atol=1e-8)
    assert refused.value.trajectory.t[-1] < 1.5


@pytest.mark.parametrize(("elbow", "backend"), [({}, "auto"), ({"speed": 0.0}, "auto"), ({"speed": 0.0}, "recursion")])
@pytest.mark.parametrize("jam", JAMS)
def test_time_stepping_refuses_such_a_motion_where_it_jams(jam, elbow, backend):
    scene = _driven_arm(**elbow)
    JAMS[jam](scene)
    with pytest.raises(SimulationError, match=r"^t = .* jams at 'end.*', .* closing with") as refused:
        gauss.simulate(scene, 2.0, integrator="time_stepping", step=0.01, backend=backend)
    assert 0.4 < refused.value.trajectory.t[-1] < 1.5


def test_a_prescribed_motion_goes_on_where_another_joint_gives_way():
    scene = _driven_arm()
    scene.stop("to lower", lowest=-0.2, highest=0.2)
    motion = gauss.simulate(scene, 1.0, rtol=1e-8, atol=1e-8)
    assert motion.events[0].kind == "impact" and motion.coordinate("to upper")[-1] == pytest.approx(1.0, abs=1e-7)


MISTAKES = {
    "restitution above one": (lambda s: s.stop("S", highest=1.0, restitution=1.5), SceneError, "0 to 1, got 1.5"),
    "no stop": (lambda s: s.stop("S"), SceneError, "lowest=, highest= or both"),
    "stops the wrong way": (lambda s: s.stop("S", 1.0, -1.0), SceneError, "must be below"),
    "unknown joint": (lambda s: s.stop("T", 1.0), SceneError, "no joint 'T'"),
    "stop of a free joint": (lambda s: s.stop("A", 1.0), SceneError, "6 freedoms"),
    "two points": (
        lambda s: (
            s.points("p", "a", [(0, 0, 0)]),
            s.points("q", "b", [(0, 0, 1)]),
            s.contact("c", "p", "q"),
            gauss.compile_scene(s),
        ),
        SceneError,
        "two points never touch",
    ),
    "no points": (lambda s: s.points("p", "a", []), SceneError, "list of points"),
    "flat box": (lambda s: s.box("b", "a", (1, 0, 1)), SceneError, "three edges > 0"),
    "no radius": (lambda s: s.sphere("b", "a", 0), SceneError, "radius.*positive"),
    "no such shape": (
        lambda s: (s.sphere("ball", "a", 1), s.contact("c", "ball", "bal")),
        SceneError,
        "no shape 'bal'.*ball",
    ),
    "no such body": (lambda s: s.sphere("ball", "c", 1), SceneError, "no body or frame 'c'"),
    "one shape": (lambda s: (s.sphere("ball", "a", 1), s.contact("c", "ball", "ball")), SceneError, "name two"),
    "no rule": (
        lambda s: _touching("half-space", "half-space")(s),
        SceneError,
        "two half-spaces meet almost everywhere",
    ),
    "gap of two numbers": (
        lambda s: (s.one_sided("c", lambda at: at.position("a")), gauss.compile_scene(s)),
        SceneError,
        "one number",
    ),
    "gap of nothing": (
        lambda s: (s.one_sided("c", lambda at: at.t), gauss.compile_scene(s)),
        SceneError,
        "depends on no body",
    ),
    "name taken": (lambda s: (s.stop("S", 1.0, name="x"), s.rope("x", "a", "b", length=1)), SceneError, "'x'.*taken"),
    "no such contact": (
        lambda s: gauss.contact_forces(gauss.simulate(s, 0.01, progress=False), "flor"),
        StateError,
        "no unilateral constraint 'flor'",
    ),
    "start inside": (
        lambda s: (s.stop("S", 0.1, name="x"), gauss.simulate(s, 0.1)),
        SimulationError,
        "0.1 .*inside of 'x.lowest'",
    ),
    "fixed step": (
        lambda s: (s.stop("S", -0.1), gauss.simulate(s, 0.1, integrator="rk4", step=0.1)),
        SimulationError,
        "events",
    ),
    "inverse dynamics of what is closed": (
        lambda s: (
            s.stop("S", 0.0, name="x"),
            gauss.inverse_dynamics(system := gauss.compile_scene(s), system.initial_state(), np.zeros(13), ["S"]),
        ),
        StateError,
        "forces are unknown",
    ),
    "Baumgarte": (
        lambda s: (s.stop("S", -0.1), gauss.simulate(s, 0.1, stabilisation="baumgarte")),
        SimulationError,
        "'baumgarte'.*are projected",
    ),
    "implicit": (
        lambda s: (s.stop("S", -0.1), gauss.simulate(s, 0.1, integrator="radau5")),
        SimulationError,
        "'radau5' does not locate the events",
    ),
    "many at once": (
        lambda s: (
            s.stop("S", -0.1),
            gauss.rollout(system := gauss.compile_scene(s), [system.reference.q], np.zeros((1, 13)), steps=1, step=0.1),
        ),
        SimulationError,
        "one-sided",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make(_two())


def test_contacts_are_explained_and_refused_where_they_have_no_counterpart(tmp_path):
    scene = gauss.load("box_on_plane_8")
    assert "unilateral constraints: stand (8 gap functions)" in gauss.compile_scene(scene).explain()
    with pytest.raises(FileError, match="'feet': MuJoCo has no points"):
        gauss.save(gauss.load("box_on_plane_4"), tmp_path / "box.xml")
    comparison = gauss.crosscheck(scene)
    assert comparison.passed and "stand" in str(comparison)
