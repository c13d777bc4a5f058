"""Long functions over blocks of states give the same bits as state by state, whatever the number of states."""

import sys

import numpy as np
import pytest

from gauss.codegen import trace, write
from gauss.codegen.batch_code import batch_code
from gauss.codegen.emit import SHORTEST_IN_BLOCKS, STATES_PER_BLOCK, has_blocks
from gauss.codegen.python_wrapper import Interface
from tests.codegen.test_outlined_pieces import formula

COUNTS = [1, 3, 8, *(STATES_PER_BLOCK + k for k in (-1, 0, 1)), 3 * STATES_PER_BLOCK, 3 * STATES_PER_BLOCK + 13]
SEED, LENGTH = 5, 250  # of a random function long enough for blocks; its first output is an input, its last a constant


@pytest.mark.slow
@pytest.mark.parametrize("count", COUNTS)
def test_columns_in_blocks_are_those_of_single_states(count):
    kernel = trace(formula(SEED, LENGTH), 2)
    x = np.random.default_rng(count).uniform(-1.0, 1.0, (2, count + 2))[:, 1:-1]
    together, beyond = np.full((9, count + 1), np.nan), np.s_[:, :-1]
    kernel(x, together[beyond])
    assert np.array_equal(together[beyond], np.transpose([kernel(column) for column in x.T]))
    assert np.isnan(together[:, -1]).all()


@pytest.mark.slow
@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("shortest", [0, 10_000], ids=["blocks", "vectors"])
def test_rows_in_blocks_are_those_of_single_states(count, shortest, monkeypatch):
    monkeypatch.setattr(sys.modules[batch_code.__module__], "SHORTEST_OF_ROWS", shortest)
    interface = Interface({"x": 2}, "t", shapes=((3, 2), (), (2,)))
    function = write(lambda x: formula(SEED, LENGTH)(x[:2]), 3)
    x, t = np.random.default_rng(count).uniform(-1.0, 1.0, (count, 5))[:, ::-2][:, :2], np.zeros(count)
    found = [np.full((count + 1, size), np.nan) for size in interface.result_sizes(9)]
    batch_code(function, interface).entry()(count, [x, t], [result[:-1] for result in found])
    expected = [trace(formula(SEED, LENGTH), 2)(row) for row in x]
    assert np.array_equal(np.hstack([result[:-1] for result in found]), expected)
    assert all(np.isnan(result[-1]).all() for result in found)


def test_short_functions_and_those_with_functions_within_have_no_blocks():
    inner = write(formula(SEED, LENGTH), 2)
    assert has_blocks(inner) and not has_blocks(write(formula(SEED, SHORTEST_IN_BLOCKS // 20), 2))
    assert not has_blocks(write(lambda x: inner(*x), 2))
