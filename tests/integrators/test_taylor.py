"""Taylor's method: order, errors that follow the tolerance, dense output, constraints, work, and what it refuses."""

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.errors import SimulationError
from tests.support import closed_forms, mechanisms
from tests.support.orders import FORCED, GENTLE, order_of

SLOPE = 0.1  # of the measured order against theory
FOLLOWS = 300.0  # error at the end over the tolerance: what motions of a second with rates of 10/s make of a local error
WORK = 1e-9  # of its size: it follows from the motion, without control of its own
CLOSED = 1e-12  # gap of a loop of metres, after projection
# of the scale, over 100 s with a tolerance of 1e-15: rounding alone; in the four-bar the projection rounds 1000 rad
ENERGY = {"double_pendulum": 1e-13, "four_bar": 1e-11, "heavy_top": 1e-13}
COARSE = {"rtol": 0.9, "atol": 1e3}  # steps are then as long as they are given
STEPS = np.array([12, 14, 16, 18, 20, 24])


def _errors(scene, settings) -> list[float]:
    """Errors at the end, with one setting after the other."""
    system, exact = gauss.compile_scene(scene.scene), scene.exact(scene.duration)
    motions = (gauss.simulate(system, scene.duration, **given) for given in settings)
    return [float(np.abs(scene.observe(motion)[-1] - exact).max()) for motion in motions]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")  # long steps are meant
@pytest.mark.parametrize("name", GENTLE)
@pytest.mark.parametrize("order", [3, 6])
def test_order(order, name):
    """With steps of one length, the error falls with the order that was given."""
    scene = GENTLE[name][0]()
    settings = [{"step": scene.duration / n, "integrator": gauss.Taylor(order)} | COARSE for n in STEPS]
    assert order_of(STEPS, _errors(scene, settings)) == pytest.approx(order, abs=SLOPE)


@pytest.mark.slow
@pytest.mark.parametrize("name", closed_forms.SCENES)
def test_error_follows_the_tolerance(name):
    tolerances = np.array([1e-3, 1e-6, 1e-9, 1e-12])
    settings = [{"integrator": "taylor", "rtol": tolerance, "atol": tolerance} for tolerance in tolerances]
    assert (_errors(closed_forms.SCENES[name](), settings) <= FOLLOWS * tolerances).all()


@pytest.mark.slow
@pytest.mark.parametrize("start", [np.pi / 2, 1e-9, 3.0])
def test_missing_terms_make_no_step_too_long(start):
    """Of a pendulum let go from the horizontal, the series has every fourth term."""
    tolerances = 10.0 ** -np.arange(4, 17)
    settings = [{"integrator": "taylor", "rtol": tolerance, "atol": tolerance} for tolerance in tolerances]
    assert (_errors(closed_forms.pendulum(start), settings) <= FOLLOWS * np.maximum(tolerances, 1e-15)).all()


@pytest.mark.slow
@pytest.mark.parametrize("power", [3, 7, 11])
def test_a_series_may_begin_with_nothing_but_its_first_term(power):
    """A mass on a spring of force −xⁿ starts in the middle: its series has every (n + 1)th term."""

    def spring(t, motion):
        return -(motion.coordinate("X") ** power)

    scene = gauss.Scene("spring", gravity=(0, 0, 0))
    scene.body("mass", 1.0)
    scene.prismatic("X", "ground", "mass", axis=(1, 0, 0))
    scene.drive("X", torque=spring)
    scene.start("X", 0.0, 1.0)
    system = gauss.compile_scene(scene)
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12):
        motion = gauss.simulate(system, 2.0, integrator="taylor", rtol=tolerance, atol=tolerance, times=[1.0, 2.0])
        x, v = motion.coordinate("X"), motion.rate("X")
        energy = 0.5 * v**2 + x ** (power + 1) / (power + 1)
        assert np.abs(energy - 0.5).max() <= FOLLOWS * tolerance


@pytest.mark.slow
def test_finer_tolerances_take_higher_orders_and_few_more_steps():
    system, steps, orders = gauss.compile_scene(mechanisms.rods(2)), [], []
    for tolerance in (1e-3, 1e-6, 1e-8):
        stats = gauss.simulate(system, 1.0, integrator="taylor", rtol=tolerance, atol=tolerance).stats
        steps.append(stats.steps)
        orders.append(stats.evaluations / stats.steps)
    assert steps[2] <= 4 * steps[0] and orders[0] < orders[1] < orders[2]


