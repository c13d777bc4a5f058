"""Every integrator against closed forms: its order on plain coordinates, on the manifold, with loops; drift and samples."""

import numpy as np
import pytest

import gauss
from gauss.dynamics import STABILISATIONS
from gauss.errors import SimulationError
from gauss.integrators import IMPLICIT, LIBRARIES, METHODS, Cost, FixedStep, Tolerance
from tests.support import closed_forms, mechanisms
from tests.support.orders import FORCED, GENTLE, MECHANICAL, order_of

SLOPE = 0.1  # of the measured order against theory
CLOSED = 1e-12  # gap of a loop of metres, after projection
LOOSE = {"rtol": 0.9, "atol": 1.0}  # a method that chooses its step then takes the largest that it is given

# Steps in a second, for each order: where errors fall like h^p (1 + c h), well above rounding.
STEPS = {1: (200, 400, 800), 2: (40, 60, 80, 100), 4: (20, 30, 40, 60, 80), 5: (40, 50, 60, 70, 80), 6: (8, 10, 12, 14, 16)}
IN_NUMBERS = [name for name, method in METHODS.items() if not method.mechanical]


def errors_of(scene, integrator, steps, **options):
    exact = scene.exact(scene.duration)
    for count in steps:
        h = scene.duration / count
        motion = gauss.simulate(scene.scene, scene.duration, integrator=integrator, step=h, **LOOSE, **options)
        yield np.abs(scene.observe(motion)[-1] - exact).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", closed_forms.SCENES)
@pytest.mark.parametrize("integrator", [name for name in METHODS if name not in ("dop853", "taylor")])
def test_order(integrator, name):
    """Error of coordinates and rates against the closed form falls with the order of the method."""
    steps, order = STEPS[METHODS[integrator].order], METHODS[integrator].order
    errors = list(errors_of(closed_forms.SCENES[name](), integrator, steps))
    assert order_of(steps, errors) == pytest.approx(order, abs=SLOPE)


def _fixed(method) -> FixedStep:
    """Steps of a pair as they are, without control."""

    def step(equations, point, h):
        return method.attempt(equations, point, h, Tolerance(1.0, 1.0, 1.0)).point, Cost(method.evaluations)

    return FixedStep(f"{method.name} of one step", method.title, method.order, method.reference, method.evaluations, step)


@pytest.mark.slow
@pytest.mark.parametrize("name", GENTLE)
def test_order_of_dop853(name):
    build, steps = GENTLE[name]
    assert order_of(steps, list(errors_of(build(), _fixed(METHODS["dop853"]), steps))) == pytest.approx(8, abs=SLOPE)


@pytest.mark.slow
@pytest.mark.parametrize("stabilisation", STABILISATIONS)
def test_order_survives_drift_control(stabilisation):
    integrator, order = ("radau5", 5) if stabilisation == "ggl" else ("rk4", 4)
    errors = list(errors_of(closed_forms.SCENES["loop"](), integrator, STEPS[4], stabilisation=stabilisation))
    assert order_of(STEPS[4], errors) == pytest.approx(order, abs=SLOPE)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", METHODS)
def test_samples_do_not_change_a_motion(integrator):
    """Samples between steps are as good as the steps, and the motion goes on as if there were none."""
    scene = closed_forms.SCENES["pendulum"]()
    end = 0.1003  # the last step is cut short
    options = {"integrator": integrator, "step": 0.002, "rtol": 1e-9, "atol": 1e-11}
    plain = gauss.simulate(scene.scene, end, **options)
    times = np.unique([*np.linspace(0.0, end, 37), *plain.t])
    sampled = gauss.simulate(scene.scene, end, times=times, **options)
    kept = np.isin(sampled.t, plain.t)
    assert np.array_equal(sampled.q[kept], plain.q) and np.array_equal(sampled.v[kept], plain.v)
    exact = np.array([scene.exact(t) for t in times])
    error = np.abs(scene.observe(sampled) - exact).max(axis=1)
    assert error[~kept].max() <= 1.5 * error[kept].max() + 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("integrator", IN_NUMBERS)
