"""Sparse LU of blocks (6, 6) on a graph of bodies, in machine code for any graph: order, fill, factors, solution.

Elimination in order of least degree (Tinney, Walker 1967; George, Liu 1981), without pivoting between blocks: the matrices
are M + Jᵀ K J with positive definite M and K that is nearly so. ``slot[i n + j]`` is 1 + the number of block (i, j), 0 where
it is zero; the neighbours of the k-th eliminated body are ``list[start[k]] … list[start[k + 1] − 1]``. Pivots of which each
has the next one and its neighbours as neighbours (supernodes: Ashcraft, Grimes 1989) are eliminated together, and blocks
read once for all of them; their products are summed in the order of the pivots, as one by one.
"""

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, subroutine
from gauss.codegen.kernels.vectors import BLOCK, ROW, SIX, WIDTH, TwistRows, write_apply, write_inverse, write_product

SUPERNODE_PIVOTS = 16  # most pivots that are eliminated together
LEAST_NEIGHBOURS = 4  # neighbours of a pivot: with fewer, the next one does not gain by waiting for it
TILE_COLUMNS = 8  # columns that are updated together: their blocks of the pivots stay in the nearest cache


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
    return _SolveWriter(module).write()


class _SolveWriter:
    """Writer of the solution: pivots with the same neighbours are eliminated together, so that blocks are read once."""

    def __init__(self, module: ir.Module):
        self.update, self.product, self.times, self.inverse, self.subtract, self.add = (
            _sub(module, "add_products", 3, _write_products, [INTEGER], [INTEGERS] * 2),
            _sub(module, "add_product", 3, lambda r: write_product(r, 1.0, True)),
            _sub(module, "minus_times", 3, lambda r: write_product(r, -1.0, False)),
            _sub(module, "inverse", 1, write_inverse),
            _sub(module, "subtract_applied", 3, lambda r: write_apply(r, -1.0)),
            _sub(module, "add_applied", 3, lambda r: write_apply(r, 1.0)),
        )
        r = self.r = subroutine(module, "solve_blocks", [INTEGER, *[INTEGERS] * 4, *[POINTER] * 2])
        (self.n,), (self.slot, self.order, self.start, self.listed, self.A, self.x) = r.integers, r.arrays
        self.y = r.buffer(WIDTH)
        self.left, self.beside, self.above = (r.buffer(SUPERNODE_PIVOTS, INTEGER) for _ in range(3))
        self.right = r.buffer(SUPERNODE_PIVOTS * TILE_COLUMNS, INTEGER)

    def write(self) -> ir.Function:
        r, first = self.r, self.r.variable(0, INTEGER)
        with r.loop() as leave_if:
            leave_if(first[0] >= self.n)
            end = self._end_of(first[0])
            with r.each(end, first[0]) as k:
                self._eliminate(first[0], k)
            with r.when(end <= first[0] + 1):
                self._update_alone(first[0])
            with r.when(end > first[0] + 1):
                self._update_others(first[0], end)
            first[0] = end
        self._substitute_back()
        return r.done()

    def _place(self, i: Value, j: Value) -> Value:
        return (self.slot[i * self.n + j] - 1) * BLOCK

    def _block(self, i: Value, j: Value) -> Array:
        return self.A.after(self._place(i, j))

    def _count(self, k: Value) -> Value:
        return self.start[k + 1] - self.start[k]

    def _end_of(self, first: Value) -> Value:
        """End of the pivots from ``first`` on of which each has the next one and its neighbours as neighbours."""
        r, end, goes_on = self.r, self.r.variable(first + 1, INTEGER), self.r.variable(0, INTEGER)
        goes_on[0] = r.as_integer(self._count(first) >= LEAST_NEIGHBOURS)
        with r.loop() as leave_if:
            leave_if((goes_on[0] < 1) | (end[0] >= self.n) | (end[0] - first >= SUPERNODE_PIVOTS))
            k, goes_on[0] = end[0], 0
            with r.when((self._count(k) + 1 <= self._count(k - 1)) & (self._count(k - 1) <= self._count(k) + 1)):
                with r.when(self.slot[self.order[k - 1] * self.n + self.order[k]] > 0):
                    goes_on[0], end[0] = 1, k + 1
        return end[0]

    def _eliminate(self, first: Value, k: Value):
        """Factors −L of one pivot, which replace its column, after the products of the pivots from ``first`` on."""
        r, x, p = self.r, self.x, self.order[k]
        pivot = self._block(p, p)
        with r.when(k > first):
            self._update_own(first, k)
        r.call(self.inverse, pivot)
        with r.each(self.start[k + 1], self.start[k]) as a:
            i = self.listed[a]
            own = self._block(i, p)
            r.call(self.times, own, own, pivot)  # row by row: a row is read before it is replaced
            r.call(self.add, x.after(i * WIDTH), own, x.after(p * WIDTH))

    def _update_own(self, first: Value, k: Value):
        """Products of the pivots from ``first`` on in the row and the column of the next one."""
        r, p, count, A = self.r, self.order[k], k - first, self.A
        with r.each(count) as m:
            q = self.order[first + m]
            self.left[m], self.right[m] = self._place(p, q), self._place(q, p)
        r.call(self.update, count, self._block(p, p), A, A, self.left, self.right)
        with r.each(self.start[k + 1], self.start[k]) as a:
            i = self.listed[a]
            with r.each(count) as m:
                q = self.order[first + m]
                self.above[m], self.beside[m] = self._place(q, i), self._place(i, q)
            r.call(self.update, count, self._block(p, i), A, A, self.left, self.above)
            r.call(self.update, count, self._block(i, p), A, A, self.beside, self.right)

    def _update_alone(self, k: Value):
        """Products of one pivot in the blocks of its neighbours."""
        r, p, begin, end = self.r, self.order[k], self.start[k], self.start[k + 1]
        with r.each(end, begin) as a:
            L = self._block(self.listed[a], p)
            with r.each(end, begin) as b:
                r.call(self.product, self._block(self.listed[a], self.listed[b]), L, self._block(p, self.listed[b]))

    def _update_others(self, first: Value, end: Value):
        """Products of some pivots in the blocks of the neighbours of all."""
        r, count, begin, last = self.r, end - first, self.start[end - 1], self.start[end]
        tile = r.variable(begin, INTEGER)
        with r.loop() as leave_if:
            leave_if(tile[0] >= last)
            stop = r.variable(tile[0] + TILE_COLUMNS, INTEGER)
            with r.when(stop[0] > last):
                stop[0] = last
            with r.each(stop[0], tile[0]) as b, r.each(count) as k:
                self.right[(b - tile[0]) * SUPERNODE_PIVOTS + k] = self._place(self.order[first + k], self.listed[b])
            with r.each(last, begin) as a:
                i = self.listed[a]
                with r.each(count) as k:
                    self.left[k] = self._place(i, self.order[first + k])
                with r.each(stop[0], tile[0]) as b:
                    right = self.right.after((b - tile[0]) * SUPERNODE_PIVOTS)
                    r.call(self.update, count, self._block(i, self.listed[b]), self.A, self.A, self.left, right)
            tile[0] = stop[0]

    def _substitute_back(self):
        r, x, y = self.r, self.x, self.y
        with r.each(self.n) as back:
            k = self.n - back - 1
            p = self.order[k]
            own = x.after(p * WIDTH)
            with r.each(self.start[k + 1], self.start[k]) as a:
                r.call(self.subtract, own, self._block(p, self.listed[a]), x.after(self.listed[a] * WIDTH))
            for entry in range(WIDTH):
                y[entry] = 0.0
            r.call(self.add, y, self._block(p, p), own)
            for entry in range(WIDTH):
                own[entry] = y[entry]


def _write_products(r: Routine) -> ir.Function:
    """Complete ``(i64 m, double* C, double* A, double* B, i64* left, i64* right)``: C += Σ A[left[k]] B[right[k]]."""
    rows, (C, A, B, left, right), (m,) = TwistRows(r), r.arrays, r.integers
    with r.b.goto_entry_block():
        sums = [r.b.alloca(ROW) for _ in range(SIX)]
    for i, total in enumerate(sums):
        r.b.store(rows.load(C, i * WIDTH), total)
    with r.each(m) as k:
        one, other = A.after(left[k]), B.after(right[k])
        factors = [rows.load(other, q * WIDTH) for q in range(SIX)]
        for i, total in enumerate(sums):
            r.b.store(rows.added(r.b.load(total), [one[i * WIDTH + q] for q in range(SIX)], factors), total)
    for i, total in enumerate(sums):
        rows.store(r.b.load(total), C, i * WIDTH)
    return r.done()


def _sub(module: ir.Module, name: str, count: int, write, before=(), after=()) -> ir.Function:
    return write(subroutine(module, name, [*before, *[POINTER] * count, *after]))
