"""Sparse LU of blocks (6, 6) on a graph of bodies, in machine code for any graph: order, fill, factors, solution.

Elimination in order of least degree (Tinney, Walker 1967; George, Liu 1981), without pivoting between blocks: the matrices
are M + Jᵀ K J with positive definite M and K that is nearly so. ``slot[i n + j]`` is 1 + the number of block (i, j), 0 where
it is zero; the neighbours of the k-th eliminated body are ``list[start[k]] … list[start[k + 1] − 1]``.
"""

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, subroutine
from gauss.codegen.kernels.vectors import BLOCK, WIDTH, write_apply, write_inverse, write_product


def write_order(module: ir.Module) -> ir.Function:
    """``order(i64 n, i64 m, i64* bodies, i64* slot, i64* order, i64* start, i64* list, i64* degree, i64* blocks)``.

    ``bodies`` are the two of each of m contacts, −1 for the ground. ``slot`` (n²) is filled in; ``blocks`` becomes their
    number.
    """
    r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGER, INTEGER, *[INTEGERS] * 7]), "order"))
    (n, m), (bodies, slot, order, start, listed, degree, blocks) = r.integers, r.arrays
    count, place = r.variable(0, INTEGER), r.variable(0, INTEGER)

    def number(i: Value):
        with r.when(slot[i] < 1):
            count[0] = count[0] + 1
            slot[i] = count[0]

    def join(i: Value, j: Value):
        with r.when(slot[i * n + j] < 1):
            degree[i], degree[j] = degree[i] + 1, degree[j] + 1
            number(i * n + j)
            number(j * n + i)

    with r.each(n * n) as i:
        slot[i] = 0
    with r.each(n) as i:
        degree[i] = 0
        number(i * n + i)
    with r.each(m) as c:
        one, other = bodies[c * 2], bodies[c * 2 + 1]
        with r.when((one >= 0) & (other >= 0)):
            join(one, other)
    start[0] = 0
    with r.each(n) as k:
        best, least = r.variable(0, INTEGER), r.variable(0, INTEGER)
        least[0] = n + n
        with r.each(n) as i, r.when((degree[i] >= 0) & (degree[i] < least[0])):
            least[0], best[0] = degree[i], i
        p = best[0]
        order[k], degree[p] = p, -1
        first = place[0]
        with r.each(n) as i, r.when((slot[p * n + i] > 0) & (degree[i] >= 0)):
            listed[place[0]] = i
            place[0] = place[0] + 1
            degree[i] = degree[i] - 1
        start[k + 1] = place[0]
        with r.each(place[0], first) as x, r.each(x, first) as y:
            join(listed[x], listed[y])
    blocks[0] = count[0]
    return r.done()


def write_solve(module: ir.Module) -> ir.Function:
    """``solve(i64 n, i64* slot, i64* order, i64* start, i64* list, double* A, double* x)``: x ← A⁻¹ x.

    A becomes its factors. Rows of ``x`` (n, 8) and of blocks end with two zeros.
    """
    product, times, inverse, apply_, add = (
        _sub(module, "subtract_product", 3, lambda r: write_product(r, -1.0, True)),
        _sub(module, "times", 3, lambda r: write_product(r, 1.0, False)),
        _sub(module, "inverse", 1, write_inverse),
        _sub(module, "subtract_applied", 3, lambda r: write_apply(r, -1.0)),
        _sub(module, "add_applied", 3, lambda r: write_apply(r, 1.0)),
    )
    r = subroutine(module, "solve_blocks", [INTEGER, *[INTEGERS] * 4, *[POINTER] * 2])
    (n,), (slot, order, start, listed, A, x) = r.integers, r.arrays
    L, y = r.buffer(BLOCK), r.buffer(WIDTH)

    def block(i: Value, j: Value) -> Array:
        return A.after((slot[i * n + j] - 1) * BLOCK)

    with r.each(n) as k:
        p, end = order[k], start[k + 1]
        pivot = block(p, p)
        r.call(inverse, pivot)
        with r.each(end, start[k]) as a:
            i = listed[a]
            r.call(times, L, block(i, p), pivot)
            r.call(apply_, x.after(i * WIDTH), L, x.after(p * WIDTH))
            with r.each(end, start[k]) as b:
                r.call(product, block(i, listed[b]), L, block(p, listed[b]))
    with r.each(n) as back:
        k = n - back - 1
        p = order[k]
        own = x.after(p * WIDTH)
        with r.each(start[k + 1], start[k]) as a:
            r.call(apply_, own, block(p, listed[a]), x.after(listed[a] * WIDTH))
        for entry in range(WIDTH):
            y[entry] = 0.0
        r.call(add, y, block(p, p), own)
        for entry in range(WIDTH):
            own[entry] = y[entry]
    return r.done()


def _sub(module: ir.Module, name: str, count: int, write) -> ir.Function:
    return write(subroutine(module, name, [POINTER] * count))