def test_machine_code_steps_as_numpy_does(integrator):
    """The loop in machine code and the same source on numbers make the same steps."""
    scene = mechanisms.two_bodies("ball", 1)
    scene.start("A", rate=(1.0, -2.0, 3.0))
    times = np.array([0.0, 0.003, 0.01, 0.0137, 0.02])
    options = {"integrator": integrator, "step": 0.004, "times": times, "rtol": 1e-7}
    one, two = gauss.simulate(scene, 0.02, **options), gauss.simulate(scene, 0.02, backend="recursion", **options)
    assert np.abs(one.q - two.q).max() <= 1e-11 and np.abs(one.v - two.v).max() <= 1e-9
    assert (one.stats.steps, one.stats.rejected) == (two.stats.steps, two.stats.rejected)
    assert np.array_equal(one.t, times)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"stabilisation": "baumgart"}, "baumgarte"),
        ({"stabilisation": "ggl"}, "'dop853' knows no stabilisation 'ggl'; use 'radau5'"),
        ({"stabilisation": gauss.Baumgarte}, "no stabilisation"),
        ({"atol": (1e-9, 1e-9, 1e-9)}, "pair"),
        ({"atol": (1e-9, 0.0)}, "atol: expected a positive"),
        ({"integrator": "dopri5", "step": -1.0}, "step"),
        ({"integrator": gauss.generalised_alpha()}, "fixed step"),
        ({"integrator": gauss.generalised_alpha}, "no integrator"),
    ],
)
def test_wrong_settings_are_refused(options, words):
    with pytest.raises(SimulationError, match=words):
        gauss.simulate(mechanisms.rods(1), 1.0, **options)


@pytest.mark.parametrize("gains", [(-1.0, None), (np.nan, 1.0), (1.0, np.inf)])
def test_wrong_gains_are_refused(gains):
    with pytest.raises(SimulationError, match="Baumgarte: (alpha|beta)"):
        gauss.Baumgarte(*gains)


@pytest.mark.slow
def test_absolute_tolerances_of_coordinates_and_of_rates():
    """Rates that may be coarse save steps, rates that must be fine cost steps."""
    steps = [
        gauss.simulate(mechanisms.rods(2), 1.0, rtol=1e-14, atol=atol).stats.steps
        for atol in (1e-10, (1e-10, 1e-10), (1e-10, 1e-4), (1e-10, 1e-12))
    ]
    assert steps[3] > steps[0] == steps[1] > steps[2]


@pytest.mark.slow
@pytest.mark.parametrize("scene", FORCED)
@pytest.mark.parametrize("integrator", MECHANICAL)
def test_mechanical_methods_know_all_forces(integrator, scene):
    """Loads, dampers, moving constraints, gear trains: the same motion as by DOP853, and the work that was done."""
    system = gauss.compile_scene(FORCED[scene]())
    exact = gauss.simulate(system, 0.2, rtol=1e-12, atol=1e-13, times=[0.2])
    errors, coarsest = [], {2: 0.002, 4: 0.004, 6: 0.008}[METHODS[integrator].order]
    for h in (coarsest, coarsest / 2):
        motion = gauss.simulate(system, 0.2, integrator=integrator, step=h, times=[0.2])
        errors.append([np.abs(getattr(motion, part) - getattr(exact, part)).max() for part in ("q", "v", "work")])
    order = METHODS[integrator].order
    coarse, fine = np.array(errors)
    sizes = np.array([max(1.0, np.abs(getattr(exact, part)).max()) for part in ("q", "v", "work")])
    assert (fine <= 1.3 * coarse / 2**order + 1e-11 * sizes).all()


@pytest.mark.slow
@pytest.mark.parametrize("scene", [lambda: mechanisms.rods(2), mechanisms.four_bar], ids=["double pendulum", "four-bar"])
@pytest.mark.parametrize("integrator, largest", [("verlet", 2e-2), ("gauss4", 3e-7)])
def test_energy_of_symplectic_methods_is_bounded(integrator, largest, scene):
    """The energy error does not grow: its trend over 20 000 steps is lost in what it swings."""
    steps, h = 20000, 0.002
    motion = gauss.simulate(scene(), steps * h, integrator=integrator, step=h, times=np.linspace(0.0, steps * h, 1001))
    energy = gauss.energy(motion)
    off = (energy.kinetic + energy.potential) / energy.scale
    off -= off[0]
    trend = np.polyfit(motion.t, off, 1)[0] * motion.t[-1]
    assert np.abs(off).max() <= largest
    assert abs(trend) <= 0.2 * np.abs(off).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene, h, largest",
    [(lambda: gauss.load("double_pendulum"), 5e-4, 5e-14), (mechanisms.four_bar, 5e-4, 3e-13)],
    ids=["double pendulum", "four-bar"],
)
def test_energy_of_gauss6_walks_at_random(scene, h, largest):
    """Of 20 000 steps nothing is left but rounding: not its sum, which would be 1e-12 and grow with the steps."""
    times = np.linspace(0.0, 20000 * h, 1001)
    motion = gauss.simulate(scene(), times[-1], integrator="gauss6", step=h, times=times)
    energy = gauss.energy(motion)
    assert np.ptp((energy.kinetic + energy.potential) / energy.scale) <= largest