@pytest.mark.slow
@pytest.mark.parametrize("scene", FORCED)
def test_all_forces_and_their_work(scene):
    """Loads, dampers, moving constraints, gear trains: the motion and the work of DOP853, on a grid between the steps."""
    system, times = gauss.compile_scene(FORCED[scene]()), np.linspace(0.0, 0.5, 23)
    options = {"times": times, "rtol": 1e-13, "atol": 1e-13}
    one, two = (gauss.simulate(system, 0.5, integrator=name, **options) for name in ("taylor", "dop853"))
    for part, allowed in (("q", 1e-10), ("v", 1e-10), ("work", WORK)):
        size = max(1.0, np.abs(getattr(two, part)).max())
        assert np.abs(getattr(one, part) - getattr(two, part)).max() <= allowed * size
    assert mechanisms.largest_gap(one) <= CLOSED if system.has_closures else True


@pytest.mark.slow
@pytest.mark.parametrize("stabilisation", ["none", "baumgarte"])
def test_other_ways_against_drift(stabilisation):
    options = {"times": [1.0], "rtol": 1e-13, "atol": 1e-13}
    one = gauss.simulate(mechanisms.four_bar(), 1.0, integrator="taylor", stabilisation=stabilisation, **options)
    two = gauss.simulate(mechanisms.four_bar(), 1.0, **options)
    assert np.abs(one.q - two.q).max() <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("scene", ENERGY)
def test_energy_is_kept_to_rounding(scene):
    times = np.linspace(0.0, 100.0, 201)
    motion = gauss.simulate(gauss.load(scene), 100.0, integrator="taylor", rtol=1e-15, atol=1e-15, times=times)
    energy = gauss.energy(motion)
    assert np.ptp((energy.kinetic + energy.potential) / energy.scale) <= ENERGY[scene]


def test_estimate_of_the_global_error():
    scene = closed_forms.SCENES["pendulum"]()
    motion = gauss.simulate(scene.scene, 1.0, integrator="taylor", rtol=1e-6, atol=1e-6, verify=True, times=[0.5, 1.0])
    error = np.abs(scene.observe(motion) - [scene.exact(t) for t in motion.t]).max()
    assert error <= 2.0 * max(motion.stats.global_error) <= 20.0 * error


def _clutch():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: math.where(t < 0.5, 1.0, 2.0))
    return scene


def _rough():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t, motion: -math.abs(motion.rate("J1")))
    return scene


def _hidden():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.5 else 2.0)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    "build, options, words",
    [
        (_clutch, {}, "'drive of J1' uses less, select.* Use integrator 'dop853'"),
        (_rough, {}, "'drive of J1' uses max.* Use integrator 'dop853'"),
        (_hidden, {}, "law of .*J1.* Use integrator 'dop853'"),
        (lambda: gauss.load("newtons_cradle"), {}, "'taylor' does not locate the events"),
        (lambda: gauss.load("n_pendulum", n=60), {}, "more than 40 bodies"),
        (lambda: mechanisms.rods(1), {"backend": "kkt"}, "'taylor' needs the equations of motion in machine code"),
        (mechanisms.four_bar, {"stabilisation": "partitioning"}, "'taylor' knows no stabilisation by partitioning"),
        (mechanisms.four_bar, {"stabilisation": "ggl"}, "'taylor' knows no stabilisation 'ggl'"),
    ],
)
def test_what_it_cannot_do_is_said(build, options, words):
    with pytest.raises(SimulationError, match=words):
        gauss.simulate(build(), 0.1, integrator="taylor", **options)


@pytest.mark.parametrize("terms", [1, 25, -3])
def test_orders_that_do_not_exist(terms):
    with pytest.raises(SimulationError, match="terms.*2 to 24"):
        gauss.Taylor(terms)


def test_many_motions_are_for_others():
    with pytest.raises(SimulationError, match="no integrator 'taylor' for many motions"):
        gauss.rollout(gauss.compile_scene(mechanisms.rods(1)), [[0.1]], [[0.0]], integrator="taylor", times=[0.1])


@pytest.mark.slow
@pytest.mark.parametrize("name, options", [("n_pendulum", {"n": 10}), ("andrews_squeezer", {})])
def test_long_equations(name, options):
    """Equations that are cut into pieces: the motion of DOP853."""
    system, duration = gauss.compile_scene(gauss.load(name, **options)), 0.02
    ends = [gauss.simulate(system, duration, integrator=method, times=[duration]).q[-1] for method in ("taylor", "dop853")]
    assert np.abs(ends[0] - ends[1]).max() <= 1e-11
