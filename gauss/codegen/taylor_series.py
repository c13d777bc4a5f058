"""Taylor coefficients of the solution of y' = f(t, y), to any order, as machine code.

Nonlinear operations are Cauchy products a₀ bₖ + a₁ b₍ₖ₋₁₎ + … + aₖ b₀. As soon as aₖ and bₖ are known, their products with
earlier coefficients are added to the partial sums of the higher orders (online convolution): these are contiguous, so that a
vector register holds several. At order k only a₀ bₖ + aₖ b₀ remains. :mod:`gauss.codegen.recurrences` lists the series and
the products.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING

from llvmlite import ir

from gauss.codegen import processor
from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import POINTER, counted_loop
from gauss.codegen.ir_module import DOUBLE, INTEGER, broadcast, lane_indices
from gauss.codegen.lanes import FLAGS, Lanes
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.recurrences import LEAD, ROW, SUMS, WINDOW, SeriesPlan

if TYPE_CHECKING:
    from gauss.codegen.emit import Writer


@dataclass(frozen=True, eq=False)
class Series(NativeFunction):
    """(t, y, order) → series, a row of :data:`ROW` numbers each, those of y first; coefficient k stands at ``LEAD + k``.

    Behind the rows lie the latest coefficients, one of each row.

    Parameters
    ----------
    rates : Function
        (t, y) → y'.
    """

    rates: Function
    name = "series"

    @cached_property
    def plan(self) -> SeriesPlan:
        """Series and products."""
        return SeriesPlan(self.rates)

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return len(self.rates.inputs) + 1, self.plan.size

    def operations(self) -> dict[str, int]:
        """Operations of order 0."""
        return self.rates.operations()

    def write(self, writer: "Writer", width: int) -> ir.Function:
        """Machine code for one motion at a time: its SIMD lanes are orders."""
        module, plan = writer.module, self.plan
        first = writer.body(plan.first, strided=True)
        advance = [_AdvanceWriter(module, plan, piece).function for piece in plan.pieces]
        convolve = [_ConvolutionWriter(module, plan, part).function for part in plan.parts]
        for code in (first, *advance, *convolve) if len(plan.pieces) > 1 else ():
            code.attributes.add("noinline")
        return _OrderLoopWriter(plan, self.begin_scalar(module, width)).write(first, advance, convolve)


class _SeriesWriter:
    """Emitter of one function of rows of coefficients."""

    def __init__(self, plan: SeriesPlan, function: ir.Function):
        self.plan, self.function, module = plan, function, function.module
        self.rows = self.function.args[0]
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.lanes, self.block = Lanes(module, 1, self.b), Lanes(module, processor.width(), self.b)

    def place(self, name, k):
        """Pointer and offset of the coefficient of order k of a series."""
        return self.rows, self.b.add(k, INTEGER(ROW * self.plan.rows[name] + LEAD))

    def latest(self, name):
        """Pointer and offset of the latest coefficient of a series."""
        return self.rows, INTEGER(ROW * len(self.plan.rows) + self.plan.rows[name])

    def window(self, name, j):
        """Pointer and offset of the partial sum for order k + j, k being the latest stored order.

        The window is shifted with k, so that a register is stored at the address of its next load (store forwarding).
        """
        return self.rows, self.b.add(j, INTEGER(self.plan.windows + WINDOW * self.plan.sums[name] - 1))

    def file(self, k):
        """Store the latest coefficients, of order k, in their rows, a vector register at a time.

        A vector load from a freshly stored scalar would stall: store forwarding fails there.
        """
        b, block = self.b, self.block
        past = b.and_(b.sub(k, INTEGER(1)), INTEGER(-block.width))
        begin, lanes = b.add(past, INTEGER(1)), ir.VectorType(INTEGER, block.width)
        here = b.icmp_signed("==", broadcast(b, b.sub(k, begin), block.width), ir.Constant(lanes, list(range(block.width))))
        with self.loop(INTEGER(0), INTEGER(self.plan.history), 1) as row:
            place = b.add(b.mul(row, INTEGER(ROW)), b.add(begin, INTEGER(LEAD)))
            latest = b.add(row, INTEGER(ROW * len(self.plan.rows)))
            value = block.broadcast(self.lanes.load(self.rows, latest))
            block.store(b.select(here, value, block.load(self.rows, place)), self.rows, place)

    def blocks(self, last):
        """Write a loop over orders from 1 to the last, a vector register at a time."""
        return self.loop(INTEGER(1), self.b.add(last, INTEGER(1)), self.block.width)

    def loop(self, first, end, step: int):
        """Write ``for (k = first; k < end; k += step)``; the context is its body."""
        return counted_loop(self.b, first, end, step)


class _OrderLoopWriter(_SeriesWriter):
    """Emitter of the function of a series: order 0, then the loop over orders."""

    def __init__(self, plan: SeriesPlan, function: ir.Function):
        super().__init__(plan, function)
        self.rows = function.args[2]

    def write(self, first: ir.Function, advance: list[ir.Function], convolve: list[ir.Function]) -> ir.Function:
        """Emit the code that calls the functions of order 0, of the orders from 1 on, and of the Cauchy products."""
        b, one, lanes, symbols = self.b, INTEGER(1), self.lanes, self.plan.rates.inputs
        given = self.function.args[0]
        order = b.fptosi(lanes.load(given, INTEGER(len(symbols))), INTEGER)
        b.call(first, [given, one, b.gep(self.rows, [INTEGER(LEAD)]), INTEGER(ROW)])
        top = b.sub(order, one)
        with self.loop(INTEGER(self.plan.windows), INTEGER(self.plan.size), self.block.width) as place:
            self.block.store(self.block.constant(0.0), self.rows, place)
        simple = b.icmp_signed("<=", top, INTEGER(2 * self.block.width + 1))  # the partial sums then fit in one register
        for symbol, output in zip(symbols[1:], self.plan.rates.outputs, strict=True):
            lanes.store(self._order_zero(output), *self.latest(symbol))
        with self.loop(one, order, 1) as k:
            clock = b.select(b.icmp_signed("==", k, one), lanes.constant(1.0), lanes.constant(0.0))
            lanes.store(clock, *self.latest(symbols[0]))
            for code in advance:
                b.call(code, [self.rows, k])
            self.file(k)
            rest = b.sub(top, k)
            rest = b.select(b.and_(simple, b.icmp_signed("<", k, rest)), k, rest)
            with self.blocks(rest) as j:
                for code in convolve:
                    b.call(code, [self.rows, k, j])
            self._integrate(k)
        for symbol in symbols[1:]:
            lanes.store(lanes.load(*self.latest(symbol)), *self.place(symbol, order))
        b.ret_void()
        return self.function

    def _order_zero(self, output):
        """Coefficient of order 0 of an output of f."""
        value = output.value if isinstance(output, Expression) and output.is_constant else output
        if isinstance(value, Expression):
            return self.lanes.load(*self.place(value, INTEGER(0)))
        return self.lanes.constant(float(value))

    def _integrate(self, k):
        """Coefficients y₍ₖ₊₁₎ = f₍ₖ₎ / (k + 1) become the latest ones."""
        b, lanes, following = self.b, self.lanes, []
        share = b.fdiv(lanes.constant(1.0), b.sitofp(b.add(k, INTEGER(1)), DOUBLE))
        for output in self.plan.rates.outputs:
            varies = isinstance(output, Expression) and not output.is_constant
            following.append(b.fmul(lanes.load(*self.latest(output)), share) if varies else lanes.constant(0.0))
        for symbol, value in zip(self.plan.rates.inputs[1:], following, strict=True):
            lanes.store(value, *self.latest(symbol))


class _ConvolutionWriter(_SeriesWriter):
    """(rows, k, j): adds the products of the coefficients of order k with those of the orders from j on."""

    def __init__(self, module: ir.Module, plan: SeriesPlan, products):
        super().__init__(plan, _internal(module, "convolve", [POINTER, INTEGER, INTEGER]))
        _, k, j = self.function.args
        b, block = self.b, self.block
        steps = ir.Constant(ir.VectorType(INTEGER, block.width), list(range(block.width)))
        orders, here = b.add(broadcast(b, j, block.width), steps), broadcast(b, k, block.width)
        before, reached = b.icmp_signed("<", orders, here), b.icmp_signed("<=", orders, here)
        none = block.constant(0.0)
        for name, terms in groupby(products, lambda product: product[0]):
            place, after = self.window(name, j), self.window(name, b.add(j, INTEGER(block.width)))
            total = b.shuffle_vector(block.load(*place), block.load(*after), lane_indices(range(1, block.width + 1)))
            for _, sign, one, other in terms:
                latest = [block.broadcast(self.lanes.load(*self.latest(factor))) for factor in (one, other)]
                early = b.select(before, block.load(*self.place(one, j)), none)
                late = b.select(reached, block.load(*self.place(other, j)), none)
                for part in (b.fmul(latest[1], early, flags=FLAGS), b.fmul(latest[0], late, flags=FLAGS)):
                    total = b.fadd(total, part, flags=FLAGS) if sign > 0 else b.fsub(total, part, flags=FLAGS)
            block.store(total, *place)
        b.ret_void()


class _AdvanceWriter(_SeriesWriter):
    """(rows, k): coefficients of order k > 0 of some operations, one method for each kind.

    Orders depend on each other, so operands known early are added first: the last one is one operation from the result.
    """

    def __init__(self, module: ir.Module, plan: SeriesPlan, nodes):
        super().__init__(plan, _internal(module, "advance", [POINTER, INTEGER]))
        self.k = self.function.args[1]
        self.now: dict = {}
        self.number = self.b.sitofp(self.k, DOUBLE)
        self.share = self.b.fdiv(self.lanes.constant(1.0), self.number)
        for node in nodes:
            self._keep(node, (self._of_sum if node.op in SUMS else getattr(self, f"_{node.op}"))(node, *node.operands))
        self.b.ret_void()

    def _terms(self, node) -> list[tuple]:
        """Terms (sign, x, y) of order k of a sum: xₖ y₀, or xₖ where y is None; the deepest x last."""
        terms = []
        for sign, factors in self.plan.terms(node):
            pairs = [(factors[0], None)] if len(factors) == 1 else [factors, factors[::-1]]
            terms += [(sign, x, y) for x, y in pairs if not x.is_constant]
        return sorted(terms, key=lambda term: self.plan.depth.get(term[1], 0))

    def _of_sum(self, node, *_):
        factors = [factors for _, factors in self.plan.terms(node) if not any(x.is_constant for x in factors)]
        total = self._sum(node) if any(len(xs) == 2 for xs in factors) else None
        for sign, x, other in self._terms(node):
            value = self._of(x) if other is None else self._times(self._of(x), self._first(other))
            if total is None:
                total = value if sign > 0 else self.b.fneg(value)
            else:
                total = self._plus(total, value) if sign > 0 else self._minus(total, value)
        return total

    def _div(self, node, x, y):
        share = self._first(("inverse", y))
        if y.is_constant:
            return self._times(self._of(x), share)
        numerator = [] if x.is_constant else [(x, share)]
        denominator = [(y, self.b.fneg(self._times(self._first(node), share)))]
        return self._summed(self.b.fneg(self._times(self._sum(node), share)), numerator + denominator)

    def _sqrt(self, node, x):
        share = self._times(self.lanes.constant(0.5), self._first(("inverse", node)))
        return self._summed(self.b.fneg(self._times(self._sum(node), share)), [(x, share)])

    def _exp(self, node, x):
        self._slope(x)
        return self._summed(self._times(self._sum(node), self.share), [(x, self._first(node))])

    def _log(self, node, x):
        share = self._first(("inverse", x))
        early = self._times(self._times(self._sum(("slope", node)), self.share), share)
        value = self._summed(self.b.fneg(early), [(x, share)])
        self._keep(("slope", node), self._times(value, self.number))
        return value

    def _sin(self, node, x):
        if (node.op, x) not in self.now:
            self._slope(x)
            for name, other in (("sin", "cos"), ("cos", "sin")):
                value = self._summed(self._times(self._sum((name, x)), self.share), [(x, self._first((other, x)))])
                self._keep((name, x), value if name == "sin" else self.b.fneg(value))
        return self.now[node.op, x]

    _cos = _sin

    def _summed(self, total, terms):
        """Sum of products of nodes and factors, the deepest last."""
        for x, factor in sorted(terms, key=lambda term: self.plan.depth.get(term[0], 0)):
            total = self._plus(total, self._times(self._of(x), factor))
        return total

    def _slope(self, x):
        """Record k uₖ, the coefficient of the slope."""
        if ("slope", x) not in self.now:
            self._keep(("slope", x), self._times(self.number, self._of(x)))
        return self.now["slope", x]

    def _of(self, node):
        """Coefficient of order k."""
        if node not in self.now:
            self.now[node] = self.lanes.load(*self.latest(node))
        return self.now[node]

    def _first(self, name):
        """Coefficient of order 0."""
        if isinstance(name, Expression) and name.is_constant:
            return self.lanes.constant(name.value)
        return self.lanes.load(*self.place(name, INTEGER(0)))

    def _sum(self, name):
        """Partial sum for order k."""
        return self.lanes.load(*self.window(name, INTEGER(1)))

    def _keep(self, name, value):
        self.now[name] = value
        if name in self.plan.rows:
            self.lanes.store(value, *self.latest(name))

    def _plus(self, x, y):
        return self.b.fadd(x, y, flags=FLAGS)

    def _minus(self, x, y):
        return self.b.fsub(x, y, flags=FLAGS)

    def _times(self, x, y):
        return self.b.fmul(x, y, flags=FLAGS)


def _internal(module: ir.Module, name: str, kinds: list[ir.Type]) -> ir.Function:
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name=module.get_unique_name(name))
    function.linkage = "internal"
    return function
