"""Motions with references: through singular configurations, over a hundred periods, at the tightest tolerance."""

import mpmath as mp
import numpy as np
import pytest

import gauss
from gauss.bench.atlas.motions import at_equal_slider_crank, before_flat
from gauss.system import retract
from tests.support import mechanisms

pytestmark = pytest.mark.slow

DRIFT = 1e-8  # J: with the settings that a user gets without asking; as a rule 3e-10
BRANCH = 1e-8  # rad: beside the motion in which all cranks stay parallel
PASSED = 1e-9  # m, rad, and of the largest energy, after twenty passages
SQUEEZER = 1e-11  # rad: the table carries 12 digits, the published end values 1.4e-9
PERIODS = 100
LONG = 1e-12  # rad, rad/s: after a hundred periods, with compensated sums
# DOP853 weighs slopes that are rounded by up to 6: the energy walks at random, and the pendulum's clock, which it sets, is
# off by 3e-13 s of 278 s; half a unit in the last place of g, of the start and of the time are 5e-14 s
CLOCKS = {
    "dop853": (lambda period: {"rtol": 1e-16, "atol": 1e-16}, 5e-12),
    # h⁶ down to 500 steps a period; 4e-13 of the body, however many more there are, for what rounding takes is carried
    "gauss6": (lambda period: {"integrator": "gauss6", "step": period / 1000}, LONG),
    # a step rounds its accelerations once, and what that leaves is the less the more steps there are: 1e-13 with these
    "taylor": (lambda period: {"integrator": "taylor", "rtol": 1e-15, "atol": 1e-15, "step": period / 100}, LONG),
}
TIGHT = {"rtol": 1e-15, "atol": 1e-15}


@pytest.mark.parametrize("n", [1, 10])
def test_ladder_through_flat_configurations(n):
    """10 s through every configuration in which n freedoms meet, on the right branch."""
    data = mechanisms.reference("n-four-bar")["table"]
    times = np.array(data["t"])
    motion = gauss.simulate(mechanisms.ladder(n), times[-1], times=times)
    assert np.abs(motion.coordinate("A0") + data[str(n)]["theta"]).max() <= BRANCH
    assert np.abs(gauss.energy(motion).balance).max() <= DRIFT


@pytest.mark.parametrize("n, count", [(1, 25), (10, 8)])
def test_ladders_keep_their_energy_from_any_start(n, count):
    """No stage of a step falls near a flat configuration, wherever a motion begins; by chance one in a hundred would."""
    system, rng = mechanisms.ladder(n), np.random.default_rng(0)
    alike, drifts = system.initial_state().v, []
    for _ in range(count):
        angle, rate = rng.uniform(-1.2, 1.2), rng.uniform(0.2, 3.0) * rng.choice([-1.0, 1.0])
        motion = gauss.simulate(system, 10.0, state=system.state(alike * angle, alike * rate))
        drifts.append(np.abs(gauss.energy(motion).balance).max())
        assert np.abs(motion.coordinate(f"A{n}") - motion.coordinate("A0")).max() <= BRANCH
    assert max(drifts) <= DRIFT


@pytest.mark.parametrize("name", ["parallelogram", "four_bar", "bricard"])
def test_linkages_keep_their_energy_from_any_start(name):
    system, rng = gauss.compile_scene(gauss.load(name)), np.random.default_rng(1)
    start = system.initial_state()
    for _ in range(6):
        q = retract(system, start.q, rng.uniform(-0.6, 0.6, system.n_v))
        motion = gauss.simulate(system, 10.0, state=system.initial_state(q, rng.uniform(-3.0, 3.0, system.n_v)))
        found = gauss.energy(motion)
        assert np.abs(found.balance).max() <= PASSED * found.scale


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "taylor", "rk4"])
@pytest.mark.parametrize("name", ["slider-crank", "ladder of 2"])
def test_singular_points_are_passed_for_twenty_seconds(name, integrator):
    """23 and 35 passages with the tolerances that a user gets without asking: the branch is kept, and the energy.

    The steps of "rk4" are such that its own error is small enough.
    """
    step = {"step": 5e-4} if integrator == "rk4" else {}
    if name == "slider-crank":
        system, state = at_equal_slider_crank()
    else:
        system, state = before_flat(2)
    motion = gauss.simulate(system, 20.0, state=state, integrator=integrator, **step)
    if name == "slider-crank":
        apart = motion.coordinate("guide") + 2.0 - 2.0 * np.cos(motion.coordinate("A"))
    else:
        apart = motion.coordinate("A1") - motion.coordinate("A0")
    passages = np.count_nonzero(np.diff(np.sign(np.cos(motion.coordinate(system.coordinates[0])))))
    found = gauss.energy(motion)
    assert passages >= 20 and np.abs(apart).max() <= PASSED
    assert np.abs(found.balance).max() <= PASSED * found.scale


