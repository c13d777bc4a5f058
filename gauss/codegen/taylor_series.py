"""Taylor coefficients of the solution of y' = f(t, y), to any order, as machine code.

Nonlinear operations are Cauchy products a₀ bₖ + a₁ b₍ₖ₋₁₎ + … + aₖ b₀. As soon as aₖ and bₖ are known, their products with
earlier coefficients are added to the partial sums of the higher orders (online convolution): these are contiguous, so that a
vector register holds several. At order k only a₀ bₖ + aₖ b₀ remains. :mod:`gauss.codegen.recurrences` lists the series and
the products.
"""

from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import groupby

from llvmlite import ir

from gauss.codegen import machine
from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import BODY, POINTER
from gauss.codegen.lanes import DOUBLE, FLAGS, INTEGER, Lanes
from gauss.codegen.recurrences import LEAD, ROW, SUMS, WINDOW, SeriesPlan


@dataclass(frozen=True, eq=False)
class Series:
    """(t, y, order) → series, a row of :data:`ROW` numbers each, those of y first; coefficient k stands at ``LEAD + k``.

    Behind the rows lie the latest coefficients, one of each row.

    Parameters
    ----------
    rates : Function
        (t, y) → y'.
    """

    rates: Function
    plan: SeriesPlan = field(init=False)
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "plan", SeriesPlan(self.rates))
        object.__setattr__(self, "inputs", range(len(self.rates.inputs) + 1))
        object.__setattr__(self, "outputs", range(self.plan.size))

    def write(self, writer, width: int) -> ir.Function:
        """Machine code for one motion at a time: its SIMD lanes are orders."""
        if width != 1:
            raise TypeError("a Taylor series is compiled for one motion at a time.")
        return _write(writer, self.plan)


def _write(writer, plan: SeriesPlan) -> ir.Function:
    """Emit order 0, then the loop over orders."""
    module, rates = writer.module, plan.rates
    first = writer.body(plan.first)
    advance = [_AdvanceWriter(module, plan, piece).function for piece in plan.pieces]
    convolve = [_ConvolutionWriter(module, plan, part).function for part in plan.parts]
    for code in (first, *advance, *convolve) if len(plan.pieces) > 1 else ():
        code.attributes.add("noinline")
    series = _SeriesWriter(module, plan, "series", BODY)
    given, _, rows, _ = series.function.args
    series.rows, b, one = rows, series.b, INTEGER(1)
    order = b.fptosi(series.lanes.load(given, INTEGER(len(rates.inputs))), INTEGER)
    b.call(first, [given, one, b.gep(rows, [INTEGER(LEAD)]), INTEGER(ROW)])
    top, none = b.sub(order, one), series.lanes.constant(0.0)
    with series.loop(INTEGER(plan.windows), INTEGER(plan.size), series.block.width) as place:
        series.block.store(series.block.constant(0.0), rows, place)
    simple = b.icmp_signed("<=", top, INTEGER(2 * series.block.width + 1))  # the partial sums then fit in one register
    for symbol, output in zip(rates.inputs[1:], rates.outputs, strict=True):
        value = output.value if isinstance(output, Expression) and output.is_constant else output
        known = isinstance(value, Expression)
        value = series.lanes.load(*series.place(value, INTEGER(0))) if known else series.lanes.constant(float(value))
        series.lanes.store(value, *series.latest(symbol))
    with series.loop(one, order, 1) as k:
        clock = b.select(b.icmp_signed("==", k, one), series.lanes.constant(1.0), series.lanes.constant(0.0))
        series.lanes.store(clock, *series.latest(rates.inputs[0]))
        for code in advance:
            b.call(code, [rows, k])
        series.file(k)
        rest = b.sub(top, k)
        rest = b.select(b.and_(simple, b.icmp_signed("<", k, rest)), k, rest)
        with series.blocks(rest) as j:
            for code in convolve:
                b.call(code, [rows, k, j])
        share, following = b.fdiv(series.lanes.constant(1.0), b.sitofp(b.add(k, one), DOUBLE)), []
        for output in rates.outputs:
            varies = isinstance(output, Expression) and not output.is_constant
            following.append(b.fmul(series.lanes.load(*series.latest(output)), share) if varies else none)
        for symbol, value in zip(rates.inputs[1:], following, strict=True):
            series.lanes.store(value, *series.latest(symbol))
    for symbol in rates.inputs[1:]:
        series.lanes.store(series.lanes.load(*series.latest(symbol)), *series.place(symbol, order))
    b.ret_void()
    return series.function


