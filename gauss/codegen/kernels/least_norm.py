"""Least-norm least-squares solution of A x = b in machine code without a library, for singular A.

Complete orthogonal factorisation (Golub and Van Loan, Matrix Computations, 5.5): A P = Q R by Householder reflections with
column pivoting; the first rows R₁ of R up to the rank, R₁ᵀ = Z S; x = P Z S⁻ᵀ (Qᵀ b)₁.
"""

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, subroutine


def least_norm(r: Routine, n: Value, A: Array, x: Array, room: Array, work: Array, rank_relative: float):
    """Write the solution of A x = b; ``x`` is b, then the solution.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    n : Value
        Order.
    A, x : Array
        Matrix (n, n) by columns, overwritten; right-hand side.
    room, work : Array
        Memory of n² and 4 n numbers.
    rank_relative : float
        Smallest diagonal entry of R that counts, relative to the first, times the order.
    """
    factorise = _write_factorisation(r.module)
    heads, y, order = work, work.after(n), Array(r.b, r.b.bitcast(work.after(n * 2).pointer, INTEGERS))
    unused = Array(r.b, r.b.bitcast(work.after(n * 3).pointer, INTEGERS))
    with r.each(n) as i:
        order[i], y[i] = i, 0.0
    r.call(factorise, n, n, 1, A, x, order, heads)
    least, rank = r.absolute(A[0]) * (r.as_double(n) * rank_relative), r.variable(0, INTEGER)
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