@pytest.mark.slow
@pytest.mark.parametrize("integrator", MECHANICAL)
def test_mechanical_methods_say_what_they_need(integrator):
    with pytest.raises(SimulationError, match="'knife edge|binds velocities"):
        gauss.simulate(gauss.load("rolling_disk"), 0.1, integrator=integrator, step=0.01)
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.5 else 2.0)
    with pytest.raises(SimulationError, match="law of .*J1.* Use integrator 'dop853'"):
        gauss.simulate(scene, 0.1, integrator=integrator, step=0.01)


@pytest.mark.slow
def test_a_step_that_cannot_be_solved_says_so():
    with pytest.raises(SimulationError, match="shorten the step"):
        gauss.simulate(mechanisms.four_bar(), 10.0, integrator="gauss4", step=0.5)


def test_maps_of_the_chart_are_inverse():
    from gauss import rotations

    rng = np.random.default_rng(0)
    for size in (0.0, 1e-9, 1e-3, 0.0299, 0.0301, 1.0, 3.0):
        theta, omega = rng.normal(size=3), rng.normal(size=3)
        theta *= size / np.linalg.norm(theta)
        again = rotations.rotation_vector_velocity(theta, rotations.rotation_vector_rate(theta, omega))
        assert np.abs(again - omega).max() <= 1e-12


@pytest.mark.slow
def test_stiff_scenes_cost_radau_no_small_steps():
    """A joint spring of 1e6 N m/rad with a damper: explicit steps are as short as its decay, implicit ones as the motion."""
    scene = mechanisms.rods(2)
    scene.joint_spring("S", "J2", stiffness=1e6, damping=1e4, rest=0.0)
    scene.start("J1", 0.3)
    scene.start("J2", 0.1)
    motions = {
        name: gauss.simulate(scene, 0.5, integrator=name, rtol=1e-6, atol=1e-8, times=[0.5]) for name in ("radau5", "dop853")
    }
    assert np.abs(motions["radau5"].q - motions["dop853"].q).max() <= 1e-6
    assert motions["radau5"].stats.steps * 20 < motions["dop853"].stats.steps
    assert 0 < motions["radau5"].stats.factorisations <= 3 * motions["radau5"].stats.steps
    assert motions["dop853"].stats.factorisations == 0


@pytest.mark.parametrize("start", [(1.0, 1.0), (1.2, -1.6)])
def test_newton_in_machine_code_is_that_of_numbers(start):
    """Two circles that meet: both iterations find the point, and say when there is none."""
    from gauss.codegen import trace
    from gauss.integrators.iterate import newton

    def solved(x, radius):
        found = newton(lambda u: np.array([u @ u - radius[0], (u[0] - 1.0) ** 2 + u[1] ** 2 - 2.0]), x, 1e-3, np.ones(2))
        return found.x, [found.unsolved]

    kernel = trace(solved, 2, 1, batch=False)
    x, y, unsolved = kernel(np.array([*start, 3.0]))
    assert (x, abs(y)) == pytest.approx((1.0, np.sqrt(2.0)), abs=1e-14) and unsolved == 0.0
    numbers, flag = solved(np.array(start), np.array([3.0]))
    assert np.abs(numbers - (x, y)).max() <= 1e-12 and flag == [0.0]
    assert kernel(np.array([*start, 60.0]))[2] > 0.0
    assert solved(np.array(start), np.array([60.0]))[1][0] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 1.0])
