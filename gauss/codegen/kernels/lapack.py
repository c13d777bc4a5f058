"""Calls of LAPACK, that of SciPy, from machine code; the column basis of a matrix by its QR factorisation."""

from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, POINTER, NativeFunction, Writer, external, intrinsic
from gauss.codegen.linking import symbol

WHOLE = ir.IntType(32)  # an integer of LAPACK, which takes all arguments by reference
WHOLES, LETTER = WHOLE.as_pointer(), ir.IntType(8).as_pointer()
KINDS = {
    "dgeqp3": [WHOLES, WHOLES, POINTER, WHOLES, WHOLES, POINTER, POINTER, WHOLES, WHOLES],
    "dgelsy": [WHOLES, WHOLES, WHOLES, POINTER, WHOLES, POINTER, WHOLES, WHOLES, POINTER, WHOLES, POINTER, WHOLES, WHOLES],
    "dgetrf": [WHOLES, WHOLES, POINTER, WHOLES, WHOLES, WHOLES],
    "dgetrs": [LETTER, WHOLES, WHOLES, POINTER, WHOLES, WHOLES, POINTER, WHOLES, WHOLES],
}
INDEPENDENT_PIVOT_RELATIVE = 1e-9  # relative to the largest pivot: smaller ones count as zero


def lapack_routine(module: ir.Module, name: str) -> ir.Function:
    """Declare a routine of SciPy's LAPACK in a module."""
    return external(module, symbol(name), ir.VoidType(), KINDS[name])


@dataclass(frozen=True, eq=False)
class Pivots(NativeFunction):
    """Column basis of a matrix (m, n): 1 for its columns, 0 for the others (column pivoting; Golub and Van Loan, 5.4).

    Parameters
    ----------
    m, n : int
        Its shape; inputs are its entries, column by column.
    """

    m: int
    n: int
    name = "pivots"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return self.m * self.n, self.n

    def operations(self) -> dict[str, int]:
        """Approximate number of operations."""
        return {"mul": self.m**2 * self.n}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        body = self.begin_scalar(writer.module, width)
        source, in_stride, target, out_stride = body.args
        b = ir.IRBuilder(body.append_basic_block("entry"))
        space = 8 * (self.n + 1)
        matrix, tau, work = (b.alloca(DOUBLE, INTEGER(size)) for size in (self.m * self.n, self.n, space))
        order, info = b.alloca(WHOLE, INTEGER(self.n)), b.alloca(WHOLE)
        rows, columns, room = (b.alloca(WHOLE) for _ in range(3))
        for place, value in ((rows, self.m), (columns, self.n), (room, space)):
            b.store(WHOLE(value), place)
        for k in range(self.n):
            b.store(WHOLE(0), b.gep(order, [INTEGER(k)]))
            b.store(_number(0.0), b.gep(target, [b.mul(out_stride, INTEGER(k))]))
        for k in range(self.m * self.n):
            b.store(b.load(b.gep(source, [b.mul(in_stride, INTEGER(k))])), b.gep(matrix, [INTEGER(k)]))
        b.call(lapack_routine(writer.module, "dgeqp3"), [rows, columns, matrix, rows, order, tau, work, room, info])
        size = lambda k: b.call(  # noqa: E731
            intrinsic(writer.module, "llvm.fabs", DOUBLE, 1), [b.load(b.gep(matrix, [INTEGER(k * (self.m + 1))]))]
        )
        least = b.fmul(size(0), _number(INDEPENDENT_PIVOT_RELATIVE))
        for k in range(min(self.m, self.n)):
            column = b.sext(b.sub(b.load(b.gep(order, [INTEGER(k)])), WHOLE(1)), INTEGER)
            counts = b.select(b.fcmp_ordered(">", size(k), least), _number(1.0), _number(0.0))
            b.store(counts, b.gep(target, [b.mul(out_stride, column)]))
        b.ret_void()
        return body


def _number(value: float) -> ir.Constant:
    return ir.Constant(DOUBLE, float(value))
