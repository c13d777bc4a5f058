"""Sparse LDLᵀ over numbers and expressions."""

import numpy as np
import pytest

from gauss.codegen import LDLT, trace

ROUNDING = 1e-13  # of matrices with condition numbers below 100


def _quasi_definite(n, m, density, seed):
    """[H Aᵀ; A −1] with few entries."""
    rng = np.random.default_rng(seed)
    A = np.where(rng.random((m, n)) < density, rng.standard_normal((m, n)), 0.0)
    return np.block([[np.diag(rng.uniform(1, 2, n)), A.T], [A, -np.eye(m)]])


@pytest.mark.parametrize("n, m, density", [(1, 0, 1.0), (4, 2, 1.0), (12, 6, 0.2), (30, 10, 0.1)])
def test_solutions_are_those_of_lapack(n, m, density):
    A = _quasi_definite(n, m, density, n)
    b = np.random.default_rng(1).standard_normal(n + m)
    expected = np.linalg.solve(A, b)
    kernel = trace(lambda x: LDLT(A * x[0]).solve(x[1:]), 1 + n + m)
    for found in (LDLT(A).solve(b).astype(float), kernel(np.concatenate([[1.0], b]))):
        assert np.abs(found - expected).max() <= ROUNDING * np.abs(expected).max()


def test_an_arrow_fills_nothing_and_a_chain_is_cut_from_both_ends():
    arrow = np.diag(np.full(20, 4.0))
    arrow[0, :] = arrow[:, 0] = 1.0
    arrow[0, 0] = 40.0
    assert LDLT(arrow).entries == 19
    chain = np.diag(np.full(9, 4.0)) + np.diag(np.ones(8), 1) + np.diag(np.ones(8), -1)
    factor = LDLT(chain)
    assert factor.entries == 8
    assert factor.order[:4] == [0, 8, 1, 7]
