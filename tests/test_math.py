"""gauss.math: the same function over numbers, arrays and traced expressions."""

import numpy as np
import pytest

from gauss import math
from gauss.codegen import trace, write

X = np.array([-2.5, -1.0, -0.0, 0.3, 1.0, 7.0])
LAWS = {
    "clip": lambda x: math.clip(x, -1.0, 1.0),
    "where": lambda x: math.where(x <= 0.3, x * x, 3.0 - x),
    "both sides": lambda x: math.where(x >= -1.0, math.where(x < 1.0, 1.0, 2.0), 3.0),
    "abs": math.abs,
    "sign": math.sign,
    "tanh": math.tanh,
    "angles": lambda x: math.atan2(x, 2.0) + math.atan2(1.0, x),
    "power": lambda x: math.abs(x) ** 1.5 + 2.0**x,
    "comparison as a number": lambda x: 2.0 * (x > 0.0),
    "extremes": lambda x: math.maximum(x, 2.0 * x) - math.minimum(0.5, x),
}


@pytest.mark.parametrize("name", LAWS)
def test_numbers_and_machine_code_agree(name):
    law = LAWS[name]
    kernel = trace(lambda x: np.array([law(x[0])], dtype=object), 1)
    expected = [float(law(x)) for x in X]
    assert np.allclose(law(X), expected, rtol=1e-15, atol=0)
    assert np.allclose(kernel(X[None])[0], expected, rtol=4e-15, atol=0)


def test_a_function_is_called_by_another_as_if_written_out():
    inner = write(lambda x: np.array([x[0] * np.sin(x[1]), x[0] + x[1], 3.0]), 2)
    outer = lambda f: lambda y: f(np.array([y[0], 2.0])) * f(np.array([y[1], y[0]]))  # noqa: E731
    called = trace(outer(inner), 2)
    plain = trace(outer(lambda x: np.array([x[0] * np.sin(x[1]), x[0] + x[1], 3.0])), 2)
    y = np.random.default_rng(0).standard_normal((2, 21))
    assert np.array_equal(called(y), plain(y)) or np.abs(called(y) - plain(y)).max() <= 1e-15 * np.abs(plain(y)).max()
    assert called.operations["sin"] == 2  # counted where they are executed
    with pytest.raises(TypeError, match="takes 2 numbers"):
        trace(lambda y: inner(y), 3)
