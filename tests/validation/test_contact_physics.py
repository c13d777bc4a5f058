"""Motions with contacts against closed forms: blocks that rock, stand, turn and topple, rimless wheel, top, row of balls."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gauss
from benchmarks.free_bodies import EDGE, dominoes, free_body, stack

pytestmark = pytest.mark.slow

G = 9.81
FIRST_ORDER = 3.0  # of errors over steps, relative: time stepping is of first order at impacts
DRIFT = 1e-9  # [m] of a stack in ten seconds
ON_TABLE = 2e-3  # [m]: two steps at the speed of the table
PRECESSION = 1e-6  # of an axis, by tolerances of 1e-9
ORDER = 0.1  # of an order of convergence, found from two steps
WAVE = 0.03  # of the time from one domino to the next: it is constant, and does not depend on the step
ROUNDING = 1e-9  # relative, of motions whose contacts do not change


def moved(scene, duration: float, step: float):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=step, progress=False)


def test_a_stack_of_ten_boxes_stays_for_ten_seconds():
    scene = stack(10)
    q = moved(scene, 10.0, 1e-2).q[-1].reshape(-1, 7)
    expected = np.array([(0.0, 0.0, EDGE * (k + 0.5)) for k in range(10)])
    assert np.abs(q[:, :3] - expected).max() < DRIFT


@pytest.mark.parametrize("step", [1e-3, 2.5e-4])
def test_a_block_rocks_as_housner_says(step):
    """θ'' = −p² sin(α − θ), p² = 3 g / 4 R; rates fall by 1 − 3/2 sin²α at each impact (Housner, BSSA 53, 1963)."""
    width, height, tilt = 0.2, 0.6, 0.1
    R, alpha = 0.5 * np.hypot(width, height), np.arctan2(width, height)
    p2 = 0.75 * G / R
    upright = solve_ivp(
        lambda t, y: (y[1], -p2 * np.sin(alpha - y[0])), (0, 5), (tilt, 0.0), rtol=1e-10, atol=1e-12, events=crossing()
    )
    hit, rate = upright.t_events[0][0], -upright.y_events[0][0][1] * (1.0 - 1.5 * np.sin(alpha) ** 2)
    swing = solve_ivp(
        lambda t, y: (y[1], -p2 * np.sin(alpha - y[0])), (0, 5), (0.0, rate), rtol=1e-10, atol=1e-12, events=crossing(1)
    )
    scene = gauss.Scene("rocking block", gravity=(0, -G, 0))
    scene.body("block", mass=1.0, inertia=(1, 1, (width**2 + height**2) / 12))
    scene.planar("floats", "ground", "block")
    turned = np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    centre = turned @ (-0.5 * width, 0.5 * height)  # turned about the lower right corner, at the origin
    scene.start("floats", position=(*centre, -tilt))
    feet = [(x, y, 0) for x in (-0.5 * width, 0.5 * width) for y in (-0.5 * height,)]
    scene.points("feet", "block", feet)
    scene.half_space("floor", normal=(0, 1, 0))
    scene.contact("rock", "feet", "floor", friction=1.0)
    motion = moved(scene, hit + swing.t_events[0][0], step)
    angle = motion.q[:, 2]
    crossed = motion.t[int(np.argmax(angle > -1e-9))]
    assert crossed == pytest.approx(hit, abs=FIRST_ORDER * step)
    assert angle.max() == pytest.approx(swing.y_events[0][0][0], rel=FIRST_ORDER * step / hit * 2)


def crossing(which: int = 0):
    """End of a swing: the first entry of the state, or its rate, becomes zero from above."""

    def event(t, y):
        return y[which]

    event.terminal, event.direction = True, -1
    return event


def test_a_rimless_wheel_reaches_its_steady_gait():
    """ω² = 4 g/l sin α sin γ / (1 − cos² 2α) before each impact (McGeer, Int. J. Robot. Res. 9, 1990)."""
    spokes, length, slope, step = 8, 1.0, 0.25, 1e-3
    alpha = np.pi / spokes
    expected = np.sqrt(4 * G / length * np.sin(alpha) * np.sin(slope) / (1 - np.cos(2 * alpha) ** 2))
    scene = gauss.Scene("rimless wheel", gravity=(G * np.sin(slope), -G * np.cos(slope), 0))
    scene.body("wheel", mass=1.0, inertia=(1e-6, 1e-6, 1e-6))
    scene.planar("rolls", "ground", "wheel")
    speed = np.array([length * np.cos(alpha), -length * np.sin(alpha), -1.0]) * expected  # after an impact, on a new spoke
    scene.start("rolls", position=(0, length * np.cos(alpha), 0), rate=tuple(speed * np.cos(2 * alpha)))
    angles = alpha + 2 * alpha * np.arange(spokes) - np.pi / 2
    scene.points("feet", "wheel", [(length * np.cos(a), length * np.sin(a), 0) for a in angles])
    scene.half_space("floor", normal=(0, 1, 0))
    scene.contact("step", "feet", "floor", friction=10.0)
    motion = moved(scene, 6.0, step)
    rates = -motion.v[motion.t > 4.0, 2]
    assert rates.max() == pytest.approx(expected, rel=10 * step)
    assert rates.min() < rates.max() * np.cos(2 * alpha) * (1 + 10 * step) + 0.5 * expected


def tops(count: int, with_lever: bool) -> tuple[gauss.Scene, float, float]:
    """Tops that precess steadily on a smooth table, beside a pendulum or alone; tilt and rate of the precession.

    C n Ω − A Ω² cos θ = m g l, about the centre of mass, which stays (Routh, Advanced Rigid Dynamics, 1905).
    """
    A, C, arm, tip, tilt, precession = 2e-3, 1e-3, 0.06, 0.01, 0.4, 3.0
    spin = (G * arm + A * precession**2 * np.cos(tilt)) / (C * precession)  # along the axis, in total
    scene = gauss.Scene("tops")
    scene.half_space("table")
    turn = (np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0)  # about x: the axis leans towards −y
    rate = (0.0, precession * np.sin(tilt), spin)  # Ω ẑ in the axes of the body: (0, sin θ, cos θ)
    for k in range(count):
        scene.body(f"top {k}", mass=1.0, inertia=(A, A, C))
        scene.free(f"floats {k}", "ground", f"top {k}")
        scene.start(f"floats {k}", position=(k, 0, tip + arm * np.cos(tilt), *turn), rate=(0, 0, 0, *rate))
        scene.sphere(f"tip {k}", f"top {k}", tip, at=(0, 0, -arm))
    if with_lever:
        scene.body("lever", mass=1.0, inertia=(1, 1, 1))
        scene.revolute("hinge", "ground", "lever", axis=(0, 1, 0))
    scene.contacts_all()
    return scene, tilt, precession


def error_of_top(scene: gauss.Scene, tilt: float, precession: float, **settings) -> tuple[float, gauss.Trajectory]:
    """Error of the axis of the first top after half a second."""
    duration = 0.5
    motion = gauss.simulate(scene, duration, progress=False, **settings)
    q, angle = motion.q[-1], precession * duration
    axis = gauss.rotations.from_quaternion(q[3:7])[:, 2]
    expected = np.array([np.sin(tilt) * np.sin(angle), -np.sin(tilt) * np.cos(angle), np.cos(tilt)])
    assert np.abs(q[:2]).max() < 1e-9
    return float(np.abs(axis - expected).max()), motion


def test_a_top_on_a_smooth_plane_precesses_steadily():
    error, _ = error_of_top(*tops(1, False), rtol=1e-9, atol=1e-9)
    assert error < PRECESSION


@pytest.mark.parametrize(
    ("count", "with_lever", "dynamics", "error"),
    [(1, False, "compiled", 1.5e-3), (3, False, "pair kernels", 1.5e-3), (3, True, "pair kernels", 1.5e-3)],
)
def test_time_stepping_of_a_top_is_of_second_order(count, with_lever, dynamics, error):
    """Rate-dependent forces, here gyroscopic torques, know the contact forces to second order."""
    errors = []
    for step in (1e-3, 5e-4):
        found, motion = error_of_top(*tops(count, with_lever), integrator="time_stepping", step=step)
        assert motion.stats.plan.dynamics == dynamics
        errors.append(found)
    assert errors[0] < error
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=ORDER)


@pytest.mark.parametrize(("share", "stays"), [(0.98, True), (1.02, False)])
def test_a_box_on_a_turntable_slides_beyond_its_limit(share, stays):
    """It turns with the table up to Ω² r = μ g."""
    friction, place, edge = 0.4, 0.5, 0.05
    speed = share * np.sqrt(friction * G / place)
    scene = gauss.Scene("turntable")
    scene.body("table", mass=1.0, inertia=(1, 1, 1))
    scene.revolute("spindle", "ground", "table", axis=(0, 0, 1))
    scene.drive("spindle", speed=speed)
    scene.box("top", "table", (3, 3, 0.1), at=(0, 0, -0.05))
    free_body(scene, "A", edge**2 / 6, (place, 0, edge / 2), rate=(0, speed * place, 0, 0, 0, speed))
    scene.box("cargo", "A", (edge,) * 3)
    scene.contacts_all(friction=friction)
    motion = moved(scene, 0.5, 1e-3)
    away = np.hypot(*motion.q[-1][-7:-5]) - place
    assert (abs(away) < ON_TABLE) == stays
    assert away > -ON_TABLE


@pytest.mark.parametrize("e", [1.0, 0.8, 0.5])
def test_a_row_of_balls_passes_on_its_speed_with_restitution(e):
    """v ((1 + e)/2)ⁿ⁻¹ of the last of n equal balls that are apart."""
    n, radius, gap = 5, 0.05, 0.02
    scene = gauss.Scene("row of balls", gravity=(0, 0, 0))
    for k in range(n):
        free_body(scene, f"ball {k}", 0.4 * radius**2, (k * (2 * radius + gap), 0, 0), rate=(float(k == 0), 0, 0, 0, 0, 0))
        scene.sphere(f"sphere {k}", f"ball {k}", radius)
    scene.contacts_all(restitution=e)
    final = moved(scene, 0.4, 1e-3).v[-1].reshape(n, 6)[-1, 0]
    assert final == pytest.approx((0.5 * (1 + e)) ** (n - 1), rel=ROUNDING)


def test_dominoes_topple_one_after_the_other_at_a_constant_speed():
    """The wave forgets how it began (Stronge, Proc. R. Soc. Lond. A 409, 1987); all of them lie on each other at the end."""
    tilt, paces = np.cos(0.05), []
    for step in (1e-3, 5e-4):
        motion = moved(dominoes(14, push=3.0), 1.2, step)
        q = motion.q.reshape(len(motion.t), -1, 7)
        upright = 1.0 - 2.0 * (q[..., 4] ** 2 + q[..., 5] ** 2)
        hit = np.array([np.interp(-tilt, -height, motion.t) for height in np.minimum.accumulate(upright).T])
        pace = np.diff(hit)[8:]
        assert pace == pytest.approx(np.full(pace.size, pace.mean()), rel=WAVE)
        assert upright[-1].max() < 0.5
        paces.append(pace.mean())
    assert paces[0] == pytest.approx(paces[1], rel=WAVE)
