"""References and loads that act for a while after a quiet start: servos miss none of them, and refuse what jumps."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import gauss
from gauss import math, servo
from gauss.servo import Motor, Servo, ServoRelation, UnrealisableError
from tests.support import servos

TIGHT = {"rtol": 1e-10, "atol": 1e-12, "progress": False}
EXACT = 1e-8  # relative; steps are made to 1e-10
FOLLOWED = 1e-9  # [rad] of a reference, by projection; of fixed steps likewise
BEGIN, END = 5.0, 5.5  # [s] of what acts
DURATION = 8.0
MASS, FORCE = 3.0, 4.0


def hump(t):
    """Lean of 0.1 rad for half a second, three times differentiable."""
    s = math.clip((t - BEGIN) / (END - BEGIN), 0.0, 1.0)
    return 0.1 * 64.0 * (s * (1.0 - s)) ** 3


def branching(t):
    """The same with `if`."""
    s = (t - BEGIN) / (END - BEGIN)
    return 6.4 * (s * (1.0 - s)) ** 3 if BEGIN < t < END else 0.0


def wave(t):
    """Smooth, nothing for most of the time."""
    return 0.1 * np.exp(-(((t - BEGIN) / 0.15) ** 2))


def leaning(profile) -> Servo:
    return Servo(servos.cart_pendulum(), [servos.lean(profile)], [Motor("motor", "rail")])


def closed_form(profile) -> float:
    """Speed of the cart at the end, ∫ (g tan θ − l θ̈/cos θ) dt, by Gauss's quadrature on short pieces."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0.0, DURATION, 801)  # BEGIN and END are among them
    half = 0.5 * np.diff(edges)[:, None]
    t = 0.5 * (edges[:-1] + edges[1:])[:, None] + half * nodes
    if profile is wave:
        theta, second = wave(t), wave(t) * (4.0 * (t - BEGIN) ** 2 / 0.15**4 - 2.0 / 0.15**2)
    else:
        polynomial, s = 6.4 * Polynomial([0.0, 1.0, -1.0]) ** 3, (t - BEGIN) / (END - BEGIN)
        inside = (s > 0.0) & (s < 1.0)
        theta, second = inside * polynomial(s), inside * polynomial.deriv(2)(s) / (END - BEGIN) ** 2
    return float((half * weights * (servos.G * np.tan(theta) - 0.8 * second / np.cos(theta))).sum())


@pytest.mark.slow
@pytest.mark.parametrize("profile", [hump, branching, wave])
@pytest.mark.parametrize("method", ["dop853", "dopri5"])
def test_a_reference_that_moves_late_is_followed(profile, method):
    found = servo.simulate(leaning(profile), DURATION, integrator=method, **TIGHT)
    assert found.motion.rate("rail")[-1] == pytest.approx(closed_form(profile), rel=EXACT)
    assert abs(found.residual("lean")[-1]) <= FOLLOWED


@pytest.mark.slow
def test_implicit_steps_see_it_too():
    found = servo.simulate(leaning(hump), DURATION, integrator="radau5", rtol=1e-7, atol=1e-9, progress=False)
    assert found.motion.rate("rail")[-1] == pytest.approx(closed_form(hump), rel=1e-5)  # by steps to 1e-7


@pytest.mark.slow
def test_fixed_steps_end_where_a_reference_begins():
    """Steps of 0.07 s do not fall upon the start; the force of the scene jumps there, and rk4 is exact for it."""
    held = Servo(cart(lambda t: FORCE if BEGIN <= t < END else 0.0), [follow()], [Motor("motor", "y")])
    found = servo.simulate(held, DURATION, integrator="rk4", step=0.07, progress=False)
    assert found.motion.rate("x")[-1] == pytest.approx(FORCE * (END - BEGIN) / MASS, rel=EXACT)


def cart(force) -> gauss.Scene:
    """Two sledges at right angles, one pushed, one led by a servo."""
    scene = gauss.Scene("sledges", gravity=(0, 0, 0))
    for name, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
        scene.body(name, MASS)
        scene.prismatic(name, "ground", name, axis=axis)
    scene.drive("x", force=force)
    return scene


def follow(profile=lambda t: 0.0 * t) -> ServoRelation:
    return ServoRelation("led", lambda t, motion: motion.coordinate("y") - profile(t))


