"""Every call warns of a motion whose energy balance is off; good motions have no warning."""

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.analysis import warn_of_balance
from gauss.codegen.kernels import initial_energy_record, recorded_energies, updated_energy_record
from gauss.dynamics.energies import kinetic_energy_of_bodies, look_at_energies, potential_energy
from gauss.dynamics.kinematics import kinematics
from gauss.errors import BalanceWarning
from gauss.simulation import energy_balance as balance

CALLS = 3  # the first of a process, one whose machine code is there, and one more
COARSE = {"integrator": "semi_implicit_euler", "step": 5e-3}  # off by percents on a double pendulum that swings
ROUNDING = 1e-13  # relative to the energies: two ways of adding the same numbers up


def opaque(pulse, **options):
    """Double pendulum with a pulse of torque that is hidden in a Python function, and missed by long steps."""
    scene = gauss.load("double_pendulum")
    scene.drive(next(iter(scene.joints)), torque=lambda t: pulse if 0.405 < float(t) < 0.415 else 0.0)
    return scene, options


def walled(opaque):
    """Pendulum that falls on a stiff wall, a spring beyond 0.5 rad: long steps jump into it and are thrown back too hard."""
    scene = gauss.Scene("before a wall")
    scene.body("rod", 1.0, (0.1, 0.1, 0.01), com=(0.5, 0, 0))
    scene.revolute("R", "ground", "rod", axis=(0, 1, 0))

    def traced(t, motion):
        return gm.minimum(1e4 * (0.5 - motion.coordinate("R")), 0.0)

    def called(t, motion):
        return min(1e4 * (0.5 - float(motion.coordinate("R"))), 0.0)

    scene.drive("R", torque=called if opaque else traced)
    return scene


