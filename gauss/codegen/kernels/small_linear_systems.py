"""Small dense linear systems in machine code: Gaussian elimination; the least-norm solution of singular ones.

That is LAPACK's dgelsy on this CPU, and :mod:`gauss.codegen.kernels.least_norm` on a GPU, which has no library.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, POINTER
from gauss.codegen.device_module import DeviceModule
from gauss.codegen.kernels.arrays import Array, Routine, Value, subroutine
from gauss.codegen.kernels.lapack import lapack_routine
from gauss.codegen.kernels.least_norm import least_norm

SINGULAR_PIVOT_RELATIVE = 1e-11  # relative to the largest entry: a matrix with a smaller pivot counts as singular
RANK_RELATIVE = float(np.finfo(float).eps)  # relative condition limit of the rank decision, times the order
WORK_PER_COLUMN = 8  # doubles of LAPACK's workspace per column


def space(order: int) -> int:
    """Doubles of workspace of :func:`write_equations` for matrices up to an order."""
    return order * order + (WORK_PER_COLUMN + 2) * (order + 1)


def write_equations(module: ir.Module) -> ir.Function:
    """Emit ``equations(i64 n, double* A, double* x, double* room)``: x is the right-hand side, then the solution.

    A (n, n) is stored by columns, and is overwritten.
    """
    known = module.globals.get("equations")
    if known:
        return known
    r = subroutine(module, "equations", [INTEGER, POINTER, POINTER, POINTER])
    (n,), (A, x, room) = r.integers, r.arrays
    kept, given = room, room.after(n * n)
    r.copy(kept, A, n * n)
    r.copy(given, x, n)
    if_singular = r.variable(0, INTEGER)
    _hold_idle(r, n, A, x)
    _eliminate(r, n, A, x, if_singular)
    with r.when(if_singular[0] > 0):
        r.copy(A, kept, n * n)
        r.copy(x, given, n)
        if isinstance(module, DeviceModule):
            least_norm(r, n, A, x, kept, given, RANK_RELATIVE)
        else:
            _shortest(r, n, A, x, given.after(n))
    return r.done()


def _hold_idle(r: Routine, n: Value, A: Array, x: Array):
    """Give unknowns that no equation has, where their own equation is 0 = 0, the least solution: zero.

    So are forces across the plane of a mechanism that moves in a plane, of which others need no least-norm solution.
    """
    with r.each(n) as i, r.when(r.absolute(A[i * n + i]) + r.absolute(x[i]) <= 0.0):
        size = r.sum(n, lambda j: r.absolute(A[i * n + j]) + r.absolute(A[j * n + i]))
        with r.when(size <= 0.0):
            largest = r.variable(1.0)
            with r.each(n * n) as j:
                largest[0] = r.maximum(r.absolute(A[j]), largest[0])
            A[i * n + i] = largest[0]


def _eliminate(r: Routine, n: Value, A: Array, x: Array, if_singular: Array):
    """Gaussian elimination with partial pivoting, up to a pivot that makes the matrix singular."""
    largest, column = r.variable(0.0), r.variable(0, INTEGER)
    with r.each(n * n) as i:
        largest[0] = r.maximum(r.absolute(A[i]), largest[0])
    with r.loop() as leave_if:
        k = column[0]
        leave_if(k >= n)
        best, row = r.variable(-1.0), r.variable(0, INTEGER)
        row[0] = k
        with r.each(n, k) as i:
            size = r.absolute(A[k * n + i])
            with r.when(size > best[0]):
                best[0], row[0] = size, i
        with r.when(~(best[0] > largest[0] * SINGULAR_PIVOT_RELATIVE)):
            if_singular[0] = 1
        leave_if(if_singular[0] > 0)
        _swap(r, x, k, row[0])
        with r.each(n, k) as j:
            _swap(r, A, j * n + k, j * n + row[0])
        share = 1.0 / A[k * n + k]
        with r.each(n, k + 1) as i:
            A[k * n + i] = A[k * n + i] * share
            x[i] = x[i] - A[k * n + i] * x[k]
        with r.each(n, k + 1) as j:
            above = A[j * n + k]
            with r.each(n, k + 1) as i:
                A[j * n + i] = A[j * n + i] - A[k * n + i] * above
        column[0] = k + 1
    with r.when(if_singular[0] <= 0), r.each(n) as back:
        k = n - back - 1
        value = x[k] / A[k * n + k]
        x[k] = value
        with r.each(k) as i:
            x[i] = x[i] - A[k * n + i] * value


def _swap(r: Routine, x: Array, i: Value, j: Value):
    one, other = x[i], x[j]
    x[i], x[j] = other, one


def _shortest(r: Routine, n: Value, A: Array, x: Array, work: Array):
    """Least-norm least squares by LAPACK's complete orthogonal factorisation."""
    b, whole = r.b, ir.IntType(32)
    with b.goto_entry_block():
        order, one, rank, info, room = (b.alloca(whole) for _ in range(5))
        limit = b.alloca(DOUBLE)
    pivots = b.bitcast(work.pointer, whole.as_pointer())
    small = b.trunc(n.value, whole)
    for place, value in ((order, small), (one, whole(1)), (room, b.mul(small, whole(WORK_PER_COLUMN)))):
        b.store(value, place)
    b.store(b.fmul(b.sitofp(n.value, DOUBLE), ir.Constant(DOUBLE, RANK_RELATIVE)), limit)
    with r.each(n) as i:  # all columns are free for pivoting
        b.store(whole(0), b.gep(pivots, [i.value]))
    solver = lapack_routine(r.module, "dgelsy")
    b.call(
        solver,
        [order, order, one, A.pointer, order, x.pointer, order, pivots, limit, rank, work.after(n).pointer, room, info],
    )
