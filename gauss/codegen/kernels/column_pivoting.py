"""Column basis of a matrix by QR factorisation with column pivoting (LAPACK dgeqp3; Golub and Van Loan, 5.4)."""

from dataclasses import dataclass, field

from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, POINTER, Graph, Writer, intrinsic
from gauss.codegen.kernels.lapack import routine

INDEPENDENT_PIVOT_RELATIVE = 1e-9  # relative to the largest pivot: smaller ones count as zero


@dataclass(frozen=True, eq=False)
class Pivots:
    """Column basis of a matrix (m, n): 1 for its columns, 0 for the others.

    Parameters
    ----------
    m, n : int
        Its shape; inputs are its entries, column by column.
    """

    m: int
    n: int
    name: str = "pivots"
    inputs: list = field(init=False)
    outputs: list = field(init=False)

    def __post_init__(self):
        """Name inputs and outputs, so that it can be called like a traced function."""
        graph = Graph()
        object.__setattr__(self, "inputs", list(graph.symbols("given", self.m * self.n)))
        object.__setattr__(self, "outputs", list(graph.symbols("result", self.n)))

    def operations(self) -> dict[str, int]:
        """Approximate number of operations."""
        return {"mul": self.m**2 * self.n}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        if width != 1:
            raise TypeError("a choice of columns is compiled for one motion at a time.")
        signature = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
        body = ir.Function(writer.module, signature, f"{self.name}_{len(writer.module.functions)}")
        body.linkage = "internal"
        source, in_stride, target, out_stride = body.args
        b = ir.IRBuilder(body.append_basic_block("entry"))
        whole = ir.IntType(32)
        space = 8 * (self.n + 1)
        matrix, tau, work = (b.alloca(DOUBLE, INTEGER(size)) for size in (self.m * self.n, self.n, space))
        order, info = b.alloca(whole, INTEGER(self.n)), b.alloca(whole)
        rows, columns, room = (b.alloca(whole) for _ in range(3))
        for place, value in ((rows, self.m), (columns, self.n), (room, space)):
            b.store(whole(value), place)
        for k in range(self.n):
            b.store(whole(0), b.gep(order, [INTEGER(k)]))
            b.store(_number(0.0), b.gep(target, [b.mul(out_stride, INTEGER(k))]))
        for k in range(self.m * self.n):
            b.store(b.load(b.gep(source, [b.mul(in_stride, INTEGER(k))])), b.gep(matrix, [INTEGER(k)]))
        b.call(routine(writer.module, "dgeqp3"), [rows, columns, matrix, rows, order, tau, work, room, info])
        size = lambda k: b.call(  # noqa: E731
            intrinsic(writer.module, "llvm.fabs", DOUBLE, 1), [b.load(b.gep(matrix, [INTEGER(k * (self.m + 1))]))]
        )
        least = b.fmul(size(0), _number(INDEPENDENT_PIVOT_RELATIVE))
        for k in range(min(self.m, self.n)):
            column = b.sext(b.sub(b.load(b.gep(order, [INTEGER(k)])), whole(1)), INTEGER)
            counts = b.select(b.fcmp_ordered(">", size(k), least), _number(1.0), _number(0.0))
            b.store(counts, b.gep(target, [b.mul(out_stride, column)]))
        b.ret_void()
        return body


def _number(value: float) -> ir.Constant:
    return ir.Constant(DOUBLE, float(value))