def sliding(speed):
    scene = gauss.Scene("slide", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.prismatic("P", "ground", "b", axis=(1, 0, 0))
    scene.drive("P", speed=speed)
    return scene


def bouncing():
    """Pendulum between stops: phases between impacts, stepped by Python."""
    scene = gauss.Scene("between stops")
    scene.body("rod", 1.0, (0.1, 0.1, 0.01), com=(0.5, 0, 0))
    scene.revolute("R", "ground", "rod", axis=(0, 1, 0))
    scene.stop("R", lowest=-0.5, highest=2.0, restitution=0.5)
    return scene


def falling():
    """Box that falls by 1 m and stays there."""
    scene = gauss.Scene("fall")
    scene.body("b", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("P", "ground", "b", axis=(0, 0, 1))
    scene.stop("P", lowest=-1.0)
    return scene


LOOSE = {"rtol": 0.05, "atol": 0.05}
LONG, SHORT = ({"integrator": "rk4", "step": step} for step in (0.05, 1e-3))  # beside 0.02 s in the wall
PENDULUM = lambda: gauss.load("double_pendulum")  # noqa: E731
WRONG = {  # engine: a scene, and how it is simulated wrongly
    "compiled, fixed step": (PENDULUM, COARSE),
    "compiled, only the end kept": (PENDULUM, {**COARSE, "times": [1.9]}),
    "compiled, own step": (PENDULUM, {"integrator": "dopri5", **LOOSE}),
    "compiled, loops": (lambda: gauss.load("four_bar"), COARSE),
    "compiled, implicit": (PENDULUM, {"integrator": "radau5", **LOOSE}),
    "compiled, Taylor": (PENDULUM, {"integrator": "taylor", **LOOSE}),
    "certified": (PENDULUM, {**COARSE, "backend": "recursion"}),
    "certified, only the end kept": (PENDULUM, {**COARSE, "backend": "recursion", "times": [1.9]}),
    "laws called": (lambda: walled(opaque=True), LONG),
    "laws traced": (lambda: walled(opaque=False), LONG),
    "time stepping": (falling, {"integrator": "time_stepping", "step": 0.15}),
    "library": (PENDULUM, {"integrator": "scipy_dop853", **LOOSE}),
    "phases": (bouncing, LOOSE),
}


@pytest.fixture(scope="module")
def swinging():
    return gauss.compile_scene(gauss.load("double_pendulum"))


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_every_call_of_simulate_tells(name):
    make, options = WRONG[name]
    scene = make()
    system = gauss.compile_scene(scene)
    for _ in range(CALLS):
        (said,) = _told(lambda: gauss.simulate(system, 2.0, **options))
        assert said.filename == __file__
        assert repr(scene.name) in str(said.message) and options.get("integrator", "dop853") in str(said.message)


def test_default_filters_show_it_at_every_line_that_asks(swinging):
    """Python shows the same words once for each line; two lines are two places, for each is that of who called."""
    with warnings.catch_warnings(record=True) as said:
        warnings.resetwarnings()
        warnings.simplefilter("default")
        gauss.simulate(swinging, 2.0, **COARSE)
        gauss.simulate(swinging, 2.0, **COARSE)
    lines = [one.lineno for one in said if one.category is BalanceWarning]
    assert len(lines) == len(set(lines)) == 2


MANY = {
    "rk4": {"integrator": "rk4", "steps": 10, "step": 0.2},
    "semi_implicit_euler": {"integrator": "semi_implicit_euler", "steps": 200, "step": 1e-2},
    "dop853": {"integrator": "dop853", "times": [0.0, 2.0], **LOOSE},
    "dopri5": {"integrator": "dopri5", "times": [2.0], **LOOSE},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MANY)
def test_every_rollout_tells_which_motions_are_off(swinging, name):
    """Of starts at rest below, and one that swings wildly, only the latter is off, in whichever lane."""
    q0 = np.zeros((11, swinging.n_q))
    rest = _hanging(swinging)
    q0[:] = rest
    q0[7] = rest + 2.0
    for _ in range(CALLS):
        (said,) = _told(lambda: gauss.rollout(swinging, q0, np.zeros_like(q0), **MANY[name]))
        assert said.filename == __file__
        assert "number 7 " in str(said.message) and "1 of 11 motions" in str(said.message)


@pytest.mark.slow
def test_energy_that_a_wall_gives_to_long_steps_is_told_of_by_every_entry_point():
    """Steps that resolve the wall keep it."""
    pytest.importorskip("xarray")
    system = gauss.compile_scene(walled(opaque=False))
    start = system.initial_state()
    for settings, mode in ((LONG, 1), (SHORT, 0)):
        steps = round(1.0 / settings["step"])
        power_flow = [
            lambda: gauss.simulate(system, 1.0, **settings),  # noqa: B023
            lambda: gauss.rollout(system, [start.q] * 3, [start.v] * 3, steps=steps, **settings),  # noqa: B023
            lambda: gauss.sweep(walled(opaque=False), {"rod.mass": [1.0, 2.0]}, 1.0, samples=3, **settings),  # noqa: B023
        ]
        for way in power_flow:
            assert len(_told(way)) == mode


def test_rollouts_tell_of_motions_that_are_made_again(swinging, monkeypatch):
    """Whatever engine makes a motion, one warning comes, with its number."""
    monkeypatch.setattr("gauss.simulation.batch.rollout.ACCELERATION_TOLERANCE", -1.0)
    q0 = np.full((2, swinging.n_q), 1.0)
    run = {"integrator": "semi_implicit_euler", "steps": 100, "step": 1e-2}
    (said,) = _told(lambda: gauss.rollout(swinging, q0, np.zeros_like(q0), **run))
    assert "number 0 " in str(said.message) and "number 1 " in str(said.message)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        {"integrator": "semi_implicit_euler", "step": 1e-2},
        {"integrator": "dop853", **LOOSE},
        {"integrator": "radau5", **LOOSE},  # one at a time
    ],
    ids=lambda settings: settings["integrator"],
)
@pytest.mark.parametrize("workers", [None, "threads"])
def test_every_sweep_tells_which_members_are_off(settings, workers):
    pytest.importorskip("xarray")
    scene = gauss.load("double_pendulum")
    body = next(iter(scene.bodies))
    for _ in range(CALLS - 1):
        with ThreadPoolExecutor(2) as pool:
            run = {"samples": 5, "workers": pool if workers else None, **settings}
            found = []
            (said,) = _told(lambda: found.append(gauss.sweep(scene, {f"{body}.mass": [1.0, 2.0]}, 2.0, **run)))  # noqa: B023
        worst = int(found[0].energy_error.argmax())
        assert said.filename == __file__ and f"member {worst} ({body}.mass = {worst + 1})" in str(said.message)
        assert (found[0].energy_error > balance.WRONG).any()


