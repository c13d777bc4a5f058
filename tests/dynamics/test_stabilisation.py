"""Control of drift: what each way leaves of the constraints, what it needs, and that the motion stays the same."""

import numpy as np
import pytest

import gauss
from gauss.dynamics import STABILISATIONS
from gauss.dynamics.assemble import position_residual
from gauss.errors import SimulationError
from tests.support import mechanisms
from tests.support.mechanisms import largest_gap

BROUGHT_BACK = 1e-10  # gap with which a step of machine code goes on
CLOSED = 1e-12  # gap of a loop of metres, after projection


@pytest.mark.slow
def test_drift():
    """Projection leaves rounding; Baumgarte's method less than no control at all; each on its own way to the same motion."""
    end = np.linspace(0.0, 3.0, 20)
    gaps, ends = {}, {}
    for stabilisation in STABILISATIONS:
        options = {
            "times": end,
            "integrator": "radau5" if stabilisation == "ggl" else "dop853",
            "stabilisation": stabilisation,
        }
        motion = gauss.simulate(mechanisms.four_bar(), 3.0, rtol=1e-7, atol=1e-9, **options)
        gaps[stabilisation], ends[stabilisation] = largest_gap(motion), motion.q[-1]
    assert max(gaps["projection"], gaps["partitioning"], gaps["ggl"]) <= CLOSED
    assert 10 * CLOSED < gaps["baumgarte"] < gaps["none"] / 3
    for stabilisation in STABILISATIONS:
        assert np.abs(ends[stabilisation] - ends["projection"]).max() <= 1e-4


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("backend", ["auto", "recursion"])
def test_gains_of_baumgarte_are_those_given(backend):
    """A gap left to itself dies like (1 + α t) e^(−αt) by the machine code, and by numpy."""
    scene = mechanisms.four_bar()
    system = gauss.compile_scene(scene)
    start, alpha, duration = system.initial_state(), 40.0, 0.1
    from gauss.dynamics.engines.certified import CertifiedEngine
    from gauss.dynamics.laws.traced_laws import Laws
    from gauss.dynamics.stabilisation import Drift
    from gauss.dynamics.traced_system import Program

    off = system.state(start.q + np.array([0.0, 1e-5, 0.0, 0.0]), start.v)
    gains = (alpha, alpha)
    if backend == "auto":
        n = system.n_v
        kernel = Program(system, Laws(system), Drift(False, gains)).forward()
        evaluate = lambda t, y: np.concatenate([y[n:], kernel(np.concatenate([[t], y, np.zeros(n)]))[:n]])  # noqa: E731
    else:
        solver, n = CertifiedEngine(backend, gains), system.n_v
        evaluate = lambda t, y: np.concatenate([y[n:], solver.rates(system, system.state(y[:n], y[n:])).acceleration])  # noqa: E731
    from scipy.integrate import solve_ivp

    y = solve_ivp(evaluate, (0, duration), np.concatenate([off.q, off.v]), rtol=1e-9, atol=1e-13).y[:, -1]
    from gauss.dynamics.kinematics import kinematics

    found = [np.abs(position_residual(kinematics(system, system.state(q)))).max() for q in (off.q, y[:n])]
    assert found[1] / found[0] == pytest.approx((1 + alpha * duration) * np.exp(-alpha * duration), rel=0.05)


@pytest.mark.slow
def test_partitioning_chooses_anew_where_a_choice_is_near_singular():
    """The crank of a four-bar turns fully, so no coordinate is independent all the way; adaptive steps and samples, too."""
    times = np.linspace(0.0, 2.0, 15)
    motions = [
        gauss.simulate(mechanisms.four_bar(), 2.0, rtol=1e-10, atol=1e-12, times=times, stabilisation=stabilisation)
        for stabilisation in ("partitioning", "projection")
    ]
    assert np.abs(motions[0].q - motions[1].q).max() <= 1e-7
    assert largest_gap(motions[0]) <= CLOSED
    assert motions[0].q[-1, 0] > 2 * np.pi


@pytest.mark.slow
def test_partitioning_says_what_it_needs():
    scene = mechanisms.four_bar()
    with pytest.raises(SimulationError, match="'verlet'.*partitioning"):
        gauss.simulate(scene, 0.1, integrator="verlet", step=0.01, stabilisation="partitioning")
    with pytest.raises(SimulationError, match="'partitioning'.*'recursion'"):
        gauss.simulate(scene, 0.1, backend="recursion", stabilisation="partitioning")
    tree = gauss.simulate(mechanisms.rods(1), 0.1, backend="recursion", stabilisation="partitioning", times=[0.1])
    assert tree.q == pytest.approx(gauss.simulate(mechanisms.rods(1), 0.1, times=[0.1]).q, abs=1e-9)


def test_pivots_are_the_columns_of_a_basis():
    from gauss.codegen import trace
    from gauss.codegen.kernels import Pivots

    rng = np.random.default_rng(3)
    for rank in (1, 2, 3):
        K = rng.normal(size=(3, rank)) @ rng.normal(size=(rank, 5))
        kernel = trace(lambda x: x[0].graph.call(Pivots(3, 5), x), 15, batch=False)
        chosen = kernel(K.T.ravel()) == 1.0
        assert chosen.sum() == rank == np.linalg.matrix_rank(K[:, chosen])


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"integrator": "generalised_alpha", "step": 1e-3},
        {"integrator": "radau5", "stabilisation": "ggl"},
        {"stabilisation": "partitioning"},
    ],
    ids=["generalised_alpha", "ggl", "partitioning"],
)
def test_redundant_constraints_do_no_harm(options):
    """Bricard's mechanism has a row too many wherever it goes: its multiplier is free, the motion is not."""
    system = gauss.compile_scene(gauss.load("bricard"))
    exact = gauss.simulate(system, 0.1, times=[0.1])
    motion = gauss.simulate(system, 0.1, times=[0.1], **options)
    assert np.abs(motion.q - exact.q).max() <= 1e-7 and largest_gap(motion) <= CLOSED


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")
@pytest.mark.parametrize("name", ["four_bar", "slider_crank"])
def test_long_steps_are_brought_back_by_machine_code(name):
    """They lead so far off the constraints that two Newton steps, which each step has, do not bring them back."""
    motion = gauss.simulate(gauss.load(name), 0.25, integrator="semi_implicit_euler", step=1 / 32)
    assert motion.stats.evaluations > 2 * motion.stats.steps + 2, "no step led far off"
    assert motion.stats.plan.driver == "compiled loop" and largest_gap(motion) <= BROUGHT_BACK


def test_partitioning_is_not_for_rolling():
    with pytest.raises(SimulationError, match="'contact'|velocit"):
        gauss.simulate(gauss.load("rolling_disk"), 0.1, stabilisation="partitioning")
