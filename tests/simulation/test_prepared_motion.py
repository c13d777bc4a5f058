"""Prepared motions: the results of simulate, bit for bit, from any initial state; refusals."""

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError

ROUNDING = 1e-12
TIMES = np.array([0.0, 0.03, 0.1])


@pytest.mark.slow
@pytest.mark.parametrize(
    "model, options",
    [
        ("pendulum", {}),
        ("pendulum", {"integrator": "taylor"}),
        ("double_pendulum", {"integrator": "radau5", "rtol": 1e-9}),
        ("four_bar", {}),
    ],
)
def test_prepared_motions_are_those_of_simulate(model, options):
    system = gauss.compile_scene(gauss.load(model))
    motion = gauss.prepare(system, TIMES[-1], times=TIMES, **options)
    start = system.initial_state()
    for rates in (start.v, 0.5 * start.v):
        q, v = motion(start.q, rates)
        state = gauss.State(0.0, start.q, rates)
        expected = gauss.simulate(system, TIMES[-1], state=state, times=TIMES, **options)
        allowed = ROUNDING if system.has_closures else 0.0  # simulate projects the state before
        np.testing.assert_allclose(q, expected.q, rtol=allowed, atol=allowed)
        np.testing.assert_allclose(v, expected.v, rtol=allowed, atol=allowed)
        np.testing.assert_array_equal(motion.trajectory(start.q, rates).q, expected.q)


def test_the_end_is_returned_without_times():
    motion = gauss.prepare(gauss.load("pendulum"), 0.1)
    q, v = motion()
    assert q.shape == v.shape == (1, 1) and motion.times.tolist() == [0.1]
    assert q[0] == gauss.simulate(gauss.load("pendulum"), 0.1, times=[0.1]).q[0]


def test_initial_states_are_numbers_of_any_kind():
    motion = gauss.prepare(gauss.load("pendulum"), 0.1)
    expected = motion(np.array([1.0]), np.zeros(1))[0].copy()
    unaligned = np.frombuffer(b"\0" + np.array([1.0]).tobytes(), dtype=float, offset=1)
    for q in ([1], (1.0,), unaligned, np.array([1.0], dtype=">f8"), np.array([1]), np.ones(3)[::-3]):
        assert np.array_equal(motion(q, [0])[0], expected)


def test_motions_that_cannot_be_prepared_are_refused():
    scene = gauss.load("pendulum")
    with pytest.raises(SimulationError, match="fixed steps"):
        gauss.prepare(scene, 0.1, integrator="rk4", step=1e-2)
    with pytest.raises(SimulationError, match="events"):
        gauss.prepare(gauss.load("friction_oscillator"), 0.1)
    for q in ([1.0, 2.0], 1.0, ["1"], [1.0 + 1.0j], np.ma.masked_array([1.0], [True]), [None]):
        with pytest.raises(StateError, match="1 coordinates"):
            gauss.prepare(scene, 0.1)(q, [0.0])
    with pytest.raises(StateError, match="finite"):
        gauss.prepare(scene, 0.1)([np.nan], [0.0])
    joint = next(iter(scene.joints))
    scene.drive(joint, torque=lambda t: gauss.math.where(t > 0.05, 1.0, 0.0))
    with pytest.raises(SimulationError, match="switch"):
        gauss.prepare(scene, 0.1)
