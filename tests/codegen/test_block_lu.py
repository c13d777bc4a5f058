"""Sparse LU of blocks against dense solutions, over graphs of contacts."""

import ctypes
from functools import cache

import numpy as np
import pytest
from llvmlite import ir

from gauss.codegen import machine
from gauss.codegen.kernels.arrays import Routine
from gauss.codegen.kernels.block_lu import SUPERNODE_PIVOTS, write_order, write_solve
from gauss.codegen.kernels.vectors import SIX, WIDTH

EXACT = 1e-12  # relative: the matrices are well conditioned


def chain(n, rng):
    return np.column_stack([np.arange(n - 1), np.arange(1, n)])


def clique(n, rng):
    return np.column_stack(np.triu_indices(n, 1))


def packing(n, rng):
    x = rng.random((n, 3))
    near = np.linalg.norm(x[:, None] - x, axis=2) < 1.4 * n ** (-1 / 3)
    return np.column_stack(np.nonzero(np.triu(near, 1)))


def apart(n, rng):
    return np.concatenate([clique(n // 2, rng), n // 2 + chain(n - n // 2, rng), [[-1, 0], [n - 1, -1]]])


@cache
def code() -> machine.MachineCode:
    module = ir.Module(name="gauss")
    solve = write_solve(module)
    write_order(module)
    r = Routine(ir.Function(module, solve.function_type, "solve"))
    r.call(solve, *r.integers, *r.arrays)
    r.done()
    return machine.load(str(module))


def call(name: str, *given):
    """Call a function of integers and arrays."""
    kinds = [ctypes.c_void_p if isinstance(one, np.ndarray) else ctypes.c_int64 for one in given]
    entry = code().entry(name, ctypes.CFUNCTYPE(None, *kinds))
    entry.call(*(one.ctypes.data if isinstance(one, np.ndarray) else one for one in given))


@pytest.mark.parametrize("n", [1, 2, 7, SUPERNODE_PIVOTS + 1, 2 * SUPERNODE_PIVOTS + 3])
@pytest.mark.parametrize("graph", [chain, clique, packing, apart])
def test_solutions_are_those_of_the_dense_matrix(graph, n):
    """Nonsymmetric blocks, chains of pivots shorter and longer than what is eliminated together."""
    rng = np.random.default_rng(n)
    bodies = np.ascontiguousarray(graph(n, rng).astype(np.int64).reshape(-1, 2))
    slot, order, start, listed, degree, count = (np.empty(k, dtype=np.int64) for k in (n * n, n, n + 1, n * n + 1, n, 1))
    call("order", n, len(bodies), bodies, slot, order, start, listed, degree, count)
    blocks, dense = np.zeros((count[0], SIX, WIDTH)), np.zeros((n, SIX, n, SIX))
    touching = [(i, i) for i in range(n)] + [tuple(pair) for pair in bodies.tolist() if min(pair) >= 0]
    for i, j in touching:
        for one, other in {(i, j), (j, i)}:
            own = rng.standard_normal((SIX, SIX)) + SIX * n * np.eye(SIX) * (i == j)
            dense[one, :, other] = own
            blocks[slot[one * n + other] - 1, :, :SIX] = own
    b = rng.standard_normal((n, SIX))
    x = np.pad(b, ((0, 0), (0, WIDTH - SIX)))
    call("solve", n, slot, order, start, listed, blocks, x)
    expected = np.linalg.solve(dense.reshape(n * SIX, n * SIX), b.ravel()).reshape(n, SIX)
    np.testing.assert_allclose(x[:, :SIX], expected, atol=EXACT * np.abs(expected).max())
