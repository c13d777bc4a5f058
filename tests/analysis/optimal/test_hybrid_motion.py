"""Optimal motions of several phases against closed forms, and against event-driven simulations of their inputs."""

import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, SimulationError, StateError

pytest.importorskip("casadi")
G = 9.81
EXACT = 1e-7  # relative: what IPOPT leaves, where the mesh holds the optimum exactly
SAME = 1e-6  # default tolerance of the mesh, of motions through events located by other code


def ball(restitution=0.5):
    """Mass of 1 kg above a floor."""
    scene = gauss.Scene("ball")
    scene.prismatic("lift", "ground", scene.body("ball", 1.0, (0.1, 0.1, 0.1)), axis=(0, 0, 1))
    scene.stop("lift", lowest=0.0, restitution=restitution, name="floor")
    scene.input("push", "lift", limits=100.0)
    return scene


def test_a_ball_falls_and_bounces_without_effort():
    height, e = 1.0, 0.5
    fall, rise = gauss.MotionPhase((0.1, 2.0)), gauss.MotionPhase((0.1, 2.0), struck="floor", end={"lift rate": 0.0})
    found = gauss.optimal_hybrid_motion(ball(e), [fall, rise], start={"lift": height, "lift rate": 0.0})
    time = np.sqrt(2.0 * height / G)
    assert [one.duration for one in found.phases] == pytest.approx([time, e * time], rel=EXACT)
    assert found.q[-1, 0] == pytest.approx(e**2 * height, rel=EXACT)
    assert found.cost <= EXACT


def test_a_period_of_bounces_takes_the_least_impulse():
    """A ball of e < 1 that keeps bouncing in a period T: the floor gives (1 + e) v, ∫ u dt = g T − (1 + e) v.

    With ∫ u² least, u = a + b t; the conditions of the period and of T leave a convex problem in the speed v at the impact,
    whose minimum is found here by hand: ballistic but for the part of the speed that the impact takes.
    """
    T, e = 1.0, 0.5
    flight = gauss.MotionPhase(T, struck="floor")
    found = gauss.optimal_hybrid_motion(ball(e), [flight], start={"lift": 0.0}, periodic=True)
    # x(0) = x(T) = 0, v(T) = −w, v(0) = e w; u = a + b t: two conditions for given w, and ∫ u² over w is a parabola
    rows = np.array([[T, T**2 / 2.0], [T**2 / 2.0, T**3 / 6.0]])
    law = lambda w: np.linalg.solve(rows, [G * T - (1.0 + e) * w, G * T**2 / 2.0 - e * w * T])  # noqa: E731
    cost = lambda w: (lambda a, b: a * a * T + a * b * T**2 + b * b * T**3 / 3.0)(*law(w))  # noqa: E731
    parabola = np.polyfit([1.0, 3.0, 5.0], [cost(1.0), cost(3.0), cost(5.0)], 2)
    w = -parabola[1] / (2.0 * parabola[0])
    assert found.v[-1, 0] == pytest.approx(-w, rel=EXACT)
    assert found.cost == pytest.approx(cost(w), rel=EXACT, abs=EXACT)


@pytest.mark.slow
def test_a_mass_leaves_a_stop_when_it_pays():
    """From rest on a stop to rest at a height h, in a free time: u = 2 g (1 − t / T) over T² = 6 h / g after it leaves."""
    height = 0.5
    phases = [gauss.MotionPhase(1.0, closed="floor"), gauss.MotionPhase((0.1, 1.0), end={"lift": height, "lift rate": 0.0})]
    found = gauss.optimal_hybrid_motion(ball(), phases, start={})
    time = np.sqrt(6.0 * height / G)
    assert found.phases[1].duration == pytest.approx(time, rel=EXACT)
    assert found.cost == pytest.approx(4.0 * G**2 * time / 3.0, rel=EXACT)
    assert found.law(1.0 + time / 2.0) == pytest.approx(G, rel=EXACT)
    assert np.abs(found.phases[0].q).max() <= EXACT


def test_stops_limit_a_motion():
    """A fast fall, caught above the floor: without the stop the mass of least effort goes below."""
    start, end = {"lift": 0.3, "lift rate": -3.0}, {"lift": 0.3, "lift rate": 0.0}
    free = ball()
    free.contacts.clear()
    below, above = (gauss.optimal_motion(scene, 1.0, start=start, end=end) for scene in (free, ball()))
    assert below.q.min() < -0.05
    assert above.q.min() >= -EXACT
    assert above.cost > below.cost


SPOKES, LENGTH, SLOPE, MASS, INERTIA = 8, 1.0, np.deg2rad(8.0), 2.0, 0.3


