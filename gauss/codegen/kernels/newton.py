"""Simplified Newton iteration for r(x, given) = 0 with a difference Jacobian, as a function; for stiff equations."""

from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, Function, NativeFunction, Writer, counted_loop, intrinsic
from gauss.codegen.kernels.fixed_point import CONVERGED_RELATIVE
from gauss.codegen.kernels.lapack import WHOLE, lapack_routine

DIFFERENCE_RELATIVE = 1.5e-8  # difference step relative to |x| + scale: √ε
SLOW_CONTRACTION = 0.5  # ratio of successive changes above which the Jacobian is updated
ACCURATE_RELATIVE = 1e-7  # relative change below which the Jacobian is not updated any more
MOST_FACTORISATIONS = 4  # Jacobians per solution


@dataclass(frozen=True, eq=False)
class Newton(NativeFunction):
    """Simplified Newton iteration for r(x, given) = 0 with a Jacobian of finite differences.

    The Jacobian is computed at the start, and again where changes do not halve (Hairer and Wanner, Solving ODEs II, IV.8).
    The iteration stops when the unregularised unknowns no longer change: regularised ones of redundant rows absorb rounding
    errors.

    Parameters
    ----------
    function : Function
        (x, given) → r.
    regularisation : ndarray, shape (size,)
        Regularisation added to the diagonal of the Jacobian, for redundant rows; the solution does not depend on it.
    most : int
        Iteration limit.
    """

    function: Function
    regularisation: np.ndarray
    most: int
    name = "newton"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs (x, given, scale of the changes) and of outputs (x, calls, Jacobians, last relative change)."""
        return len(self.function.inputs) + 1, self.size + 3

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.regularisation.size

    def operations(self) -> dict[str, int]:
        """Operations of one residual."""
        return self.function.operations()

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        residual, body = writer.body(self.function, 1), self.begin_scalar(writer.module, width)
        residual.attributes.add("noinline")
        _NewtonWriter(self, body, residual).write()
        return body


class _NewtonWriter:
    def __init__(self, newton: Newton, body: ir.Function, residual: ir.Function):
        self.newton, self.body, self.residual, self.n = newton, body, residual, newton.size
        self.b = b = ir.IRBuilder(body.append_basic_block("entry"))
        room = lambda size: b.alloca(DOUBLE, INTEGER(size))  # noqa: E731
        self.x, self.r, self.moved, self.delta = (room(size) for size in (len(newton.inputs), self.n, self.n, self.n))
        self.matrix = room(self.n**2)
        self.before, self.change, self.calls, self.matrices, self.count = (room(1) for _ in range(5))
        self.pivots, self.info = b.alloca(WHOLE, INTEGER(self.n)), b.alloca(WHOLE)
        self.order, self.one, self.letter = b.alloca(WHOLE), b.alloca(WHOLE), b.alloca(ir.IntType(8))
        for place, value in ((self.order, WHOLE(self.n)), (self.one, WHOLE(1)), (self.letter, ir.IntType(8)(ord("N")))):
            b.store(value, place)

    def write(self):
        b, n = self.b, self.n
        source, in_stride, target, out_stride = self.body.args
        for k in range(len(self.newton.inputs)):
            b.store(b.load(b.gep(source, [b.mul(in_stride, INTEGER(k))])), b.gep(self.x, [INTEGER(k)]))
        for place in (self.calls, self.matrices, self.count):
            b.store(_number(0.0), place)
        self._evaluate(self.r)
        matrix, iterate, after = (self.body.append_basic_block(name) for name in ("matrix", "iterate", "after"))
        b.branch(matrix)
        b.position_at_end(matrix)
        self._differences()
        factorise = lapack_routine(self.body.module, "dgetrf")
        b.call(factorise, [self.order, self.order, self.matrix, self.order, self.pivots, self.info])
        self._add(self.matrices)
        b.store(_number(np.inf), self.before)
        b.branch(iterate)
        b.position_at_end(iterate)
        self._step()
        change, before = b.load(self.change), b.load(self.before)
        b.store(change, self.before)
        small = b.fcmp_ordered("<", change, _number(ACCURATE_RELATIVE))
        rounding = b.and_(b.fcmp_ordered("<", change, _number(CONVERGED_RELATIVE)), b.fcmp_ordered(">=", change, before))
        moving = b.fcmp_ordered(">", change, _number(0.0))  # false for NaN
        many = b.fcmp_ordered(">=", b.load(self.count), _number(self.newton.most))
        slow = b.and_(b.not_(small), b.fcmp_ordered(">", change, b.fmul(_number(SLOW_CONTRACTION), before)))
        again = b.and_(slow, b.fcmp_ordered("<", b.load(self.matrices), _number(MOST_FACTORISATIONS)))
        goes_on = self.body.append_basic_block("on")
        b.cbranch(b.or_(b.or_(rounding, b.not_(moving)), many), after, goes_on)
        b.position_at_end(goes_on)
        b.cbranch(again, matrix, iterate)
        b.position_at_end(after)
        results = [*(b.load(b.gep(self.x, [INTEGER(k)])) for k in range(n))]
        results += [b.load(place) for place in (self.calls, self.matrices, self.change)]
        for k, value in enumerate(results):
            b.store(value, b.gep(target, [b.mul(out_stride, INTEGER(k))]))
        b.ret_void()

    def _evaluate(self, found):
        self.b.call(self.residual, [self.x, INTEGER(1), found, INTEGER(1)])
        self._add(self.calls)

    def _add(self, counter):
        self.b.store(self.b.fadd(self.b.load(counter), _number(1.0)), counter)

    def _differences(self):
        """Jacobian by differences of the residual, column by column."""
        b = self.b
        size = self._size()
        with self._each() as j:
            place = b.gep(self.x, [j])
            here = b.load(place)
            there = b.fadd(here, b.fmul(_number(DIFFERENCE_RELATIVE), b.fadd(self._abs(here), size)))
            b.store(there, place)
            self._evaluate(self.moved)
            b.store(here, place)
            share = b.fdiv(_number(1.0), b.fsub(there, here))
            column = b.gep(self.matrix, [b.mul(j, INTEGER(self.n))])
            with self._each() as i:
                change = b.fsub(b.load(b.gep(self.moved, [i])), b.load(b.gep(self.r, [i])))
                b.store(b.fmul(change, share), b.gep(column, [i]))
        for k, regularisation in enumerate(self.newton.regularisation):
            if regularisation:
                place = b.gep(self.matrix, [INTEGER(k * (self.n + 1))])
                b.store(b.fadd(b.load(place), _number(regularisation)), place)

    def _step(self):
        """One iteration, and its change relative to the unknowns."""
        b = self.b
        with self._each() as i:
            b.store(b.load(b.gep(self.r, [i])), b.gep(self.delta, [i]))
        sizes = [self.letter, self.order, self.one, self.matrix, self.order, self.pivots, self.delta, self.order, self.info]
        b.call(lapack_routine(self.body.module, "dgetrs"), sizes)
        with self._each() as i:
            place = b.gep(self.x, [i])
            b.store(b.fsub(b.load(place), b.load(b.gep(self.delta, [i]))), place)
        self._add(self.count)
        change, size = self._unregularised_norm(self.delta), self._unregularised_norm(self.x)
        b.store(b.fdiv(change, b.fadd(size, self._size())), self.change)
        self._evaluate(self.r)

    def _size(self):
        """Scale of the changes, the last input."""
        return self.b.load(self.b.gep(self.x, [INTEGER(len(self.newton.inputs) - 1)]))

    def _unregularised_norm(self, values):
        """Sum of absolute values of the unregularised entries."""
        b, total = self.b, _number(0.0)
        for k in np.flatnonzero(self.newton.regularisation == 0.0):
            total = b.fadd(total, self._abs(b.load(b.gep(values, [INTEGER(int(k))]))))
        return total

    def _abs(self, value):
        return self.b.call(intrinsic(self.body.module, "llvm.fabs", DOUBLE, 1), [value])

    def _each(self):
        """Write a loop over all unknowns."""
        return counted_loop(self.b, INTEGER(0), INTEGER(self.n))


def _number(value: float) -> ir.Constant:
    return ir.Constant(DOUBLE, float(value))
