"""Constraints whose residuals jump, or have a kink, at conditions on the state: jumps are refused, kinks are impacts."""

import warnings

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import BalanceWarning, SimulationError, SwitchingWarning
from gauss.servo import Motor, Servo, ServoRelation
from gauss.servo import simulate as simulate_servo

pytestmark = pytest.mark.slow

SPEED, AT = 2.0, 1.05  # of the carriage [m/s], and place of the surface [m]
SLOPE = 0.5  # of the ramp behind the kink
EVENT = AT / SPEED  # [s]
ROUNDING = 1e-9  # of states by exact methods: motion in straight lines

METHODS = {
    "dop853": {},
    "radau5": {"rtol": 1e-8},
    "taylor": {},
    "rk4": {"step": 0.01},
    "verlet": {"step": 0.01},
    "gauss4": {"step": 0.01},
    "energy_momentum": {"step": 0.01},
    "time_stepping": {"step": 0.01},
    "scipy_dop853": {"rtol": 1e-10},
}


def _on_track(height, kind="constraint"):
    """Carriage on a rail with a slide on it whose height follows from the place of the carriage."""
    scene = gauss.Scene("track", gravity=(0, 0, 0))
    scene.body("carriage", 1.0)
    scene.body("slide", 1.0)
    scene.prismatic("X", "ground", "carriage", axis=(1, 0, 0))
    scene.prismatic("Z", "carriage", "slide", axis=(0, 0, 1))
    if kind == "cam":
        scene.cam("track", "X", "Z", height)
    else:
        scene.constrain("track", position=lambda at: at.coordinate("Z") - height(at.coordinate("X")))
    scene.start("X", rate=SPEED)
    return scene


def _step(x):
    return gm.where(x > AT, 0.5, 0.0)


def _kink(x):
    return gm.maximum(0.0, SLOPE * (x - AT))