def test_andrews_squeezer():
    """Start accelerations, the motion to 12 digits, and the end values that were published."""
    data = mechanisms.reference("andrews-squeezer")
    table, start = data["table"], np.array(data["initial_conditions"]["q"])
    system = gauss.compile_scene(gauss.load("andrews_squeezer"))
    assert system.accelerations(system.initial_state())[:2] == pytest.approx(
        data["initial_conditions"]["qdd_1_2"], rel=1e-12
    )
    motion = gauss.simulate(system, table["t"][-1], times=table["t"], rtol=1e-13, atol=(1e-15, 1e-12))
    joints = ("O", "P", "B", "G", "A5", "H", "A7")
    q = start + np.column_stack([motion.coordinate(joint) for joint in joints])
    assert np.abs(q - table["q"]).max() <= SQUEEZER
    assert np.abs(q[-1] - data["published_end"]["q"]).max() <= 2e-9
    v = np.column_stack([motion.rate(joint) for joint in joints])
    assert np.abs(v[-1] - table["v"][-1]).max() <= 1e-8  # rates of 1000 rad/s


@pytest.mark.parametrize("name", CLOCKS)
def test_pendulum_over_many_periods(name):
    """Whittaker, Analytical Dynamics, §44, in 40 digits; g and the times are taken as the doubles that they are."""
    g, start, (method, allowed) = 9.81, 2.0, CLOCKS[name]
    with mp.workdps(40):
        k, omega = mp.sin(mp.mpf(start) / 2), mp.sqrt(mp.mpf(g))
        period = 4 * mp.ellipk(k**2) / omega
        times = [float(part * period) for part in (0.25, PERIODS / 2 + 0.3, PERIODS - 0.25, PERIODS)]
        phases = [mp.ellipk(k**2) - omega * mp.mpf(t) for t in times]
        angles = [2 * mp.asin(k * mp.ellipfun("sn", phase, m=k**2)) for phase in phases]
        rates = [-2 * k * omega * mp.ellipfun("cn", phase, m=k**2) for phase in phases]
    scene = gauss.Scene("pendulum", gravity=(0, 0, -g))
    scene.body("bob", mass=1.0, com=(0, 0, -1.0))
    scene.revolute("A", "ground", "bob", axis=(0, 1, 0))
    scene.start("A", start)
    motion = gauss.simulate(scene, times[-1], times=times, **method(float(period)))
    assert motion.coordinate("A") == pytest.approx(np.array(angles, float), abs=allowed)
    assert motion.rate("A") == pytest.approx(np.array(rates, float), abs=allowed)


