"""Fixed-point iteration x ← f(x, given), as a function."""

from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, Function, NativeFunction, Writer
from gauss.codegen.kernels.arrays import routine

CONVERGED_RELATIVE = 1e-9  # relative change below which a change that no longer shrinks is rounding error


@dataclass(frozen=True, eq=False)
class FixedPoint(NativeFunction):
    """Fixed-point iteration x ← f(x, given).

    It stops when the change is zero, or below ``CONVERGED_RELATIVE`` and no longer smaller than the one before: what
    remains is unbiased rounding error (Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta
    methods, BIT 48, 2008).

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
    name = "fixed_point"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs (x, given) and of outputs (x, iterations, last change)."""
        return len(self.function.inputs), self.size + 2

    def operations(self) -> dict[str, int]:
        """Operations of one iteration."""
        return self.function.operations()

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time: SIMD lanes would wait for the slowest."""
        code = writer.body(self.function, 1)
        code.attributes.add("noinline")
        r, source, target = routine(self, writer.module, width)
        n_in = self.arity[0]
        x, found = r.buffer(n_in), r.buffer(self.size + 1)
        before, count = r.variable(np.inf), r.variable(0, INTEGER)
        for k in range(n_in):
            x[k] = source[k]
        with r.loop() as leave_if:
            r.call(code, x, 1, found, 1)
            for k in range(self.size):
                x[k] = found[k]
            change = found[self.size]
            count[0] = count[0] + 1
            rounding = (change < CONVERGED_RELATIVE) & (change >= before[0])
            ends = rounding | ~(change > 0.0) | (count[0] >= self.most)  # NaN ends it, too
            before[0] = change
            leave_if(ends)
        for k in range(self.size):
            target[k] = x[k]
        target[self.size] = r.as_double(count[0])
        target[self.size + 1] = before[0]
        return r.done()