def test_generalised_alpha_damps_high_frequencies_as_asked(rho):
    """A spring whose period is a thousandth of the step loses the share 1 − ρ∞ of its amplitude in a step, on average."""
    scene = gauss.Scene("spring", gravity=(0, 0, 0))
    scene.body("mass", mass=1.0)
    scene.prismatic("S", "ground", "mass", axis=(1, 0, 0))
    scene.joint_spring("K", "S", stiffness=(2e3 * np.pi) ** 2)
    scene.start("S", 1e-3)
    motion = gauss.simulate(scene, 160.0, integrator=gauss.generalised_alpha(rho), step=1.0)
    late, later = (np.abs(motion.q[k : k + 10, 0]).max() for k in (100, 140))
    assert (later / (late + 1e-300)) ** (1 / 40) == pytest.approx(rho, abs=0.05) or late <= 1e-20


@pytest.mark.parametrize("rho", [-0.1, 1.1, np.nan])
def test_wrong_damping_is_refused(rho):
    with pytest.raises(SimulationError, match="rho: expected a number from 0 to 1"):
        gauss.generalised_alpha(rho)


@pytest.mark.slow
@pytest.mark.parametrize("name", closed_forms.SCENES)
@pytest.mark.parametrize("integrator", [method.name for method in (*LIBRARIES, *IMPLICIT)])
def test_methods_of_other_libraries(integrator, name):
    """They see the same equations: the same motion within their tolerance, at the times asked for, on the constraints."""
    scene = closed_forms.SCENES[name]()
    times = np.array([0.25, 1.0])
    motion = gauss.simulate(scene.scene, 1.0, integrator=integrator, rtol=1e-9, atol=1e-11, times=times)
    assert np.array_equal(motion.t, times)
    assert np.abs(scene.observe(motion)[-1] - scene.exact(1.0)).max() <= 1e-6
    assert mechanisms.largest_gap(motion) <= CLOSED if motion.system.has_closures else True
    every = gauss.simulate(motion.system, 0.1, integrator=integrator)
    assert every.t[0] == 0.0 and every.t[-1] == pytest.approx(0.1) and every.stats.steps == len(every) - 1


@pytest.mark.slow
@pytest.mark.parametrize("integrator", [method.name for method in LIBRARIES])
def test_methods_of_other_libraries_take_laws_of_python(integrator):
    def scene():
        scene = mechanisms.rods(1)
        scene.drive("J1", torque=lambda t: float(np.sin(t)))
        return scene

    one = gauss.simulate(scene(), 0.2, integrator=integrator, rtol=1e-8, atol=1e-10, times=[0.2])
    two = gauss.simulate(scene(), 0.2, rtol=1e-10, atol=1e-12, times=[0.2])
    assert np.abs(one.q - two.q).max() <= 1e-6 and np.abs(one.work - two.work).max() <= 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("scene", FORCED)
def test_ida_knows_all_forces(scene):
    """Loads, dampers, moving constraints, gear trains: the same motion as by DOP853, and the work that was done."""
    system = gauss.compile_scene(FORCED[scene]())
    exact = gauss.simulate(system, 0.2, rtol=1e-12, atol=1e-13, times=[0.2])
    motion = gauss.simulate(system, 0.2, integrator="ida", rtol=1e-10, atol=1e-12, times=[0.2])
    assert np.abs(motion.q - exact.q).max() <= 1e-7 and np.abs(motion.work - exact.work).max() <= 1e-5


@pytest.mark.slow
def test_ida_says_what_it_cannot_do():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.5 else 2.0)
    with pytest.raises(SimulationError, match="'ida'"):
        gauss.simulate(scene, 0.1, integrator="ida")
    with pytest.raises(SimulationError, match="'ida' gave up: ") as caught:
        gauss.simulate(gauss.load("bricard"), 2.0, integrator="ida", rtol=1e-8, atol=1e-8)  # a row too many
    found = caught.value.trajectory
    assert found.t[-1] < 2.0 and f"t = {found.t[-1]:.6g} s" in str(caught.value)  # no sample of a time that was not reached
    with pytest.raises(SimulationError, match="'ida'.*partitioning"):
        gauss.simulate(mechanisms.four_bar(), 0.1, integrator="ida", stabilisation="partitioning")


