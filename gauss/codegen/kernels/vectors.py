"""Rows of eight doubles in machine code: vectors of twists, and blocks (6, 6) of matrices with rows of that length."""

from llvmlite import ir

from gauss.codegen import DOUBLE, intrinsic
from gauss.codegen.ir_module import LANE, broadcast
from gauss.codegen.kernels.arrays import Array, Routine, Value

WIDTH = 8  # doubles of a row, of which SIX count; the rest is zero
SIX = 6
BLOCK = SIX * WIDTH  # doubles of a block
ROW = ir.VectorType(DOUBLE, WIDTH)


class TwistRows:
    """Arithmetic on rows, as values of LLVM.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    """

    def __init__(self, r: Routine):
        self.r, self.b = r, r.b
        self.fma = intrinsic(r.module, "llvm.fma", ROW, 3)

    def _place(self, array: Array, index) -> ir.Value:
        return self.b.bitcast(array.after(index).pointer, ROW.as_pointer())

    def load(self, array: Array, index) -> ir.Value:
        """Row that begins at an index."""
        return self.b.load(self._place(array, index), align=8)

    def store(self, row: ir.Value, array: Array, index):
        """Store a row at an index."""
        self.b.store(row, self._place(array, index), align=8)

    def all(self, x: Value) -> ir.Value:
        """Row of equal entries."""
        return broadcast(self.b, x.value, WIDTH)

    def added(self, row: ir.Value, factors, rows) -> ir.Value:
        """``row`` + Σ factor · row, one fused operation each; factors are doubles."""
        for factor, other in zip(factors, rows, strict=True):
            row = self.b.call(self.fma, [self.all(factor), other, row])
        return row

    def zero(self) -> ir.Value:
        """Row of zeros."""
        return ir.Constant(ROW, [0.0] * WIDTH)

    def entry(self, row: ir.Value, k: int) -> Value:
        """Entry of a row."""
        return Value(self.b, self.b.extract_element(row, LANE(k)))

    def with_entry(self, row: ir.Value, k: int, x: float) -> ir.Value:
        """Row with another constant as one entry."""
        return self.b.insert_element(row, ir.Constant(DOUBLE, x), LANE(k))


def write_product(r: Routine, sign: float, adds: bool) -> ir.Function:
    """Complete ``(double* C, double* A, double* B)``: C = ± A B, or C ± A B, of blocks."""
    rows, (C, A, B) = TwistRows(r), r.arrays
    right = [rows.load(B, k * WIDTH) for k in range(SIX)]
    for i in range(SIX):
        factors = [A[i * WIDTH + k] * sign for k in range(SIX)] if sign != 1.0 else [A[i * WIDTH + k] for k in range(SIX)]
        rows.store(rows.added(rows.load(C, i * WIDTH) if adds else rows.zero(), factors, right), C, i * WIDTH)
    return r.done()


def write_inverse(r: Routine) -> ir.Function:
    """Complete ``(double* A)``: a block is replaced by its inverse (Gauss–Jordan elimination without pivoting)."""
    rows, (A,) = TwistRows(r), r.arrays
    own = [rows.load(A, k * WIDTH) for k in range(SIX)]
    for k in range(SIX):
        pivot = 1.0 / rows.entry(own[k], k)
        own[k] = r.b.fmul(rows.with_entry(own[k], k, 1.0), rows.all(pivot))
        for i in range(SIX):
            if i != k:
                factor = -rows.entry(own[i], k)
                own[i] = rows.added(rows.with_entry(own[i], k, 0.0), [factor], [own[k]])
    for k in range(SIX):
        rows.store(own[k], A, k * WIDTH)
    return r.done()


def write_apply(r: Routine, sign: float) -> ir.Function:
    """Complete ``(double* y, double* A, double* x)``: y = y ± A x of a block and vectors; y ≠ x."""
    y, A, x = r.arrays
    given = [x[k] for k in range(SIX)]
    for i in range(SIX):
        total = A[i * WIDTH] * given[0]
        for k in range(1, SIX):
            total = total + A[i * WIDTH + k] * given[k]
        y[i] = y[i] + total if sign > 0.0 else y[i] - total
    return r.done()