class _SeriesWriter:
    """Emitter of one function of rows of coefficients."""

    def __init__(self, module: ir.Module, plan: SeriesPlan, name: str, kind: ir.FunctionType):
        self.plan = plan
        self.function = ir.Function(module, kind, name=module.get_unique_name(name))
        self.function.linkage = "internal"
        self.rows = self.function.args[0]
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.lanes, self.block = Lanes(module, 1, self.b), Lanes(module, machine.width(), self.b)

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
        here = b.icmp_signed("==", _in_all(b, b.sub(k, begin), block.width), ir.Constant(lanes, list(range(block.width))))
        with self.loop(INTEGER(0), INTEGER(self.plan.history), 1) as row:
            place = b.add(b.mul(row, INTEGER(ROW)), b.add(begin, INTEGER(LEAD)))
            latest = b.add(row, INTEGER(ROW * len(self.plan.rows)))
            value = block.broadcast(self.lanes.load(self.rows, latest))
            block.store(b.select(here, value, block.load(self.rows, place)), self.rows, place)

    def blocks(self, last):
        """Write a loop over orders from 1 to the last, a vector register at a time."""
        return self.loop(INTEGER(1), self.b.add(last, INTEGER(1)), self.block.width)

    @contextmanager
    def loop(self, first, end, step: int):
        """Write ``for (k = first; k < end; k += step)``; what is written in this context is inside."""
        before = self.b.block
        head, inside, after = (self.function.append_basic_block(name) for name in ("head", "inside", "after"))
        self.b.branch(head)
        self.b.position_at_end(head)
        k = self.b.phi(INTEGER)
        k.add_incoming(first, before)
        self.b.cbranch(self.b.icmp_signed("<", k, end), inside, after)
        self.b.position_at_end(inside)
        yield k
        k.add_incoming(self.b.add(k, INTEGER(step)), self.b.block)
        self.b.branch(head)
        self.b.position_at_end(after)


class _ConvolutionWriter(_SeriesWriter):
    """(rows, k, j): adds the products of the coefficients of order k with those of the orders from j on."""

    def __init__(self, module: ir.Module, plan: SeriesPlan, products):
        super().__init__(module, plan, "spread", ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, INTEGER]))
        _, k, j = self.function.args
        b, block = self.b, self.block
        steps = ir.Constant(ir.VectorType(INTEGER, block.width), list(range(block.width)))
        orders, here = b.add(_in_all(b, j, block.width), steps), _in_all(b, k, block.width)
        before, reached = b.icmp_signed("<", orders, here), b.icmp_signed("<=", orders, here)
        none = block.constant(0.0)
        for name, terms in groupby(products, lambda product: product[0]):
            place, after = self.window(name, j), self.window(name, b.add(j, INTEGER(block.width)))
            total = b.shuffle_vector(block.load(*place), block.load(*after), _places(range(1, block.width + 1)))
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
        super().__init__(module, plan, "advance", ir.FunctionType(ir.VoidType(), [POINTER, INTEGER]))
        self.k, self.now = self.function.args[1], {}
        self.number = self.b.sitofp(self.k, DOUBLE)
        self.share = self.b.fdiv(self.lanes.constant(1.0), self.number)
        for node in nodes:
            self._keep(node, (self._of_sum if node.op in SUMS else getattr(self, f"_{node.op}"))(node, *node.operands))
        self.b.ret_void()

    def _of_sum(self, node, *_):
        terms, summed = [], False
        for sign, factors in self.plan.terms(node):
            varying = [x for x in factors if not x.is_constant]
            summed = summed or len(varying) == 2
            if len(factors) == 1:
                terms += [(sign, x, None) for x in varying]
            else:
                x, y = factors
                terms += [(sign, one, other) for one, other in ((x, y), (y, x)) if not one.is_constant]
        terms.sort(key=lambda term: self.plan.depth.get(term[1], 0))
        total = self._sum(node) if summed else None
        for sign, x, other in terms:
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


def _in_all(b: ir.IRBuilder, value, width: int):
    """Broadcast an integer to every lane."""
    kind = ir.VectorType(INTEGER, width)
    single = b.insert_element(ir.Constant(kind, ir.Undefined), value, ir.IntType(32)(0))
    return b.shuffle_vector(single, ir.Constant(kind, ir.Undefined), _places([0] * width))


def _places(lanes) -> ir.Constant:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), list(lanes))
