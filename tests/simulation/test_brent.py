"""Brent's method against the one of SciPy, number for number."""

import numpy as np
import pytest
from scipy.optimize import brentq

from gauss.simulation.brent import brent

FUNCTIONS = {
    "cubic": lambda x, a, b: (x - a) * (1.0 + (x - b) ** 2),
    "flat": lambda x, a, b: (x - a) ** 7 + 1e-9 * (x - a),
    "jump": lambda x, a, b: 1.0 if x > a else -1e-3,
    "wave": lambda x, a, b: np.sin(x - a) * np.exp(b * x),
    "zero": lambda x, a, b: max(x - a, 0.0) if x > a else min(x - a + 0.1, 0.0),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_roots_are_those_of_scipy_bit_for_bit(name):
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b, low, high = rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), -rng.uniform(1.0, 2.0), rng.uniform(1.0, 2.0)
        function = lambda x, a=a, b=b: FUNCTIONS[name](x, a, b)  # noqa: E731
        for xtol, rtol in ((1e-15, 9e-16), (1e-8, 1e-6)):
            assert brent(function, low, high, xtol, rtol) == brentq(function, low, high, xtol=xtol, rtol=rtol)


@pytest.mark.parametrize("function", [lambda x: x * x + 1.0, lambda x: np.nan])
def test_without_a_change_of_sign_there_is_an_error(function):
    with pytest.raises(ValueError):
        brent(function, -1.0, 2.0, 1e-12, 1e-12)