def _narrow(x):
    return gm.where(gm.abs(x - AT) < 0.002, 0.05, 0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("height", [_step, _narrow], ids=["step", "narrow"])
def test_positions_that_jump_are_refused_where_the_motion_crosses(method, height):
    """The message has place, time and size of the jump, and the motion up to there is attached."""
    settings = METHODS[method] | ({"step": 0.2} if height is _narrow and "step" in METHODS[method] else {})
    with pytest.raises(SimulationError, match=r"'track'.* jumps by 0\.0?5 .*X = 1\.0[45]") as refused:
        gauss.simulate(_on_track(height), 1.0, integrator=method, **settings)
    reached = refused.value.trajectory
    place = AT - (0.002 if height is _narrow else 0.0)
    np.testing.assert_allclose([reached.t[-1], reached.q[-1, 0]], [place / SPEED, place], rtol=1e-7)


@pytest.mark.parametrize("kind", ["constraint", "cam"])
@pytest.mark.parametrize("method", METHODS)
def test_kinks_are_impacts(method, kind):
    """Velocities after a kink are projected in the mass metric; the impulse and the energy lost are in the event."""
    sticking = SPEED / (1.0 + 0.5 * SLOPE**2)  # both masses are moved along, the slide alone upwards: m (2 u² + w²)
    speed = 2.0 * SPEED / (2.0 + SLOPE**2)
    assert sticking == pytest.approx(speed)
    with warnings.catch_warnings():
        warnings.simplefilter("error", BalanceWarning)
        warnings.simplefilter("ignore", SwitchingWarning)  # of libraries
        found = gauss.simulate(_on_track(_kink, kind), 1.0, integrator=method, times=[0.3, 1.0], **METHODS[method])
    travelled = speed * (1.0 - EVENT)
    right = [[0.3 * SPEED, 0.0, SPEED, 0.0], [AT + travelled, SLOPE * travelled, speed, SLOPE * speed]]
    np.testing.assert_allclose(np.hstack([found.q, found.v]), right, atol=ROUNDING)
    (event,) = found.events
    lost = 0.5 * (2.0 * SPEED**2 - (2.0 + SLOPE**2) * speed**2)
    assert (event.kind, event.gaps) == ("impact", ("track",))
    np.testing.assert_allclose(
        [event.t, event.loss, event.impulses["track"][0]], [EVENT, lost, SLOPE * speed], atol=ROUNDING
    )
    assert found.work[-1, 2] == pytest.approx(lost)


def test_surfaces_that_the_motion_does_not_reach_change_nothing():
    """No refusal of a jump beyond the end of the motion."""
    found = gauss.simulate(_on_track(_step), 0.4, times=[0.4])
    np.testing.assert_allclose(found.q[-1], [0.8, 0.0], atol=ROUNDING)
    assert not found.events


def test_pieces_that_fit_in_slope_are_no_surfaces():
    """A profile in pieces, continuous with its slope, is moved in one piece by any method."""
    found = gauss.simulate(_on_track(lambda x: gm.where(x > AT, (x - AT) ** 2, 0.0)), 1.0, times=[1.0])
    x, z = found.q[-1]
    rate = SPEED * np.sqrt(2.0 / (2.0 + (2.0 * (x - AT)) ** 2))
    np.testing.assert_allclose([z, *found.v[-1]], [(x - AT) ** 2, rate, 2.0 * (x - AT) * rate], atol=1e-8)
    assert not found.events
    assert found.stats.plan.driver == "compiled loop"


def test_many_kinks_of_a_staircase():
    """A floor in the residual has a surface at every step; ramps between them are met one after the other."""
    saw = lambda x: SLOPE * gm.abs(x - gm.floor(x + 0.5))  # noqa: E731
    scene = _on_track(saw)
    scene.start("X", position=0.25, rate=SPEED)
    scene.start("Z", position=0.25 * SLOPE, rate=SLOPE * SPEED)
    found = gauss.simulate(scene, 2.0, times=[2.0])
    slopes, speed, t = [SLOPE], SPEED, -0.25 / SPEED
    while t + (0.5 / speed) < 2.0:  # every half metre the slope changes its sign: u⁺ = u (2 − k²) / (2 + k²)
        t += 0.5 / speed
        speed *= (2.0 - SLOPE**2) / (2.0 + SLOPE**2)
        slopes.append(-slopes[-1])
    np.testing.assert_allclose(found.v[-1], [speed, slopes[-1] * speed], atol=ROUNDING)
    assert len(found.events) == len(slopes) - 1


def test_batches_move_such_scenes_one_by_one():
    """A rollout is as the single motions, and refuses jumps."""
    found = gauss.rollout(
        gauss.compile_scene(_on_track(_kink)),
        [[0.0, 0.0], [0.1, 0.0]],
        [[2.0, 0.0], [1.0, 0.0]],
        integrator="rk4",
        step=0.01,
        steps=100,
    )
    speed = 2.0 * SPEED / (2.0 + SLOPE**2)
    np.testing.assert_allclose(found.v[:, -1, 0], [speed, speed / 2.0], atol=ROUNDING)
    with pytest.raises(SimulationError, match=r"'track'.* jumps by 0\.5"):
        gauss.rollout(
            gauss.compile_scene(_on_track(_step)), [[0.0, 0.0]], [[2.0, 0.0]], integrator="rk4", step=0.01, steps=100
        )


@pytest.mark.parametrize("height", [_step, _kink], ids=["step", "kink"])
def test_stepping_objects_and_servos_refuse_them_before_the_first_step(height):
    """They do not locate conditions, and say what does."""
    scene = _on_track(height)
    for make in (lambda: gauss.Simulator(scene, step=0.01), lambda: gauss.SimulatorBatch(scene, step=0.01, batch=2)):
        with pytest.raises(SimulationError, match=r"'track' .*X.*gauss\.simulate"):
            make()
    held = Servo(scene, [ServoRelation("at", lambda t, at: at.coordinate("X") - SPEED * t, unit="m")], [Motor("motor", "X")])
    with pytest.raises(SimulationError, match=r"'track' .*X.*gauss\.simulate"):
        simulate_servo(held, 1.0)


def test_a_notch_that_drives_back_from_both_sides_is_refused():
    """In a notch of less than a right angle the impact turns the motion back at once: it cannot pass."""
    with pytest.raises(SimulationError, match=r"'track'.*cannot pass"):
        gauss.simulate(_on_track(lambda x: 2.0 * gm.abs(x - AT)), 1.0)


def test_rows_that_vanish_in_a_mode_are_dropped_there():
    """A residual that is zero beyond a condition releases the slide."""
    scene = gauss.Scene("released", gravity=(0, 0, 0))
    scene.body("carriage", 1.0)
    scene.body("slide", 1.0)
    scene.prismatic("X", "ground", "carriage", axis=(1, 0, 0))
    scene.prismatic("Z", "carriage", "slide", axis=(0, 0, 1))
    scene.constrain(
        "track", lambda at: gm.where(at.coordinate("X") < AT, at.coordinate("Z") - 0.5 * at.coordinate("X"), 0.0)
    )
    scene.start("X", rate=SPEED)
    scene.start("Z", rate=0.5 * SPEED)
    found = gauss.simulate(scene, 1.0, times=[1.0])
    np.testing.assert_allclose(found.q[-1], [SPEED, 0.5 * SPEED], atol=ROUNDING)


def _two_wheels(residual, rate=1.0):
    """Wheels on the ground, the second one bound to the first by a residual of both angles."""
    scene = gauss.Scene("wheels", gravity=(0, 0, 0))
    for name, speed in (("A", 1.0), ("B", rate)):
        scene.body(name, 1.0, (0.1, 0.1, 0.1))
        scene.revolute(name, "ground", name, axis=(0, 0, 1))
        scene.start(name, rate=speed)
    scene.constrain("bound", position=lambda at: residual(at.coordinate("A"), at.coordinate("B")))
    return scene


def _wrapped(angle):
    return gm.atan2(gm.sin(angle), gm.cos(angle))


PAST = 4.0  # s: the first wheel is at its branch cut at π
# residuals that jump by 2π where an angle does, with the rate of the second wheel
CUT = {
    "one angle": (lambda a, b: b - _wrapped(a), 1.0),
    "half of it": (lambda a, b: b - 0.5 * _wrapped(a), 0.5),
    "of numpy": (lambda a, b: b - np.arctan2(np.sin(a), np.cos(a)), 1.0),
    "within a function": (lambda a, b: gm.sin(0.25 * _wrapped(a)) - gm.sin(0.25 * b), 1.0),
    "one within another": (lambda a, b: b - _wrapped(_wrapped(a)), 1.0),
}
# residuals whose cuts no state on the constraint meets
UNCUT = {
    "difference": (lambda a, b: _wrapped(b - a), 1.0),
    "half plane": (lambda a, b: b - a + gm.atan2(gm.sin(a), 2.0 + gm.cos(a)) - gm.atan2(gm.sin(b), 2.0 + gm.cos(b)), 1.0),
}


# every residual by the default method; where a driver looks for a cut does not depend on how the residual is written:
# a cut of its own and one that a function hides are enough for each other one
MET = [(name, "dop853") for name in CUT]
MET += [(name, method) for name in ("one angle", "within a function") for method in ("rk4", "time_stepping")]


@pytest.mark.parametrize(("name", "method"), MET)
def test_a_branch_cut_that_the_motion_meets_is_refused(name, method):
    with pytest.raises(SimulationError, match=r"'bound': what it prescribes jumps by .* at t = 3\.14159") as caught:
        gauss.simulate(_two_wheels(*CUT[name]), PAST, integrator=method, progress=False, **METHODS[method])
    assert caught.value.trajectory.q[-1, 0] == pytest.approx(np.pi, abs=1e-6)


@pytest.mark.parametrize("name", CUT)
def test_a_branch_cut_is_refused_where_it_is_not_located(name):
    with pytest.raises(SimulationError, match="'bound' jumps by"):
        gauss.Simulator(_two_wheels(*CUT[name]), 0.01)


@pytest.mark.parametrize("name", UNCUT)
def test_a_branch_cut_away_from_the_constraint_is_none(name):
    scene = _two_wheels(*UNCUT[name])
    assert gauss.simulate(scene, PAST, progress=False).q[-1] == pytest.approx([PAST, PAST], abs=ROUNDING)
    simulator = gauss.Simulator(scene, 0.01)
    simulator.step(n=round(PAST / 0.01))
    assert simulator.coordinates[0] == pytest.approx([PAST, PAST], abs=ROUNDING)
