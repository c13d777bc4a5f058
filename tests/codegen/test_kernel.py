"""Machine code called with arrays as they lie in memory."""

import numpy as np
import pytest

from gauss.codegen import trace

KERNEL = trace(lambda x: (x[0] + 2.0 * x[1], x[0] * x[1]), 2)


def expected(x):
    return np.array([x[0] + 2.0 * x[1], x[0] * x[1]])


LAYOUTS = {
    "rows": lambda x: x,
    "rows apart": lambda x: np.concatenate([x, x], axis=1)[:, : x.shape[1]],
    "columns": lambda x: np.asfortranarray(x),
    "every other": lambda x: np.repeat(x, 2, axis=1)[:, ::2],
    "backwards": lambda x: x[::-1][::-1],
    "integers": lambda x: np.round(10 * x).astype(int),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("count", [1, 7, 8, 19])
def test_inputs_of_any_layout(layout, count):
    given = LAYOUTS[layout](np.random.default_rng(0).standard_normal((2, count)))
    assert (KERNEL(given) == expected(given)).all()


def test_outputs_are_written_where_they_should_be():
    given, room = np.random.default_rng(0).standard_normal((2, 13)), np.full((2, 20), 7.0)
    out = room[:, :13]
    assert KERNEL(given, out) is out
    assert (out == expected(given)).all()
    assert (room[:, 13:] == 7.0).all()


@pytest.mark.parametrize(
    "out",
    [
        np.empty((2, 3)),
        np.empty((13, 2)).T,
        np.empty((2, 13), dtype=np.float32),
        np.empty((2, 26))[:, ::2],
        [[0.0] * 13] * 2,
    ],
)
def test_outputs_that_do_not_fit_are_refused(out):
    with pytest.raises(ValueError, match="out: expected"):
        KERNEL(np.zeros((2, 13)), out)


def test_read_only_outputs_are_refused():
    out = np.empty((2, 13))
    out.flags.writeable = False
    with pytest.raises(ValueError, match="writeable"):
        KERNEL(np.zeros((2, 13)), out)


def test_outputs_in_the_place_of_inputs_are_refused():
    room = np.zeros((4, 13))
    with pytest.raises(ValueError, match="shares memory"):
        KERNEL(room[:2], room[1:3])
    KERNEL(room[:2], room[2:])