LOADS = {
    "if": lambda t: FORCE if BEGIN <= t < END else 0.0,
    "where": lambda t: math.where(t >= BEGIN, math.where(t < END, FORCE, 0.0), 0.0),
    "short": lambda t: 1000.0 * FORCE * (END - BEGIN) if BEGIN <= t < BEGIN + 1e-3 else 0.0,
}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dop853", "dopri5", "radau5"])
@pytest.mark.parametrize("load", LOADS)
def test_loads_of_the_scene_are_not_stepped_over(load, method):
    held = Servo(cart(LOADS[load]), [follow()], [Motor("motor", "y")])
    found = servo.simulate(held, DURATION, integrator=method, **TIGHT)
    assert found.motion.rate("x")[-1] == pytest.approx(FORCE * (END - BEGIN) / MASS, rel=EXACT)


@pytest.mark.slow
def test_a_load_between_two_places_is_not_stepped_over():
    """Energy gained in a passage of 1 cm: force times way."""
    scene = cart(
        lambda t, motion: math.where(motion.coordinate("x") > 9.0, math.where(motion.coordinate("x") < 9.01, 50.0, 0.0), 0.0)
    )
    scene.start("x", rate=2.0)
    found = servo.simulate(Servo(scene, [follow()], [Motor("motor", "y")]), DURATION, **TIGHT)
    assert found.motion.rate("x")[-1] == pytest.approx(np.sqrt(4.0 + 2.0 * 50.0 * 0.01 / MASS), rel=EXACT)


@pytest.mark.slow
def test_breaks_tell_of_a_load_that_cannot_be_traced():
    """A pulse of a tenth of a millisecond lies between all samples of an opaque law; with breaks= it acts."""
    law = lambda t: 1e4 * FORCE if BEGIN <= float(t) < BEGIN + 1e-4 else 0.0  # noqa: E731
    held = Servo(cart(law), [follow()], [Motor("motor", "y")])
    found = servo.simulate(held, DURATION, breaks=[BEGIN, BEGIN + 1e-4], **TIGHT)
    assert found.motion.rate("x")[-1] == pytest.approx(FORCE / MASS, rel=EXACT)


JUMPS = {
    "position": lambda t: 0.1 if t > BEGIN else 0.0,
    "small position": lambda t: 1e-6 if t > BEGIN else 0.0,
    "speed": lambda t: 0.1 * math.maximum(t - BEGIN, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"integrator": "rk4", "step": 0.07}])
@pytest.mark.parametrize("jump", JUMPS)
def test_a_reference_that_jumps_is_refused_by_name_and_time(jump, options):
    held = Servo(cart(0.0), [follow(JUMPS[jump])], [Motor("motor", "y")])
    with pytest.raises(UnrealisableError, match="t = 5 s.*'led'") as caught:
        servo.simulate(held, DURATION, progress=False, **options)
    assert caught.value.trajectory.t[-1] == pytest.approx(BEGIN, abs=1e-9)


def test_a_reference_of_speed_that_jumps_is_refused():
    relation = ServoRelation("speed", lambda t, motion: motion.rate("y") - (1.0 if t > BEGIN else 0.0), level="velocity")
    with pytest.raises(UnrealisableError, match="t = 5 s.*'speed'"):
        servo.simulate(Servo(cart(0.0), [relation], [Motor("motor", "y")]), DURATION, progress=False)


@pytest.mark.slow
def test_a_reference_of_accelerations_may_jump():
    relation = ServoRelation(
        "push", lambda t, motion: motion.joint_acceleration("y") - (2.0 if BEGIN < t < END else 0.0), level="acceleration"
    )
    found = servo.simulate(Servo(cart(0.0), [relation], [Motor("motor", "y")]), DURATION, **TIGHT)
    assert found.motion.rate("y")[-1] == pytest.approx(2.0 * (END - BEGIN), rel=EXACT)


@pytest.mark.slow
def test_a_reference_that_jumps_with_the_motion_is_refused():
    """A relation that depends on where another body is, and jumps when it gets there at 4.5 s."""
    scene = cart(0.0)
    scene.start("x", rate=2.0)
    relation = ServoRelation(
        "led", lambda t, motion: motion.coordinate("y") - math.where(motion.coordinate("x") > 9.0, 0.5, 0.0)
    )
    with pytest.raises(UnrealisableError, match="t = 4.5.*'led'"):
        servo.simulate(Servo(scene, [relation], [Motor("motor", "y")]), DURATION, progress=False)
