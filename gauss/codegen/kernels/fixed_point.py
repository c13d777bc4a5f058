"""Fixed-point iteration x ← f(x, given), as a function."""

from dataclasses import dataclass, field

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, POINTER, Function, Graph, Writer

CONVERGED_RELATIVE = 1e-9  # relative change below which a change that no longer shrinks is rounding error


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """Fixed-point iteration x ← f(x, given).

    It stops when the change is zero, or below ``CONVERGED_RELATIVE`` and no longer smaller than the one before: what
    remains is
    unbiased rounding error (Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta methods,
    BIT 48, 2008).

    Parameters
    ----------
    function : Function
        (x, given) → (x, relative change).
    size : int
        Length of x.
    most : int
        Iteration limit.
    """

    function: Function
    size: int
    most: int
    name: str = "repeat"
    inputs: list = field(init=False)
    outputs: list = field(init=False)

    def __post_init__(self):
        """Name inputs (x, given) and outputs (x, repetitions, last change)."""
        graph = Graph()
        object.__setattr__(self, "inputs", list(graph.symbols("given", len(self.function.inputs))))
        object.__setattr__(self, "outputs", list(graph.symbols("result", self.size + 2)))

    def operations(self) -> dict[str, int]:
        """Operations of one iteration."""
        return self.function.operations()

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time: SIMD lanes would wait for the slowest."""
        if width != 1:
            raise TypeError("an iteration is compiled for one motion at a time.")
        code = writer.body(self.function, 1)
        code.attributes.add("noinline")
        signature = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
        body = ir.Function(writer.module, signature, f"{self.name}_{len(writer.module.functions)}")
        body.linkage = "internal"
        source, in_stride, target, out_stride = body.args
        b = ir.IRBuilder(body.append_basic_block("entry"))
        at = lambda pointer, k: b.gep(pointer, [k if isinstance(k, ir.Value) else INTEGER(k)])  # noqa: E731
        given, found = (b.alloca(DOUBLE, INTEGER(size)) for size in (len(self.inputs), self.size + 1))
        before, count = b.alloca(DOUBLE), b.alloca(INTEGER)
        for k in range(len(self.inputs)):
            b.store(b.load(at(source, b.mul(in_stride, INTEGER(k)))), at(given, k))
        b.store(ir.Constant(DOUBLE, np.inf), before)
        b.store(INTEGER(0), count)
        head, after = body.append_basic_block("repeat"), body.append_basic_block("after")
        b.branch(head)
        b.position_at_end(head)
        b.call(code, [given, INTEGER(1), found, INTEGER(1)])
        for k in range(self.size):
            b.store(b.load(at(found, k)), at(given, k))
        change, done = b.load(at(found, self.size)), b.add(b.load(count), INTEGER(1))
        b.store(done, count)
        small = b.fcmp_ordered("<", change, ir.Constant(DOUBLE, CONVERGED_RELATIVE))
        rounding = b.and_(small, b.fcmp_ordered(">=", change, b.load(before)))
        moving = b.fcmp_ordered(">", change, ir.Constant(DOUBLE, 0.0))  # false for NaN
        b.store(change, before)
        ends = b.or_(b.or_(rounding, b.not_(moving)), b.icmp_signed(">=", done, INTEGER(self.most)))
        b.cbranch(ends, after, head)
        b.position_at_end(after)
        results = [*(b.load(at(given, k)) for k in range(self.size)), b.sitofp(done, DOUBLE), b.load(before)]
        for k, value in enumerate(results):
            b.store(value, at(target, b.mul(out_stride, INTEGER(k))))
        b.ret_void()
        return body
