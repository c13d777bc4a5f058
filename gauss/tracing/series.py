"""Taylor coefficients of the motion y' = f(t, y), to any order, as machine code.

Every node of the traced f has a series u₀ + u₁ h + u₂ h² + …, and its coefficients follow from those of its operands by
recurrences; those of y itself from y₍ₖ₊₁₎ = f₍ₖ₎ / (k + 1) (Griewank and Walther, Evaluating Derivatives, 2nd ed., table
13.2; Jorba and Zou, Experimental Mathematics 14, 2005, proposition 2.1).

What is not linear is a sum of products a₀ bₖ + a₁ b₍ₖ₋₁₎ + … + aₖ b₀. As soon as aₖ and bₖ are known, all products of them
with earlier coefficients are added to the sums of higher orders that they belong to: those lie in a row, and a vector
register takes several of them at a time. When an order is reached, only a₀ bₖ + aₖ b₀ is left to be added.

Long functions are cut into pieces, which are compiled sooner; all that one takes from another lies in rows.
"""

from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby

from llvmlite import ir

from gauss.tracing import machine
from gauss.tracing.blocks import BODY, POINTER
from gauss.tracing.expression import Expression
from gauss.tracing.function import Function
from gauss.tracing.lanes import DOUBLE, FLAGS, INTEGER, Lanes

HIGHEST = 24  # order
WIDEST = 8  # lanes of a vector register
LEAD = WIDEST - 1  # numbers before a series: its coefficient of order 1 begins a line of the cache
ROW = LEAD + HIGHEST + 1 + WIDEST  # numbers from one series to the next
WINDOW = HIGHEST + WIDEST  # numbers of what is added up for a sum
LINE = 64  # bytes of a line of the cache, and of the widest vector register
PIECE = 100  # operations, or products, of a piece
LINEAR = frozenset({"add", "sub", "neg"})
SUMS = LINEAR | {"mul"}
KNOWN = LINEAR | {"constant", "symbol", "mul", "div", "sqrt", "sin", "cos", "exp", "log"}


def without_series(function: Function) -> list[str]:
    """Operations of a function that have no Taylor series, as the values on two sides of a branch have none together."""
    return sorted({node.op for node in function.nodes} - KNOWN)