GOOD = {
    "double pendulum": (PENDULUM, 2.0, {}),
    "coarse but right": (PENDULUM, 2.0, {"rtol": 1e-6, "atol": 1e-6}),
    "hardly moved": (PENDULUM, 2.0, {"times": np.linspace(0.0, 1e-6, 5)}),
    "hardly moved, certified": (PENDULUM, 1e-6, {"backend": "recursion"}),
    "loops": (lambda: gauss.load("four_bar"), 1.0, {}),
    "impacts": (bouncing, 2.0, {}),
    "no energy at all": (lambda: sliding(lambda t: 0.0 * t), 1.0, {}),
    "symplectic": (PENDULUM, 2.0, {"integrator": "gauss4", "step": 1e-2}),
    "library": (PENDULUM, 1.0, {"integrator": "scipy_dop853"}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", GOOD)
def test_good_motions_are_left_alone(name):
    make, duration, options = GOOD[name]
    system = gauss.compile_scene(make())
    for _ in range(CALLS):
        assert not _told(lambda: gauss.simulate(system, duration, **options))


@pytest.mark.slow
def test_what_a_stop_holds_at_rest_is_left_alone_whatever_its_mass():
    """All its energies are rounding: neither a dust grain nor a ship has moved."""
    for mass in (1e-12, 1.0, 1e9):
        for gravity in ((0, 0, 0), (0, 0, -9.81)):
            scene = gauss.Scene("held", gravity=gravity)
            scene.body("b", mass, (mass,) * 3)
            scene.prismatic("P", "ground", "b", axis=(0, 0, 1))
            scene.stop("P", lowest=0.0)
            scene.drive("P", force=-mass)
            for options in ({}, {"integrator": "time_stepping", "step": 0.01}):
                assert not _told(lambda: gauss.simulate(scene, 1.0, **options))  # noqa: B023


@pytest.mark.slow
def test_a_box_that_landed_by_time_stepping_is_told_only_of_gross_errors():
    """A fall of 1 m by steps of h is off by h g t / 2 / (g t² / 2) = h / t of its energy, t the time that it takes."""
    scene = falling()
    for step, tells in ((0.005, 0), (0.1, 1)):
        motion = []
        said = _told(lambda: motion.append(gauss.simulate(scene, 1.0, integrator="time_stepping", step=step)))  # noqa: B023
        found = gauss.energy(motion[0])
        share = np.abs(found.balance).max() / found.scale
        assert len(said) == tells == int(share > balance.FIRST_ORDER), share


def test_advice_names_laws_that_cannot_be_traced():
    scene, options = opaque(1.0, **COARSE)
    (said,) = _told(lambda: gauss.simulate(scene, 2.0, **options))
    assert repr(next(iter(scene.loads))) in str(said.message) and "breaks" in str(said.message)


def test_a_look_is_the_energy_of_the_audit_in_numbers_and_in_machine_code(swinging):
    motion = gauss.simulate(swinging, 1.0, integrator="rk4", step=1e-2)
    whole, found = gauss.energy(motion), motion.energies
    assert abs(found.initial - whole.kinetic[0] - whole.potential[0]) <= ROUNDING * whole.scale
    assert abs(found.off - np.abs(whole.balance).max()) <= 1e-2 * whole.scale * balance.WRONG  # it looks less often
    state = kinematics(swinging, motion.state(-1))
    kinetic, potential, total, magnitude = look_at_energies(state, [1.0, 2.0, 4.0])
    assert kinetic == kinetic_energy_of_bodies(state) and potential == potential_energy(state)
    assert abs(total - (kinetic + potential + 1.0)) <= ROUNDING * magnitude and magnitude >= abs(potential)
    by_numpy, by_code = balance._energies(motion)[:5], None
    for _ in range(CALLS):  # until there is machine code
        by_code = balance._energies(motion)[:5]
    assert swinging.dynamics.on_demand((balance._kernel,), lambda: None) is not None
    assert np.abs(by_numpy - by_code).max() <= ROUNDING * magnitude


def test_a_report_looks_at_every_sample(swinging):
    good, bad = gauss.simulate(swinging, 1.0), _quietly(swinging)
    assert not _told(lambda: warn_of_balance(good))
    (said,) = _told(lambda: warn_of_balance(bad))
    assert said.filename == __file__


@pytest.mark.parametrize("spoilt", [None, np.nan, np.inf, 1.7e308])
@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_a_record_of_all_samples_is_that_of_one_after_the_other(count, spoilt):
    rng = np.random.default_rng(count)
    times, samples = np.sort(rng.random(count)), rng.standard_normal((count, 4))
    if spoilt is not None:
        samples[count // 2, 2], samples[-1, 0] = spoilt, spoilt
    expected = initial_energy_record(samples[0])
    with np.errstate(invalid="ignore", over="ignore"):
        for t, sample in zip(times[1:], samples[1:], strict=True):
            expected = updated_energy_record(expected, t, sample)
        np.testing.assert_array_equal(recorded_energies(times, samples), expected)


def _hanging(system):
    """Coordinates of a double pendulum that hangs down."""
    still = np.zeros(system.n_v)
    lower = lambda q: potential_energy(kinematics(system, system.state(q, still)))  # noqa: E731
    places = np.linspace(-np.pi, np.pi, 9)  # the links hang down along one of these
    return min((np.array([a, b]) for a in places for b in places), key=lower)


def _told(run) -> list:
    """Warnings of the energy balance in a call."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run()
    return [one for one in said if one.category is BalanceWarning]


def _quietly(system):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BalanceWarning)
        return gauss.simulate(system, 2.0, **COARSE)


def test_a_printed_motion_says_how_far_its_energy_is_off():
    motion = gauss.simulate(gauss.load("pendulum"), 0.1, progress=False)
    first, *_, last = str(motion).splitlines()
    assert first == repr(motion) and f"{motion.energies.off:.3g} J" in last
    unknown = gauss.Trajectory.from_coordinates(motion.system, motion.t, motion.q)
    assert "unknown" in str(unknown).splitlines()[-1]
