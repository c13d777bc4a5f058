import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, SimulationError

LIMITS = {"A": ((-1.0, 1.5), 2.0, 8.0), "B": ((-2.0, 2.0), 3.0, 15.0)}
DIFFERENCE, ROUGH = 1e-5, 1e-6  # of central differences in time


@pytest.fixture(scope="module")
def series():
    return gauss.excitation(gauss.load("double_pendulum"), 5.0, harmonics=3, limits=LIMITS, trials=8)


def test_the_series_keeps_its_limits_and_is_periodic(series):
    t = np.linspace(0.0, series.period, 4001)
    q, v, a = series.at(t)
    for k, name in enumerate(series.coordinates):
        (low, high), rate, acceleration = LIMITS[name]
        assert low <= q[:, k].min() and q[:, k].max() <= high
        assert np.abs(v[:, k]).max() <= rate and np.abs(a[:, k]).max() <= acceleration
    np.testing.assert_allclose(q[0], q[-1], atol=1e-12)


def test_rates_are_derivatives(series):
    t = np.linspace(0.1, 4.0, 7)
    (less, v0, _), (more, v1, _) = series.at(t - DIFFERENCE), series.at(t + DIFFERENCE)
    _, v, a = series.at(t)
    np.testing.assert_allclose((more - less) / (2 * DIFFERENCE), v, atol=ROUGH)
    np.testing.assert_allclose((v1 - v0) / (2 * DIFFERENCE), a, atol=ROUGH)


def test_it_identifies_better_than_random_series(series):
    """The least singular value grows: intervals of the worst parameter are narrower than by the first random series."""
    assert series.condition < series.random_condition
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    q, v, a = series.at(np.linspace(0.0, series.period, 200, endpoint=False))
    found = gauss.identify(system, q, v, a, system.inverse_dynamics(q, v, a))
    wanted = found.base.combinations @ gauss.regressor(system, q[0], v[0], a[0]).parameters
    np.testing.assert_allclose(found.base_values, wanted, rtol=1e-8, atol=1e-12)


def test_what_does_not_fit_is_refused():
    scene = gauss.load("double_pendulum")
    with pytest.raises(SimulationError, match="loops"):
        gauss.excitation(gauss.load("four_bar"), 5.0)
    with pytest.raises(ArgumentError, match="'C'"):
        gauss.excitation(scene, 5.0, limits={"C": ((0, 1), 1, 1)})
    with pytest.raises(ArgumentError, match="limits of 'A'"):
        gauss.excitation(scene, 5.0, limits={"A": ((1, 0), 1, 1)})
    with pytest.raises(ArgumentError, match="harmonics"):
        gauss.excitation(scene, 5.0, harmonics=0)
    with pytest.raises(SimulationError, match="positive"):
        gauss.excitation(scene, -1.0)