@dataclass(frozen=True, eq=False)
class Series:
    """(t, y, order) → series, a row of :data:`ROW` numbers each, those of y first; coefficient k stands at ``LEAD + k``.

    Behind the rows, there is room for a number of each.

    Parameters
    ----------
    rates : Function
        (t, y) → y'.
    """

    rates: Function
    plan: "_Plan" = field(init=False)
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "plan", _Plan(self.rates))
        object.__setattr__(self, "inputs", range(len(self.rates.inputs) + 1))
        object.__setattr__(self, "outputs", range(self.plan.size))

    def write(self, writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time: its vectors lie along the orders."""
        if width != 1:
            raise TypeError("a Taylor series is compiled for one motion at a time.")
        return _write(writer, self.plan)


class _Plan:
    """What a function asks for: series that are kept, and products of two series that are summed.

    A series is named by its node, or by what it is and its node: ("slope", u) is that of k uₖ; of ("inverse", u) there is
    only 1/u₀. Sums and products that are used once, in a sum, are terms of that.

    Attributes
    ----------
    rows : dict
        Row of each series that is kept; those of y come first.
    history : int
        How many of them, the first ones, are asked for former coefficients.
    products : list
        (sum, sign, one, other), names of series: products without the coefficients of order 0 are added to the sum.
    pieces : list
        Operations, in runs.
    depth : dict
        How many operations lie before each of them.
    """

    def __init__(self, rates: Function):
        self.rates = rates
        nodes = [node for node in rates.nodes if node.op not in ("symbol", "constant")]
        self.inside = _inside(nodes, rates.outputs)
        nodes = [node for node in nodes if node not in self.inside]
        self.pieces = [nodes[k : k + PIECE] for k in range(0, len(nodes), PIECE)]
        products = (product for node in nodes for product in self._products(node))
        self.products = list(dict.fromkeys(products))  # a sine and a cosine ask for the same ones
        piece_of, self.depth, crossing = {node: k for k, piece in enumerate(self.pieces) for node in piece}, {}, []
        for node in nodes:
            sources = self._sources(node)
            crossing += [x for x in sources if x in piece_of and piece_of[x] != piece_of[node]]
            self.depth[node] = 1 + max((self.depth.get(x, 0) for x in sources), default=0)
        ends = [x for x in rates.outputs if isinstance(x, Expression) and not x.is_constant]
        inverse = [("inverse", x) for node in nodes for x in _divisors(node)]
        named = [name for *_, one, other in self.products for name in (one, other)]
        past = dict.fromkeys([*rates.inputs[1:], *named])
        names = dict.fromkeys([*past, rates.inputs[0], *crossing, *ends, *inverse])
        self.history = len(past)
        self.rows = {name: k for k, name in enumerate(names)}

    @property
    def parts(self) -> list:
        """Products in runs; those of one sum are together, for its window is moved on once."""
        found = [[]]
        for _, products in groupby(self.products, lambda product: product[0]):
            if len(found[-1]) >= PIECE:
                found.append([])
            found[-1] += products
        return found

    @cached_property
    def sums(self) -> dict:
        """Number of each series that is summed up."""
        return {name: k for k, name in enumerate(dict.fromkeys(total for total, *_ in self.products))}

    @property
    def size(self) -> int:
        """Numbers of all rows, of the latest coefficients, and of all windows."""
        return self.windows + WINDOW * len(self.sums)

    @property
    def windows(self) -> int:
        """Place where the windows of the sums begin, each in a line of the cache."""
        return -(-(ROW + 1) * len(self.rows) // WIDEST) * WIDEST

    @property
    def first(self) -> Function:
        """Function (t, y) → coefficients of order 0 of all rows."""
        graph = self.rates.inputs[0].graph
        kinds = {"sin": lambda x: x.sin(), "cos": lambda x: x.cos(), "slope": lambda x: 0.0, "inverse": lambda x: 1.0 / x}
        outputs = [kinds[name[0]](name[1]) if isinstance(name, tuple) else name for name in self.rows]
        return Function("first", self.rates.inputs, [graph.lift(output) for output in outputs])

    def terms(self, node: Expression) -> list[tuple]:
        """Terms (sign, factors) of a sum or product: one factor, or two."""
        found, waiting = [], [(1, node)]
        while waiting:
            sign, x = waiting.pop()
            if x is not node and x not in self.inside:
                found.append((sign, (x,)))
            elif x.op == "mul":
                found.append((sign, x.operands))
            else:
                signs = (-sign,) if x.op == "neg" else (sign, sign if x.op == "add" else -sign)
                waiting += reversed(list(zip(signs, x.operands, strict=True)))
        return found

    def _sources(self, node: Expression) -> list[Expression]:
        """What a node is made of."""
        if node.op in SUMS:
            return [x for _, factors in self.terms(node) for x in factors]
        return list(node.operands)

    def _products(self, node: Expression) -> list[tuple]:
        """Products that are summed for a node."""
        if node.op in SUMS:
            terms = self.terms(node)
            return [(node, sign, *xs) for sign, xs in terms if len(xs) == 2 and not any(x.is_constant for x in xs)]
        if node.operands[-1].is_constant:
            return []
        a, slope = node.operands[0], lambda name: ("slope", name)
        if node.op == "div":
            return [(node, 1, node, node.operands[1])]
        if node.op == "sqrt":
            return [(node, 1, node, node)]
        if node.op == "exp":
            return [(node, 1, slope(a), node)]
        if node.op == "log":
            return [(slope(node), 1, slope(node), a)]
        return [(("sin", a), 1, slope(a), ("cos", a)), (("cos", a), 1, slope(a), ("sin", a))]


def _inside(nodes, outputs) -> set[Expression]:
    """Sums and products that one sum uses, once."""
    uses = Counter(x for node in nodes for x in node.operands)
    ends = {x for x in outputs if isinstance(x, Expression)}
    terms = (x for node in nodes if node.op in LINEAR for x in node.operands)
    return {x for x in terms if x.op in SUMS and uses[x] == 1 and x not in ends}


def _divisors(node: Expression) -> tuple:
    """Nodes that all coefficients of a node are divided by."""
    return {"div": node.operands[1:], "sqrt": (node,), "log": node.operands}.get(node.op, ())


def _write(writer, plan: _Plan) -> ir.Function:
    """Order 0, then one order after the other."""
    module, rates = writer.module, plan.rates
    first = writer.body(plan.first)
    advance = [_Advance(module, plan, piece).function for piece in plan.pieces]
    spread = [_Spread(module, plan, part).function for part in plan.parts]
    for code in (first, *advance, *spread) if len(plan.pieces) > 1 else ():
        code.attributes.add("noinline")
    series = _Rows(module, plan, "series", BODY)
    given, _, rows, _ = series.function.args
    series.rows, b, one = rows, series.b, INTEGER(1)
    order = b.fptosi(series.lanes.load(given, INTEGER(len(rates.inputs))), INTEGER)
    b.call(first, [given, one, b.gep(rows, [INTEGER(LEAD)]), INTEGER(ROW)])
    top, none = b.sub(order, one), series.lanes.constant(0.0)
    with series.loop(INTEGER(plan.windows), INTEGER(plan.size), series.block.width) as place:
        series.block.store(series.block.constant(0.0), rows, place)
    simple = b.icmp_signed("<=", top, INTEGER(2 * series.block.width + 1))  # sums then reach no further than one register
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
            for code in spread:
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


class _Rows:
    """Writer of one function of rows of coefficients."""

    def __init__(self, module: ir.Module, plan: _Plan, name: str, kind: ir.FunctionType):
        self.plan = plan
        self.function = ir.Function(module, kind, name=module.get_unique_name(name))
        self.function.linkage = "internal"
        self.rows = self.function.args[0]
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.lanes, self.block = Lanes(module, 1, self.b), Lanes(module, machine.width(), self.b)

    def place(self, name, k):
        """Pointer to the rows, and offset of the coefficient of order k of one of them."""
        return self.rows, self.b.add(k, INTEGER(ROW * self.plan.rows[name] + LEAD))

    def latest(self, name):
        """Pointer and offset of the latest coefficient."""
        return self.rows, INTEGER(ROW * len(self.plan.rows) + self.plan.rows[name])

    def window(self, name, j):
        """Pointer and offset of what was added up for order k + j of a sum, k being the latest order that was filed.

        So a register is always written where it is read again, and passed on before it has reached the memory.
        """
        return self.rows, self.b.add(j, INTEGER(self.plan.windows + WINDOW * self.plan.sums[name] - 1))

    def file(self, k):
        """Put the latest coefficients, of order k, in their rows, a vector register at a time.

        One that is read where a single number has just been written waits until that has reached the memory.
        """
        b, block = self.b, self.block
        past = b.and_(b.sub(k, INTEGER(1)), INTEGER(-block.width))
        begin, lanes = b.add(past, INTEGER(1)), ir.VectorType(INTEGER, block.width)
        here = b.icmp_signed("==", _in_all(b, b.sub(k, begin), block.width), ir.Constant(lanes, list(range(block.width))))
        with self.loop(INTEGER(0), INTEGER(self.plan.history), 1) as row:
            place = b.add(b.mul(row, INTEGER(ROW)), b.add(begin, INTEGER(LEAD)))
            latest = b.add(row, INTEGER(ROW * len(self.plan.rows)))
            value = block.spread(self.lanes.load(self.rows, latest))
            block.store(b.select(here, value, block.load(self.rows, place)), self.rows, place)

    def blocks(self, last):
        """Write a loop over orders from 1 to the last, as many at a time as there are lanes."""
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


class _Spread(_Rows):
    """(rows, k, j): products of coefficients of order k with those of orders j … of the other factor, added up."""

    def __init__(self, module: ir.Module, plan: _Plan, products):
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
                latest = [block.spread(self.lanes.load(*self.latest(factor))) for factor in (one, other)]
                early = b.select(before, block.load(*self.place(one, j)), none)
                late = b.select(reached, block.load(*self.place(other, j)), none)
                for part in (b.fmul(latest[1], early, flags=FLAGS), b.fmul(latest[0], late, flags=FLAGS)):
                    total = b.fadd(total, part, flags=FLAGS) if sign > 0 else b.fsub(total, part, flags=FLAGS)
            block.store(total, *place)
        b.ret_void()


class _Advance(_Rows):
    """(rows, k): coefficients of order k > 0 of some operations; for each there is a method.

    Every order waits for the one before, so what is known early is added first: what comes last is one operation from its
    result.
    """

    def __init__(self, module: ir.Module, plan: _Plan, nodes):
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
        """Sum and products of nodes with numbers, those that are known late last."""
        for x, factor in sorted(terms, key=lambda term: self.plan.depth.get(term[0], 0)):
            total = self._plus(total, self._times(self._of(x), factor))
        return total

    def _slope(self, x):
        """K times the coefficient of order k."""
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
        """Products that were added up for order k."""
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
    """Whole number in every lane."""
    kind = ir.VectorType(INTEGER, width)
    single = b.insert_element(ir.Constant(kind, ir.Undefined), value, ir.IntType(32)(0))
    return b.shuffle_vector(single, ir.Constant(kind, ir.Undefined), _places([0] * width))


def _places(lanes) -> ir.Constant:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), list(lanes))
