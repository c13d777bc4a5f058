"""Small dense linear systems in machine code: Gaussian elimination; the least-norm solution of singular ones.

That is LAPACK's dgelsy on this CPU. A GPU has no library: there a complete orthogonal factorisation is written (Golub and
Van Loan, Matrix Computations, 5.5): A P = Q R by Householder reflections with column pivoting; the first rows R₁ of R up to
the rank, R₁ᵀ = Z S; x = P Z S⁻ᵀ (Qᵀ b)₁.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, POINTER
from gauss.codegen.ir_module import DeviceModule
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, subroutine
from gauss.codegen.kernels.lapack import WHOLE, lapack_routine

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
            _least_norm(r, n, A, x, kept, given)
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
    b = r.b
    with b.goto_entry_block():
        order, one, rank, info, room = (b.alloca(WHOLE) for _ in range(5))
        limit = b.alloca(DOUBLE)
    pivots = b.bitcast(work.pointer, WHOLE.as_pointer())
    small = b.trunc(n.value, WHOLE)
    for place, value in ((order, small), (one, WHOLE(1)), (room, b.mul(small, WHOLE(WORK_PER_COLUMN)))):
        b.store(value, place)
    b.store(b.fmul(b.sitofp(n.value, DOUBLE), ir.Constant(DOUBLE, RANK_RELATIVE)), limit)
    with r.each(n) as i:  # all columns are free for pivoting
        b.store(WHOLE(0), b.gep(pivots, [i.value]))
    solver = lapack_routine(r.module, "dgelsy")
    b.call(
        solver,
        [order, order, one, A.pointer, order, x.pointer, order, pivots, limit, rank, work.after(n).pointer, room, info],
    )


def _least_norm(r: Routine, n: Value, A: Array, x: Array, room: Array, work: Array):
    """Write the same without a library; ``room`` and ``work`` hold n² and 4 n numbers."""
    factorise = _write_factorisation(r.module)
    heads, y, order = work, work.after(n), Array(r.b, r.b.bitcast(work.after(n * 2).pointer, INTEGERS))
    unused = Array(r.b, r.b.bitcast(work.after(n * 3).pointer, INTEGERS))
    with r.each(n) as i:
        order[i], y[i] = i, 0.0
    r.call(factorise, n, n, 1, A, x, order, heads)
    least, rank = r.absolute(A[0]) * (r.as_double(n) * RANK_RELATIVE), r.variable(0, INTEGER)
    with r.loop() as leave_if:
        k = rank[0]
        leave_if(k >= n)
        leave_if(~(r.absolute(A[k * n + k]) > least))
        rank[0] = k + 1
    known = rank[0]
    with r.each(known) as k, r.each(n) as i:
        room[k * n + i] = r.choose(i >= k, A[i * n + k], 0.0)
    r.call(factorise, n, known, 0, room, y, unused, heads)
    with r.each(known) as j:
        above = r.sum(j, lambda i: room[j * n + i] * y[i])
        y[j] = (x[j] - above) / room[j * n + j]
    with r.each(known) as turn:
        k = known - turn - 1
        _reflect(r, n, k, room.after(k * n), heads[k], y)
    with r.each(n) as i:
        x[order[i]] = y[i]


def _reflect(r: Routine, n: Value, k: Value, column: Array, head: Value, y: Array):
    """Reflect a vector by I − 2 v vᵀ / vᵀ v: v is zero before entry k, ``head`` there, and that of the column behind."""
    size, product = r.variable(0.0), r.variable(0.0)
    size[0], product[0] = head * head, head * y[k]
    with r.each(n, k + 1) as i:
        size[0], product[0] = size[0] + column[i] * column[i], product[0] + column[i] * y[i]
    with r.when(size[0] > 0.0):
        share = product[0] * 2.0 / size[0]
        y[k] = y[k] - head * share
        with r.each(n, k + 1) as i:
            y[i] = y[i] - column[i] * share


def _write_factorisation(module: ir.Module) -> ir.Function:
    """Emit ``factorise(i64 m, i64 n, i64 pivots, double* A, double* b, i64* order, double* heads)``: A (m, n) by columns.

    A becomes R on and above the diagonal, below it the reflections, whose first entries are ``heads``; b becomes Qᵀ b. With
    ``pivots`` the largest of the columns left comes first, and ``order`` is that of the columns.
    """
    known = module.globals.get("factorise")
    if known:
        return known
    r = subroutine(module, "factorise", [INTEGER] * 3 + [POINTER] * 2 + [INTEGERS, POINTER])
    (m, n, pivots), (A, b, order, heads) = r.integers, r.arrays
    with r.each(n) as k:
        with r.when(pivots > 0):
            _swap_largest(r, m, n, k, A, order)
        column, size = A.after(k * m), r.variable(0.0)
        with r.each(m, k) as i:
            size[0] = size[0] + column[i] * column[i]
        diagonal = r.square_root(size[0])
        diagonal = r.choose(column[k] > 0.0, -diagonal, diagonal)
        heads[k] = column[k] - diagonal
        with r.each(n, k + 1) as j:
            _reflect(r, m, k, column, heads[k], A.after(j * m))
        _reflect(r, m, k, column, heads[k], b)
        column[k] = diagonal
    return r.done()


def _swap_largest(r: Routine, m: Value, n: Value, k: Value, A: Array, order: Array):
    """Swap column k with the largest of those from k on."""
    best, which = r.variable(-1.0), r.variable(0, INTEGER)
    which[0] = k
    with r.each(n, k) as j:
        size = r.variable(0.0)
        with r.each(m, k) as i:
            size[0] = size[0] + A[j * m + i] * A[j * m + i]
        with r.when(size[0] > best[0]):
            best[0], which[0] = size[0], j
    place = which[0]
    order[k], order[place] = order[place], order[k]
    with r.each(m) as i:
        A[k * m + i], A[place * m + i] = A[place * m + i], A[k * m + i]
