"""Time stepping with error control: closed forms, located events, another method, late forces, refusals."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import dominoes
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.gap_laws import removal_time
from gauss.errors import SimulationError
from gauss.system import State

g = 9.81
WITHIN = 1.0  # of rtol: global error over the size of the motion; extrapolation leaves a margin of about ten
CLAIM = 0.1  # least share of the true error that verify claims
AT_REST = 1e-12  # m/s
MORE = 1.2  # of the steps that the order of the method lets expect
GROWN = 10.0  # of rtol: errors of steps with closed gaps, which are not extrapolated, add up, and impacts amplify them
BY_EVENTS = 1e-10  # rtol of the event-driven motion that is compared with


def _bouncing(e: float = 0.7) -> gauss.Scene:
    scene = gauss.Scene("bouncing", gravity=(0.0, 0.0, -g))
    scene.body("ball", 1.0, (0.01, 0.01, 0.01))
    scene.prismatic("height", "ground", "ball", axis=(0.0, 0.0, 1.0))
    scene.stop("height", 0.0, restitution=e)
    scene.start("height", 1.0)
    return scene


def _height(t: float, e: float = 0.7) -> float:
    fall, speed = np.sqrt(2.0 / g), np.sqrt(2.0 * g)
    if t < fall:
        return 1.0 - g * t * t / 2.0
    t = t - fall
    while True:
        speed *= e
        if t < 2.0 * speed / g:
            return speed * t - g * t * t / 2.0
        t -= 2.0 * speed / g


MU, RADIUS, SPEED = 0.2, 0.1, 2.0


def _sliding(balls: int) -> gauss.Scene:
    """Balls that slide, then roll; many of them move by kernels of pairs of shapes."""
    scene = gauss.Scene("sliding", gravity=(0.0, 0.0, -g))
    scene.half_space("floor")
    for k in range(balls):
        scene.body(f"ball{k}", 1.0, (0.4 * RADIUS**2,) * 3)
        scene.free(f"free{k}", "ground", f"ball{k}")
        scene.sphere(f"round{k}", f"ball{k}", radius=RADIUS)
        scene.contact(f"C{k}", f"round{k}", "floor", friction=MU)
        scene.start(f"free{k}", position=(0.0, 5.0 * k, RADIUS, 1.0, 0.0, 0.0, 0.0), rate=(SPEED, 0, 0, 0, 0, 0))
    return scene


ROLLS = 2.0 * SPEED / (7.0 * MU * g)  # s: from then on the ball rolls with 5/7 of its speed


def _way(t: float) -> float:
    slid = min(t, ROLLS)
    return SPEED * slid - MU * g * slid**2 / 2.0 + 5.0 / 7.0 * SPEED * max(t - ROLLS, 0.0)


MOTIONS = {  # scene, coordinate of interest, its closed form, duration [s]
    "bouncing": (_bouncing, 0, _height, 2.0),
    "one sliding ball": (lambda: _sliding(1), 0, _way, 1.0),
    "many sliding balls": (lambda: _sliding(9), 0, _way, 1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
@pytest.mark.parametrize("name", MOTIONS)
def test_the_tolerance_is_honoured(name, rtol):
    make, index, exact, duration = MOTIONS[name]
    times = np.linspace(0.0, duration, 23)
    motion = gauss.simulate(make(), duration, integrator="time_stepping", rtol=rtol, times=times)
    expected = np.array([exact(t) for t in times])
    assert np.abs(motion.q[:, index] - expected).max() <= WITHIN * rtol * max(1.0, np.abs(expected).max())
    whole = gauss.simulate(make(), duration, integrator="time_stepping", rtol=rtol)
    expected = np.array([exact(t) for t in whole.t])
    assert np.abs(whole.q[:, index] - expected).max() <= WITHIN * rtol * max(1.0, np.abs(expected).max())
    assert whole.stats.steps == len(whole) - 1


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_impacts_are_events_at_their_times(rtol):
    motion = gauss.simulate(_bouncing(), 1.6, integrator="time_stepping", rtol=rtol)
    found = [event.t for event in motion.events if event.kind == "impact"]
    fall, e = np.sqrt(2.0 / g), 0.7
    expected = fall + np.cumsum([0.0, *(2.0 * fall * e**k for k in (1, 2))])
    assert found[:3] == pytest.approx(expected, abs=WITHIN * rtol)
    lost = [event.loss for event in motion.events if event.kind == "impact"]
    assert lost[0] == pytest.approx((1.0 - e**2) * g, rel=10.0 * rtol)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("model", ["double_pendulum_stops", "slack_rope", "newtons_cradle", "box_on_plane_4"])
def test_motions_agree_with_located_events(model, rtol):
    """A box that tilts over its edge penetrates a little and lifts off."""
    system, times = gauss.compile_scene(gauss.load(model)), np.array([0.25, 0.5])
    exact = gauss.simulate(system, 0.5, rtol=BY_EVENTS, times=times)
    motion = gauss.simulate(system, 0.5, integrator="time_stepping", rtol=rtol, times=times)
    assert np.abs(motion.q - exact.q).max() <= GROWN * rtol


@pytest.mark.slow
def test_steps_over_a_curved_closed_gap_are_of_order_two():
    """A box that tilts over its edge: half as long as the tolerance is a quarter; of order one, a quarter as long."""
    system = gauss.compile_scene(gauss.load("box_on_plane_4"))
    first, second = (
        gauss.simulate(system, 0.29, integrator="time_stepping", rtol=rtol).stats.steps for rtol in (4e-6, 1e-6)
    )
    assert second <= 2.0 * MORE * first


SHARP, SLOPE = 5.539142664005297, 8.096542382263944  # m/s²: gravity along and across the incline of the model
STOPS = 3.0 / (SHARP + 0.5 * SLOPE)  # s


def _oscillator(t: float) -> float:
    """Half a swing about 0.02 m, then one about −0.02 m."""
    return 0.02 + 0.19 * np.cos(10.0 * t) if t < 0.1 * np.pi else -0.02 - 0.15 * np.cos(10.0 * t - np.pi)


def _block(t: float) -> float:
    if t < STOPS:
        return -3.0 * t + (SHARP + 0.5 * SLOPE) * t**2 / 2.0
    return -1.5 * STOPS + (SHARP - 0.5 * SLOPE) * (t - STOPS) ** 2 / 2.0


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize(("model", "exact"), [("friction_oscillator", _oscillator), ("block_on_incline", _block)])
def test_sliding_that_turns_back_within_a_step_is_located(model, exact, rtol):
    """Whole step and halves agree on the friction after it, and on its absence where it holds until the end of the step."""
    times = np.linspace(0.0, 0.5, 11)
    motion = gauss.simulate(gauss.load(model), 0.5, integrator="time_stepping", rtol=rtol, times=times)
    assert np.abs(motion.q[:, 0] - [exact(t) for t in times]).max() <= WITHIN * rtol


@pytest.mark.slow
def test_a_domino_that_falls_back_lands_as_with_short_fixed_steps():
    """Its edge touches already where its other edge has an impact: no event shows it; it was refused."""
    system = gauss.compile_scene(dominoes(4))
    motion = gauss.simulate(system, 0.5, integrator="time_stepping", rtol=1e-5, times=[0.5])
    short = gauss.simulate(system, 0.5, integrator="time_stepping", step=1e-5, times=[0.5])
    assert np.abs(motion.q[-1] - short.q[-1]).max() <= GROWN * 1e-5


@pytest.mark.parametrize("many", [0, 8])
@pytest.mark.parametrize("d", [1e-6, -1e-6])
def test_what_is_left_of_a_closed_gap_is_removed_in_a_time_that_does_not_depend_on_the_step(d, many):
    """Steps of h and h/1000 give a ball d inside of its floor, or above, the rate d/τ; fixed steps d/h, or let it fall."""
    scene = gauss.Scene("inside", gravity=(0.0, 0.0, -g))
    scene.half_space("floor")
    for k in range(1 + many):
        scene.body(f"ball{k}", 1.0, (0.4 * RADIUS**2,) * 3)
        scene.free(f"free{k}", "ground", f"ball{k}")
        scene.sphere(f"round{k}", f"ball{k}", radius=RADIUS)
        scene.contact(f"C{k}", f"round{k}", "floor")
        scene.start(f"free{k}", position=(0.0, 5.0 * k, RADIUS, 1.0, 0.0, 0.0, 0.0), rate=(SPEED, 0, 0, 0, 0, 0))
    system = gauss.compile_scene(scene)
    rest = system.initial_state()
    start = State(0.0, np.where(np.arange(rest.q.size) == 2, rest.q - d, rest.q), rest.v)
    for stepper in (new_contact_stepper(system, removal=removal_time(system)), new_contact_stepper(system)):
        rates = []
        for h in (1e-3, 1e-6):
            stepper.forget()
            row = np.empty((1, 4 + system.n_q + system.n_v))
            stepper.python_step(rest, h)  # finds the kernels of the pairs, and the forces of rest
            known = stepper.known
            begin = np.concatenate([[start.t], start.q, start.v, np.zeros(3)])
            assert stepper.steps_from(begin, np.array([h]), row).steps == 1
            stepper.known = known
            assert row[0, 1 + system.n_q + 2] == pytest.approx(stepper.python_step(start, h).v[2], rel=1e-9)
            rates.append(row[0, 1 + system.n_q + 2])
        time = stepper.removal
        if d > 0.0:
            expected = [d / (time or h) for h in (1e-3, 1e-6)]
        else:  # it falls, at most as fast as that; in fixed steps it moves after half of them
            expected = [-min(-d / (time or 0.5 * h), g * h) for h in (1e-3, 1e-6)]
        assert rates == pytest.approx(expected, rel=1e-6)


def test_a_short_late_force_is_not_stepped_over():
    """A block at rest on its floor is pushed for 10 ms after 3 s, slides, and stays where friction stops it."""
    scene = gauss.Scene("pushed", gravity=(0.0, 0.0, -g))
    scene.body("block", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("slide", "ground", "block", axis=(1.0, 0.0, 0.0))
    scene.joint_friction("slide", 2.0)
    scene.drive("slide", force=lambda t: gauss.math.where((t >= 3.0) & (t < 3.01), 102.0, 0.0))
    motion = gauss.simulate(scene, 4.0, integrator="time_stepping", rtol=1e-4, times=[4.0])
    speed = 100.0 * 0.01
    assert motion.q[-1, 0] == pytest.approx(speed * 0.01 / 2.0 + speed**2 / (2.0 * 2.0), abs=1e-4)
    assert abs(motion.v[-1, 0]) < AT_REST


@pytest.mark.slow
def test_a_force_in_a_narrow_place_is_not_flown_through():
    """A mass at 3 m/s, with a stop far away, gains F w = 0.5 J from a force of 500 N between x = 5 m and 5.001 m."""
    scene = gauss.Scene("narrow", gravity=(0.0, 0.0, 0.0))
    scene.body("mass", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("x", "ground", scene.bodies["mass"], axis=(1.0, 0.0, 0.0))
    scene.stop("x", highest=100.0)
    inside = lambda x: (x > 5.0) & (x < 5.001)  # noqa: E731
    scene.drive("x", force=lambda t, at: gauss.math.where(inside(at.coordinate("x")), 500.0, 0.0))
    scene.start("x", 0.0, 3.0)
    motion = gauss.simulate(scene, 3.0, integrator="time_stepping", rtol=1e-5, times=[3.0])
    assert motion.v[-1, 0] == pytest.approx(np.sqrt(9.0 + 2.0 * 0.5), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("others", [0, 9])
def test_fast_bodies_do_not_pass_through_thin_ones(others):
    """A ball without gravity meets a plate of 1 mm after 1.8 m of free flight; with other balls it moves by pair kernels."""
    scene = gauss.Scene("bullet", gravity=(0.0, 0.0, 0.0))
    scene.box("plate", "ground", (0.001, 1.0, 1.0))
    for k in range(1 + others):
        scene.body(f"ball{k}", 0.01, (1e-8,) * 3)
        scene.free(f"free{k}", "ground", f"ball{k}")
        scene.sphere(f"round{k}", f"ball{k}", radius=0.002)
        scene.contact(f"hit{k}", f"round{k}", "plate")
        scene.start(f"free{k}", position=(-1.8, 0.1 * k - 0.3, 0, 1, 0, 0, 0), rate=(100.0, 0, 0, 0, 0, 0))
    motion = gauss.simulate(scene, 0.022, integrator="time_stepping", rtol=1e-3, times=[0.022])
    assert motion.q[-1, 0] == pytest.approx(-0.0025, abs=1e-5)
    assert any(event.kind == "impact" for event in motion.events)


@pytest.mark.slow
def test_verify_covers_the_error_and_contact_forces_are_those_of_rest():
    motion = gauss.simulate(_sliding(1), 1.0, integrator="time_stepping", rtol=1e-4, verify=True)
    true = max(abs(x - _way(t)) for t, x in zip(motion.t, motion.q[:, 0], strict=True))
    assert motion.stats.global_error[0] >= CLAIM * true
    assert gauss.contact_forces(motion, "C0")[-1].sum() == pytest.approx(g, rel=1e-6)


REFUSED = {
    "default tolerance": lambda scene: gauss.simulate(scene, 1.0, integrator="time_stepping"),
    "too tight": lambda scene: gauss.simulate(scene, 1.0, integrator="time_stepping", rtol=1e-9),
    "other methods": lambda scene: gauss.simulate(gauss.load("pendulum"), 1.0, integrator="rk4", rtol=1e-4),
    "another backend": lambda scene: gauss.simulate(scene, 1.0, integrator="time_stepping", rtol=1e-4, backend="kkt"),
    "a sweep": lambda scene: gauss.sweep(lambda h: scene, {"h": [1.0, 2.0]}, 1.0, integrator="time_stepping", rtol=1e-4),
    "a simulator": lambda scene: gauss.Simulator(scene, None, "time_stepping"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_refused(what):
    with pytest.raises(gauss.GaussError, match="step"):
        REFUSED[what](_bouncing())


@pytest.mark.slow
def test_a_law_that_raises_leaves_the_motion_so_far():
    def law(t):
        if t > 0.3:
            raise ValueError("no more")
        return 0.0

    scene = _bouncing()
    scene.drive("height", force=law)
    with pytest.raises(SimulationError, match="no more") as caught:
        gauss.simulate(scene, 1.0, integrator="time_stepping", rtol=1e-4)
    assert 0.2 < caught.value.trajectory.t[-1] <= 0.3
