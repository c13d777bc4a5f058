import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError

pytestmark = pytest.mark.slow

CLOSED = 1e-10  # residual of the loop of a sample, in units of length


def hanging():
    scene = gauss.load("double_pendulum")
    return gauss.compile_scene(scene), next(one for one in gauss.equilibria(scene) if one.stability == "marginal").model


def test_a_mode_is_a_cosine_of_its_frequency():
    _, model = hanging()
    modes = model.modes()
    found = gauss.mode_motion(model, 1, amplitude=0.05, periods=3)
    assert found.t[-1] == pytest.approx(3.0 / modes.frequencies[1], rel=1e-12)
    phase = 2.0 * np.pi * modes.frequencies[1] * found.t
    wanted = model.state.q + 0.05 * (modes.shapes[1] * np.exp(1j * phase[:, None])).real
    np.testing.assert_allclose(found.q, wanted, atol=1e-12)


def test_samples_of_loops_are_closed():
    scene = gauss.load("four_bar")
    system = gauss.compile_scene(scene)
    found = gauss.mode_motion(gauss.equilibrium(scene).model, amplitude=0.3)
    residuals = [np.abs(system.function("loop_constraints")(q, 0.0 * q)[0]).max() for q in found.q]
    assert max(residuals) <= CLOSED and np.ptp(found.q, axis=0).max() > 0.1


def test_bad_input_is_refused():
    _, model = hanging()
    with pytest.raises(ArgumentError, match="mode from 0"):
        gauss.mode_motion(model, 7)
    with pytest.raises(ArgumentError, match="amplitude"):
        gauss.mode_motion(model, 0, amplitude=-1.0)