def rimless():
    """Wheel of spokes without a rim, free in a plane, on a rough slope; x points downhill."""
    scene = gauss.Scene("rimless wheel", gravity=(G * np.sin(SLOPE), 0.0, -G * np.cos(SLOPE)))
    hub = scene.body("hub", MASS, (INERTIA,) * 3, position=(0.0, 0.0, LENGTH))
    slide = scene.body("slide", 0.0, (0.0,) * 3)
    lift = scene.body("lift", 0.0, (0.0,) * 3)
    scene.prismatic("x", "ground", slide, axis=(1, 0, 0))
    scene.prismatic("z", slide, lift, axis=(0, 0, 1))
    scene.revolute("turn", lift, hub, axis=(0, 1, 0), at=(0.0, 0.0, LENGTH))
    scene.half_space("slope")
    for k in range(SPOKES):
        angle = 2.0 * np.pi * k / SPOKES
        tip = (LENGTH * np.sin(angle), 0.0, -LENGTH * np.cos(angle))
        scene.points(f"tip {k}", hub, [tip])
        scene.contact(f"foot {k}", f"tip {k}", "slope", friction=1.0)
    scene.input("motor", "turn", limits=50.0)
    return scene


def steady_speed(half):
    """Speed after each impact of a wheel that rolls steadily (McGeer, Int. J. Robotics Research 9(2), 1990)."""
    about = MASS * LENGTH**2 + INERTIA
    keeps = (MASS * LENGTH**2 * np.cos(2.0 * half) + INERTIA) / about  # of the speed, by an impact
    gained = 4.0 * MASS * G * LENGTH * np.sin(half) * np.sin(SLOPE) / about  # of its square, by a step
    return keeps * np.sqrt(gained / (1.0 - keeps**2))


@pytest.mark.slow
def test_a_wheel_of_spokes_rolls_from_contact_to_contact():
    half, steps = np.pi / SPOKES, 3
    speed = steady_speed(half)
    phases = [gauss.MotionPhase((0.1, 2.0), closed=f"foot {k}", end={"turn": (2 * k + 1) * half}) for k in range(steps)]
    start = {"x": 0.0, "turn": -half, "turn rate": speed}
    found = gauss.optimal_hybrid_motion(rimless(), phases, start=start, intervals=5)
    assert found.cost <= EXACT
    assert [one.v[0, 2] for one in found.phases] == pytest.approx([speed] * steps, rel=SAME)
    pace = 2.0 * LENGTH * np.sin(half)
    tips = [one.q[:, 0] - LENGTH * np.sin(one.q[:, 2] - 2.0 * k * half) for k, one in enumerate(found.phases)]
    assert [np.ptp(tip) for tip in tips] == pytest.approx([0.0] * steps, abs=SAME)  # feet stick
    assert np.diff([tip[0] for tip in tips]) == pytest.approx([pace] * (steps - 1), rel=SAME)


@pytest.mark.slow
def test_a_speed_between_limits_at_a_contact():
    """Of the speeds at the start that one is found from which the second spoke stands upright at the speed asked for."""
    half, asked = np.pi / SPOKES, 1.2
    about = MASS * LENGTH**2 + INERTIA
    gain = 2.0 * MASS * G * LENGTH / about  # of the square of the speed, by the height that is lost
    keeps = (MASS * LENGTH**2 * np.cos(2.0 * half) + INERTIA) / about
    after = np.sqrt(asked**2 + gain * (np.cos(SLOPE) - np.cos(half - SLOPE)))
    first = np.sqrt((after / keeps) ** 2 - gain * (np.cos(half - SLOPE) - np.cos(half + SLOPE)))
    second = gauss.MotionPhase((0.1, 2.0), closed="foot 1", end={"turn": 2.0 * half})
    found = gauss.optimal_hybrid_motion(
        rimless(),
        [gauss.MotionPhase((0.1, 2.0), closed="foot 0"), second],
        start={"x": 0.0, "turn": -half, "turn rate": (1.0, 5.0)},
        meets=lambda q, v: v[2] - asked,
        intervals=5,
    )
    assert found.v[0, 2] == pytest.approx(first, rel=SAME)
    assert found.cost <= EXACT


def hopper():
    """Body of 2 kg on a foot of 0.5 kg, with a spring and a motor between them."""
    scene = gauss.Scene("hopper")
    foot = scene.body("foot", 0.5, (0.01,) * 3)
    body = scene.body("body", 2.0, (0.01,) * 3)
    scene.prismatic("foot height", "ground", foot, axis=(0, 0, 1))
    scene.prismatic("leg", foot, body, axis=(0, 0, 1))
    scene.joint_spring("coil", "leg", stiffness=400.0, rest=0.5)
    scene.stop("foot height", lowest=0.0, name="floor")
    scene.input("motor", "leg", limits=200.0)
    scene.start("leg", 0.45)
    return scene


