import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, SimulationError, StateError

LIMITS = {"A": ((-1.0, 1.5), 2.0, 8.0), "B": ((-2.0, 2.0), 3.0, 15.0)}
DIFFERENCE, ROUGH = 1e-5, 1e-6  # of central differences in time


@pytest.fixture(scope="module")
def series():
    return gauss.excitation(gauss.load("double_pendulum"), 5.0, harmonics=3, limits=LIMITS, trials=8)


@pytest.mark.slow
def test_the_series_keeps_its_limits_and_is_periodic(series):
    t = np.linspace(0.0, series.period, 4001)
    q, v, a = series.at(t)
    for k, name in enumerate(series.coordinates):
        (low, high), rate, acceleration = LIMITS[name]
        assert low <= q[:, k].min() and q[:, k].max() <= high
        assert np.abs(v[:, k]).max() <= rate and np.abs(a[:, k]).max() <= acceleration
    np.testing.assert_allclose(q[0], q[-1], atol=1e-12)


@pytest.mark.slow
def test_rates_are_derivatives(series):
    t = np.linspace(0.1, 4.0, 7)
    (less, v0, _), (more, v1, _) = series.at(t - DIFFERENCE), series.at(t + DIFFERENCE)
    _, v, a = series.at(t)
    np.testing.assert_allclose((more - less) / (2 * DIFFERENCE), v, atol=ROUGH)
    np.testing.assert_allclose((v1 - v0) / (2 * DIFFERENCE), a, atol=ROUGH)


@pytest.mark.slow
def test_it_identifies_better_than_random_series(series):
    """The least singular value grows: intervals of the worst parameter are narrower than by the first random series."""
    assert series.condition < series.random_condition
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    q, v, a = series.at(np.linspace(0.0, series.period, 200, endpoint=False))
    found = gauss.identify(system, q, v, a, system.inverse_dynamics(q, v, a))
    wanted = found.base.combinations @ gauss.regressor(system, q[0], v[0], a[0]).parameters
    np.testing.assert_allclose(found.base_values, wanted, rtol=1e-8, atol=1e-12)


LOOPS = {  # limits of the crank; the least lengths of links let it turn so far
    "four_bar": ((-1.0, 1.5), 2.0, 8.0),
    "slider_crank": ((-0.5, 2.0), 3.0, 12.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_a_linkage_is_identified_by_its_crank(name):
    """Forces along the series by forward dynamics, which are linear in them, on poses that are assembled one by one."""
    scene = gauss.load(name)
    scene.starts.clear()
    crank = {"independent": ["A"], "limits": {"A": LOOPS[name]}}
    found = gauss.excitation(scene, 4.0, harmonics=2, trials=4, **crank)
    assert found.coordinates == ("A",) and found.condition < found.random_condition
    system, t = gauss.compile_scene(scene), np.linspace(0.0, found.period, 60, endpoint=False)
    y, rate, acceleration = found.at(t)
    (low, high), *_ = LOOPS[name]
    assert low <= y.min() and y.max() <= high
    place, state, q = system.column("A"), system.initial_state(), []
    for value in [*np.linspace(state.q[place], y[0, 0], 20), *y[1:, 0]]:
        near = state.q.copy()
        near[place] = value
        state = system.initial_state(near, keep=["A"])
        q.append(state.q)
    q = np.array(q[19:])
    v = np.einsum("kij,kj->ki", system.null_space(q, independent=["A"]), rate)
    free, pushed = (system.forward_dynamics(q, v, np.tile(load, (len(q), 1))) for load in (0 * q[0], np.eye(4)[place]))
    torque = (acceleration[:, 0] - free[:, place]) / (pushed - free)[:, place]
    measured = free + torque[:, None] * (pushed - free)
    fit = gauss.identify(system, q, v, measured, {"A": torque}, independent=["A"], consistent=False)
    wanted = fit.base.combinations @ gauss.regressor(system, q[0], v[0], measured[0], independent=["A"]).parameters
    np.testing.assert_allclose(fit.base_values, wanted, rtol=0.0, atol=1e-8 * np.abs(wanted).max())


@pytest.mark.slow
def test_loops_that_do_not_close_are_refused():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    with pytest.raises(SimulationError, match="limits of D the loops"):
        wide = {"D": ((-3.0, 3.0), 100.0, 1e4)}
        gauss.excitation(scene, 5.0, harmonics=1, trials=3, independent=["D"], limits=wide)


def test_what_does_not_fit_is_refused():
    scene = gauss.load("double_pendulum")
    ball = gauss.Scene("ball")
    ball.ball("socket", "ground", ball.body("ball", 1.0, (0.1, 0.1, 0.1), com=(0.1, 0, 0)))
    with pytest.raises(SimulationError, match="socket"):
        gauss.excitation(ball, 5.0)
    with pytest.raises(StateError, match="expected 1 coordinates"):
        gauss.excitation(gauss.load("four_bar"), 5.0, independent=["A", "B"])
    with pytest.raises(ArgumentError, match="'C'"):
        gauss.excitation(scene, 5.0, limits={"C": ((0, 1), 1, 1)})
    with pytest.raises(ArgumentError, match="limits of 'A'"):
        gauss.excitation(scene, 5.0, limits={"A": ((1, 0), 1, 1)})
    with pytest.raises(ArgumentError, match="harmonics"):
        gauss.excitation(scene, 5.0, harmonics=0)
    with pytest.raises(SimulationError, match="positive"):
        gauss.excitation(scene, -1.0)


def _stopped(scene: str, joint: str):
    """A scene with stops of a joint 0.2 rad to both sides of its start."""
    found = gauss.load(scene)
    system = gauss.compile_scene(found)
    start = system.initial_state().q[system.column(joint)]
    found.stop(joint, lowest=start - 0.2, highest=start + 0.2)
    return found, start, {"independent": ["A"]} if system.has_closures else {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "four_bar"])
def test_series_keep_stops(name):
    scene, start, options = _stopped(name, "A")
    q = gauss.excitation(scene, 5.0, harmonics=2, trials=3, **options).at(np.linspace(0.0, 5.0, 101))[0]
    assert (np.abs(q - start) <= 0.2).all()
    wide = {"A": ((start - 3.0, start + 3.0), 1.0, 1.0)}
    with pytest.raises(gauss.errors.ArgumentError, match="limits of 'A'"):
        gauss.excitation(scene, 5.0, harmonics=2, trials=3, limits=wide, **options)


@pytest.mark.slow
def test_stops_of_joints_that_follow_are_kept():
    scene, _, options = _stopped("four_bar", "C")
    with pytest.raises(gauss.errors.SimulationError, match="stops of other joints"):
        gauss.excitation(scene, 5.0, harmonics=2, trials=3, **options)