@pytest.mark.slow
@pytest.mark.parametrize("name", closed_forms.SCENES)
@pytest.mark.parametrize(
    "integrator", ["dop853", "taylor", "dopri5", "radau5", "rk4", "gauss4", "verlet", "semi_implicit_euler"]
)
def test_global_error_is_that_against_the_closed_form(integrator, name):
    scene = closed_forms.SCENES[name]()
    times, options = np.linspace(0.0, 1.0, 6), {"rtol": 1e-6, "atol": 1e-8, "step": None if "5" in integrator else 0.01}
    motion = gauss.simulate(scene.scene, 1.0, integrator=integrator, times=times, verify=True, **options)
    error = np.abs(scene.observe(motion) - np.array([scene.exact(t) for t in times]))
    if name == "free body":
        error[:, 3:7] = 2.0 * np.linalg.norm(error[:, 3:7], axis=1, keepdims=True)  # an angle, twice that of quaternions
    assert max(motion.stats.global_error) == pytest.approx(error.max(), rel=0.2, abs=1e-13)
    assert gauss.simulate(scene.scene, 0.1, step=0.01).stats.global_error is None


def test_crossings_are_found_to_rounding():
    """A pendulum passes the vertical at odd quarters of its period, and turns at even ones."""
    from scipy.special import ellipk

    scene = closed_forms.SCENES["pendulum"]()
    quarter = ellipk(np.sin(1.0) ** 2) / np.sqrt(9.81)
    motion = gauss.simulate(scene.scene, 4.5 * quarter)
    passes = gauss.crossings(motion, lambda motion: motion.coordinate("A"))
    assert [state.t for state in passes] == pytest.approx([quarter, 3 * quarter], abs=1e-8)  # the motion has that error
    assert max(abs(state.q[0]) for state in passes) <= 1e-14
    assert len(gauss.crossings(motion, lambda motion: motion.coordinate("A"), direction=1)) == 1
    turns = gauss.crossings(motion, lambda motion: motion.rate("A"))
    assert [state.t for state in turns] == pytest.approx([0.0, 2 * quarter, 4 * quarter], abs=1e-8)
    with pytest.raises(SimulationError, match="direction"):
        gauss.crossings(motion, lambda motion: 1.0, direction=2)
    with pytest.raises(SimulationError, match="expected a number"):
        gauss.crossings(motion, lambda motion: np.nan)


@pytest.mark.slow
def test_stabilised_index_2_takes_loads_and_samples():
    """Drives, dampers, a prescribed motion, gears: as by DOP853, with samples between the steps."""
    times = np.linspace(0.0, 0.2, 9)
    for scene in FORCED.values():
        system = gauss.compile_scene(scene())
        exact = gauss.simulate(system, 0.2, rtol=1e-12, atol=1e-13, times=times)
        options = {"integrator": "radau5", "stabilisation": "ggl", "rtol": 1e-8, "atol": 1e-10}
        motion = gauss.simulate(system, 0.2, times=times, **options)
        assert np.abs(motion.q - exact.q).max() <= 1e-7 and np.abs(motion.work - exact.work).max() <= 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("integrator", [*MECHANICAL, "radau5"])
def test_implicit_methods_bear_coordinates_that_have_grown(integrator):
    """A crank that has turned 1300 times leaves fewer digits behind the point: equations count as solved within these."""
    system = gauss.compile_scene(mechanisms.four_bar())
    start = system.initial_state()
    turned = system.state(start.q + 2600 * np.pi * np.array([1.0, -1.0, 0.0, 0.0]), start.v)
    way = {"stabilisation": "ggl"} if integrator == "radau5" else {"step": 1e-3}
    options = {"integrator": integrator, "times": [0.7]} | way
    near, far = (gauss.simulate(system, 0.7, state=state, **options) for state in (start, turned))
    assert np.abs(near.q - start.q - (far.q - turned.q)).max() <= 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["gauss4", "gauss6"])
def test_a_mechanical_method_has_no_fallback(integrator):
    """A step beyond the singular configuration of a ladder: accelerations of single states do not continue the method."""
    with pytest.raises(SimulationError, match="needs the equations of motion in machine code") as caught:
        gauss.simulate(gauss.load("n_four_bar", n=1), 10.0, integrator=integrator, step=0.3125, progress=False)
    assert caught.value.trajectory.t[-1] < 10.0