@pytest.mark.slow
def test_a_hopper_repeats_its_hop():
    """Its period, foot on the floor and in the air, is that of the event-driven simulation of its inputs.

    In the air the common centre of mass falls freely; the impact stops the foot, and leaves the speed of the body.
    """
    system = gauss.compile_scene(hopper())
    stance, flight = gauss.MotionPhase((0.1, 0.5), closed="floor"), gauss.MotionPhase(0.3)
    limits = {"leg": (0.2, 0.8), "foot height": (-1.0, 1.0)}
    found = gauss.optimal_hybrid_motion(system, [stance, flight], start={}, periodic=True, limits=limits, tolerance=1e-8)
    moved = found.simulate(rtol=1e-10, atol=1e-10)
    assert moved.q[-1] == pytest.approx(found.q[0], abs=SAME)
    air = found.phases[1]
    height, speed = ((2.5 * x[:, 0] + 2.0 * x[:, 1]) / 2.5 for x in (air.q, air.v))
    assert height[-1] - height[0] == pytest.approx(speed[0] * 0.3 - G * 0.3**2 / 2.0, abs=SAME)
    assert found.v[0] == pytest.approx([0.0, found.v[-1].sum()], abs=EXACT)


@pytest.mark.slow
def test_a_rocker_is_pressed_onto_a_stop():
    """A four-bar runs against a stop and rests there: its motion is the event-driven simulation of its inputs."""
    scene = gauss.load("four_bar")
    scene.starts.clear()
    scene.input("motor", "A")
    scene.stop("D", lowest=-0.1, name="buffer")
    run, rest = gauss.MotionPhase((0.1, 1.0)), gauss.MotionPhase(0.3, closed="buffer")
    found = gauss.optimal_hybrid_motion(scene, [run, rest], start={"A": 0.0, "A rate": 4.0}, tolerance=1e-8)
    moved = found.simulate(rtol=1e-10, atol=1e-10)
    assert moved.events[0].t == pytest.approx(found.phases[0].duration, abs=SAME)
    assert moved.events[0].loss > 0.1
    assert moved.q[-1] == pytest.approx(found.q[-1], abs=SAME)
    assert found.q[-1, 3] == pytest.approx(-0.1, abs=SAME)
    assert np.abs(found.phases[1].v).max() <= SAME


@pytest.mark.slow
def test_a_knee_locks_at_its_stop():
    """A swinging leg extends until its knee locks: the impact of two coupled joints is that of the simulation."""
    scene = gauss.Scene("leg")
    thigh = scene.body("thigh", 2.0, (0.02,) * 3, com=(0.0, 0.0, -0.2))
    shank = scene.body("shank", 1.0, (0.01,) * 3, position=(0.0, 0.0, -0.4), com=(0.0, 0.0, -0.2))
    scene.revolute("hip", "ground", thigh, axis=(0, 1, 0))
    scene.revolute("knee", thigh, shank, at=(0.0, 0.0, -0.4), axis=(0, 1, 0))
    scene.stop("knee", lowest=0.0, name="cap")
    scene.input("muscle", "hip", limits=50.0)
    start = {"hip": -0.3, "knee": 0.5, "hip rate": 0.0, "knee rate": 0.0}
    bent, straight = gauss.MotionPhase((0.1, 1.0)), gauss.MotionPhase(0.15, closed="cap", end={"hip": -0.5})
    found = gauss.optimal_hybrid_motion(scene, [bent, straight], start=start, tolerance=1e-8)
    moved = found.simulate(rtol=1e-10, atol=1e-10)
    assert [event.gaps for event in moved.events][:1] == [("cap.lowest",)]
    assert moved.events[0].t == pytest.approx(found.phases[0].duration, abs=SAME)
    assert moved.q[-1] == pytest.approx(found.q[-1], abs=SAME)


PHASE = gauss.MotionPhase((0.1, 1.0))
REFUSED = {  # what is refused, and words of the message
    "no phases": (lambda: gauss.optimal_hybrid_motion(ball(), []), ArgumentError, "gauss.MotionPhase"),
    "other phases": (lambda: gauss.optimal_hybrid_motion(ball(), [1.0]), ArgumentError, "gauss.MotionPhase"),
    "name": (
        lambda: gauss.optimal_hybrid_motion(ball(), [gauss.MotionPhase(1.0, closed="flor")]),
        ArgumentError,
        "'flor'.*floor",
    ),
    "nothing before": (
        lambda: gauss.optimal_hybrid_motion(ball(), [gauss.MotionPhase(1.0, struck="floor")]),
        ArgumentError,
        "floor.lowest.*a phase before",
    ),
    "duration": (lambda: gauss.optimal_hybrid_motion(ball(), [gauss.MotionPhase(-1.0)]), ArgumentError, "duration"),
    "unreachable": (
        lambda: gauss.optimal_hybrid_motion(
            ball(), [PHASE, gauss.MotionPhase(0.3, closed="floor", end={"lift": 0.5})], start={"lift": 1.0}
        ),
        StateError,
        "no state with these coordinates: lift",
    ),
    "too fast": (
        lambda: gauss.optimal_hybrid_motion(
            ball(), [gauss.MotionPhase(0.05), gauss.MotionPhase(0.1, closed="floor")], start={"lift": 1.0, "lift rate": 0.0}
        ),
        SimulationError,
        "phase 1: at the end: 'gap of floor.lowest' misses",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_by_name(what):
    call, error, words = REFUSED[what]
    with pytest.raises(error, match=words):
        call()
