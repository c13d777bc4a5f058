"""Unilateral constraints along motions: events, impacts and releases against closed forms and a second integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gauss

pytestmark = pytest.mark.slow

g = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
ROUNDING = 1e-12
EXACT = 1e-9  # a motion at rtol 1e-10 over a second or two against its closed form
RELEASE = (
    1e-6  # [s]: a gap opens when it does so with 1e-7 of the accelerations, see LEAVING; what follows is off by its cube
)
QP_BACKENDS = ("daqp", "quadprog", "clarabel", "piqp", "proxqp", "osqp")
QP_TOLERANCE = 1e-7  # of backends asked for 1e-9


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


@pytest.mark.peer
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