@pytest.mark.parametrize("name", CLOCKS)
def test_free_body_over_many_periods(name):
    """Jacobi functions, cn, sn, dn, in 40 digits: Landau, Lifshitz, Mechanics, §37."""
    J, a, c, (method, _) = (1.0, 2.0, 3.0), 1.0, 2.0, CLOCKS[name]
    with mp.workdps(40):
        m = a**2 * J[0] * (J[1] - J[0]) / (c**2 * J[2] * (J[2] - J[1]))
        p = c * mp.sqrt((J[2] - J[0]) * (J[2] - J[1]) / (J[0] * J[1]))
        b = a * mp.sqrt(J[0] * (J[2] - J[0]) / (J[1] * (J[2] - J[1])))
        period = 4 * mp.ellipk(m) / p
        times = [float(part * period) for part in (0.3, PERIODS / 2 + 0.1, PERIODS)]
        sizes = {"cn": a, "sn": b, "dn": c}
        exact = [[size * mp.ellipfun(of, p * mp.mpf(t), m=m) for of, size in sizes.items()] for t in times]
    scene = gauss.Scene("body", gravity=(0, 0, 0))
    scene.body("body", 1.0, J)
    scene.free("F", "ground", "body")
    scene.start("F", rate=(0, 0, 0, a, 0, c))
    motion = gauss.simulate(scene, times[-1], times=times, **method(float(period)))
    assert motion.v[:, 3:] == pytest.approx(np.array(exact, float), abs=LONG)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_steady_top_over_many_periods(integrator):
    data = mechanisms.reference("steady-top")
    p, precession = data["parameters"], data["precession_fast"]
    transverse, theta = p["A"] - p["m"] * p["l"] ** 2, p["theta"]
    scene = gauss.Scene("top", gravity=(0, 0, -p["g"]))
    scene.body("top", p["m"], (transverse, transverse, p["C"]), com=(0, 0, p["l"]))
    scene.ball("tip", "ground", "top")
    turned = (np.cos(theta / 2), 0.0, np.sin(theta / 2), 0.0)
    scene.start("tip", turned, (-precession * np.sin(theta), 0.0, p["w3"]))
    duration = PERIODS * 2 * np.pi / precession
    motion = gauss.simulate(scene, duration, times=np.linspace(0, duration, 7), integrator=integrator, **TIGHT)
    assert np.arccos(motion.body("top").com[:, 2] / p["l"]) == pytest.approx(theta, abs=LONG)


def test_redundant_rows_do_not_blunt_the_step_control():
    """Bricard's linkage has a row too many at all times: that is no configuration in which rows fade."""
    system, run = gauss.compile_scene(gauss.load("bricard")), {"times": [2.0], "rtol": 1e-13, "atol": 1e-13}
    settled, free = (gauss.simulate(system, 2.0, stabilisation=way, **run) for way in ("projection", "none"))
    assert settled.q == pytest.approx(free.q, abs=1e-10)


def test_slider_of_the_governor_stays_on_its_shaft():
    motion = gauss.simulate(gauss.load("flyball_governor"), 0.5, integrator="radau5", rtol=1e-9, atol=1e-9, times=[0.1, 0.5])
    place = motion.body("slider").position
    assert np.abs(place[:, :2]).max() <= 1e-12 < np.abs(place[:, 2] + 0.5).min()  # of the order of centimetres


def test_bricard_swings_as_the_library_draws_it():
    """P3 leads from one side of a cube to the other and back in 5 s; half way it is lifted as the hinges allow."""
    t = np.linspace(0.0, 5.1, 2041)
    motion = gauss.simulate(gauss.load("bricard"), t[-1], times=t, rtol=1e-8, atol=1e-8)
    rod = motion.body("rod2")
    x, y, z = (rod.position + np.einsum("kij,j->ki", rod.rotation, [0.0, -1.0, 0.0])).T
    assert (x.min(), x.max(), y.min(), y.max(), z.min(), z.max()) == pytest.approx(
        (-1.0, 1.0, -1.0, -np.sqrt(0.75), -0.5, 0.0), abs=1e-5
    )
    assert t[t > 4.0][np.argmax(x[t > 4.0])] == pytest.approx(5.0, abs=0.03)  # read off the figure


def test_governor_lifts_its_slider_as_the_library_draws_it():
    read = {0.1: 0.523, 0.5: 0.743, 1.0: 0.502, 2.6: 0.740, 4.1: 0.500, 9.7: 0.741, 10.0: 0.62}  # t [s], s [m]
    motion = gauss.simulate(
        gauss.load("flyball_governor"), 10.0, integrator="radau5", rtol=1e-6, atol=1e-6, times=list(read)
    )
    assert 1.0 + motion.body("slider").com[:, 2] == pytest.approx(list(read.values()), abs=0.003)
