"""Taylor coefficients of the motion y' = f(t, y), to any order, as machine code.

Every node of the traced f has a series u₀ + u₁ h + u₂ h² + …, and its coefficients follow from those of its operands by
recurrences; those of y itself from y₍ₖ₊₁₎ = f₍ₖ₎ / (k + 1) (Griewank and Walther, Evaluating Derivatives, 2nd ed., table
13.2; Jorba and Zou, Experimental Mathematics 14, 2005, proposition 2.1).

What is not linear is a sum of products a₀ bₖ + a₁ b₍ₖ₋₁₎ + … + aₖ b₀. As soon as aₖ and bₖ are known, all products of them
with earlier coefficients are added to the sums of higher orders that they belong to: those lie in a row, and a vector
register takes several of them at a time. When an order is reached, only a₀ bₖ + aₖ b₀ is left to be added.

Long functions are cut into pieces, which are compiled sooner; all that one takes from another lies in rows.
"""

from contextlib import contextmanager
from dataclasses import dataclass, field

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
LINE = 64  # bytes of a line of the cache, and of the widest vector register
PIECE = 100  # operations, or products, of a piece
LINEAR = frozenset({"add", "sub", "neg"})
KNOWN = LINEAR | {"constant", "symbol", "mul", "div", "sqrt", "sin", "cos", "exp", "log"}


def without_series(function: Function) -> list[str]:
    """Operations of a function that have no Taylor series, as the values on two sides of a branch have none together."""
    return sorted({node.op for node in function.nodes} - KNOWN)


@dataclass(frozen=True, eq=False)
class Series:
    """(t, y, order) → series, a row of :data:`ROW` numbers each, those of y first; coefficient k stands at ``LEAD + k``.

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
        object.__setattr__(self, "outputs", range(ROW * len(self.plan.rows)))

    def write(self, writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time: its vectors lie along the orders."""
        if width != 1:
            raise TypeError("a Taylor series is compiled for one motion at a time.")
        return _write(writer, self.plan)


class _Plan:
    """What a function asks for: series that are kept, and products of two series that are summed.

    A series is named by its node, or by what it is and its node: ("slope", u) is that of k uₖ; of ("inverse", u) there is
    only 1/u₀.

    Attributes
    ----------
    rows : dict
        Row of each series that is kept; those of y come first.
    products : list
        (sum, one, other), names of series: products without the coefficients of order 0 are added to the sum.
    pieces : list
        Operations, in runs.
    """

    def __init__(self, rates: Function):
        self.rates = rates
        nodes = [node for node in rates.nodes if node.op not in ("symbol", "constant")]
        self.pieces = [nodes[k : k + PIECE] for k in range(0, len(nodes), PIECE)]
        products = (product for node in nodes for product in _products(node))
        self.products = list(dict.fromkeys(products))  # a sine and a cosine ask for the same ones
        piece_of = {node: k for k, piece in enumerate(self.pieces) for node in piece}
        crossing = [x for node in nodes for x in node.operands if x in piece_of and piece_of[x] != piece_of[node]]
        ends = [x for x in rates.outputs if isinstance(x, Expression) and not x.is_constant]
        inverse = [("inverse", x) for node in nodes for x in _divisors(node)]
        named = [name for product in self.products for name in product]
        names = dict.fromkeys([*rates.inputs[1:], rates.inputs[0], *named, *crossing, *ends, *inverse])
        self.rows = {name: k for k, name in enumerate(names)}

    @property
    def sums(self) -> list:
        """Names of all series that are summed up."""
        return list(dict.fromkeys(total for total, *_ in self.products))

    @property
    def first(self) -> Function:
        """Function (t, y) → coefficients of order 0 of all rows."""
        graph = self.rates.inputs[0].graph
        kinds = {"sin": lambda x: x.sin(), "cos": lambda x: x.cos(), "slope": lambda x: 0.0, "inverse": lambda x: 1.0 / x}
        outputs = [kinds[name[0]](name[1]) if isinstance(name, tuple) else name for name in self.rows]
        return Function("first", self.rates.inputs, [graph.lift(output) for output in outputs])


def _divisors(node: Expression) -> tuple:
    """Nodes that all coefficients of a node are divided by."""
    return {"div": node.operands[1:], "sqrt": (node,), "log": node.operands}.get(node.op, ())


def _products(node: Expression) -> list[tuple]:
    """Products that are summed for a node."""
    if node.op in LINEAR or node.operands[-1].is_constant:
        return []
    a, slope = node.operands[0], lambda name: ("slope", name)
    if node.op == "mul":
        return [] if a.is_constant else [(node, *node.operands)]
    if node.op == "div":
        return [(node, node, node.operands[1])]
    if node.op == "sqrt":
        return [(node, node, node)]
    if node.op == "exp":
        return [(node, slope(a), node)]
    if node.op == "log":
        return [(slope(node), slope(node), a)]
    return [(("sin", a), slope(a), ("cos", a)), (("cos", a), slope(a), ("sin", a))]


def _write(writer, plan: _Plan) -> ir.Function:
    """Order 0, then one order after the other."""
    module, rates = writer.module, plan.rates
    first = writer.body(plan.first)
    advance = [_Advance(module, plan, piece).function for piece in plan.pieces]
    parts = [plan.products[k : k + PIECE] for k in range(0, len(plan.products), PIECE)]
    spread = [_Spread(module, plan, part).function for part in parts]
    for code in (first, *advance, *spread) if len(plan.pieces) > 1 else ():
        code.attributes.add("noinline")
    series = _Rows(module, plan, "series", BODY)
    given, _, rows, _ = series.function.args
    series.rows, b, one = rows, series.b, INTEGER(1)
    order = b.fptosi(series.lanes.load(given, INTEGER(len(rates.inputs))), INTEGER)
    b.call(first, [given, one, b.gep(rows, [INTEGER(LEAD)]), INTEGER(ROW)])
    top = b.sub(order, one)
    with series.blocks(top) as j:
        for name in plan.sums:
            series.block.store(series.block.constant(0.0), *series.place(name, j))
    with series.loop(INTEGER(0), order, 1) as k:
        with b.if_then(b.icmp_signed(">", k, INTEGER(0))):
            clock = b.select(b.icmp_signed("==", k, one), series.lanes.constant(1.0), series.lanes.constant(0.0))
            series.lanes.store(clock, *series.place(rates.inputs[0], k))
            for code in advance:
                b.call(code, [rows, k])
            rest = b.sub(top, k)
            rest = b.select(b.icmp_signed("<", k, rest), k, rest)
            with series.blocks(rest) as j:
                for code in spread:
                    b.call(code, [rows, k, j])
        after = b.add(k, one)
        share = b.fdiv(series.lanes.constant(1.0), b.sitofp(after, DOUBLE))
        for symbol, output in zip(rates.inputs[1:], rates.outputs, strict=True):
            series.lanes.store(b.fmul(series.rate(output, k), share), *series.place(symbol, after))
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

    def rate(self, output, k):
        """Coefficient of order k of an output of the rates."""
        if isinstance(output, Expression) and not output.is_constant:
            return self.lanes.load(*self.place(output, k))
        value = output.value if isinstance(output, Expression) else float(output)
        first = self.b.icmp_signed("==", k, INTEGER(0))
        return self.b.select(first, self.lanes.constant(value), self.lanes.constant(0.0))

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
        for total, one, other in products:
            place, early = self.place(total, b.add(k, j)), b.select(before, block.load(*self.place(one, j)), none)
            late = b.select(reached, block.load(*self.place(other, j)), none)
            latest = [block.spread(self.lanes.load(*self.place(name, k))) for name in (one, other)]
            added = b.fadd(block.load(*place), b.fmul(latest[1], early, flags=FLAGS), flags=FLAGS)
            block.store(b.fadd(added, b.fmul(latest[0], late, flags=FLAGS), flags=FLAGS), *place)
        b.ret_void()


class _Advance(_Rows):
    """(rows, k): coefficients of order k > 0 of some operations.

    A method for each gives its coefficient from its operands; None stands for a constant's, which is zero.
    """

    def __init__(self, module: ir.Module, plan: _Plan, nodes):
        super().__init__(module, plan, "advance", ir.FunctionType(ir.VoidType(), [POINTER, INTEGER]))
        self.k, self.now = self.function.args[1], {}
        self.number = self.b.sitofp(self.k, DOUBLE)
        self.share = self.b.fdiv(self.lanes.constant(1.0), self.number)
        for node in nodes:
            self._keep(node, getattr(self, f"_{node.op}")(node, *node.operands))
        self.b.ret_void()

    def _add(self, node, x, y):
        x, y = self._of(x), self._of(y)
        return y if x is None else x if y is None else self._plus(x, y)

    def _sub(self, node, x, y):
        x, y = self._of(x), self._of(y)
        return x if y is None else self.b.fneg(y) if x is None else self._minus(x, y)

    def _neg(self, node, x):
        return self.b.fneg(self._of(x))

    def _mul(self, node, x, y):
        for factor, other in ((x, y), (y, x)):
            if factor.is_constant:
                return self._times(self._first(factor), self._of(other))
        total = self._plus(self._sum(node), self._times(self._first(x), self._of(y)))
        return self._plus(total, self._times(self._of(x), self._first(y)))

    def _div(self, node, x, y):
        share = self._first(("inverse", y))
        if y.is_constant:
            return self._times(self._of(x), share)
        taken = self._plus(self._sum(node), self._times(self._first(node), self._of(y)))
        return self._times(self.b.fneg(taken) if x.is_constant else self._minus(self._of(x), taken), share)

    def _sqrt(self, node, x):
        left = self._minus(self._of(x), self._sum(node))
        return self._times(left, self._times(self.lanes.constant(0.5), self._first(("inverse", node))))

    def _exp(self, node, x):
        return self._times(self._plus(self._sum(node), self._times(self._slope(x), self._first(node))), self.share)

    def _log(self, node, x):
        left = self._minus(self._times(self.number, self._of(x)), self._sum(("slope", node)))
        slope = self._times(left, self._first(("inverse", x)))
        self._keep(("slope", node), slope)
        return self._times(slope, self.share)

    def _sin(self, node, x):
        if (node.op, x) not in self.now:
            for name, other, sign in (("sin", "cos", self.share), ("cos", "sin", self.b.fneg(self.share))):
                total = self._plus(self._sum((name, x)), self._times(self._slope(x), self._first((other, x))))
                self._keep((name, x), self._times(total, sign))
        return self.now[node.op, x]

    _cos = _sin

    def _slope(self, x):
        """K times the coefficient of order k."""
        if ("slope", x) not in self.now:
            self._keep(("slope", x), self._times(self.number, self._of(x)))
        return self.now["slope", x]

    def _of(self, node):
        """Coefficient of order k."""
        if node not in self.now:
            self.now[node] = None if node.is_constant else self.lanes.load(*self.place(node, self.k))
        return self.now[node]

    def _first(self, name):
        """Coefficient of order 0."""
        if isinstance(name, Expression) and name.is_constant:
            return self.lanes.constant(name.value)
        return self.lanes.load(*self.place(name, INTEGER(0)))

    def _sum(self, name):
        """Products that were added up for order k."""
        return self.lanes.load(*self.place(name, self.k))

    def _keep(self, name, value):
        self.now[name] = value
        if name in self.plan.rows:
            self.lanes.store(value, *self.place(name, self.k))

    def _plus(self, x, y):
        return self.b.fadd(x, y, flags=FLAGS)

    def _minus(self, x, y):
        return self.b.fsub(x, y, flags=FLAGS)

    def _times(self, x, y):
        return self.b.fmul(x, y, flags=FLAGS)


def _in_all(b: ir.IRBuilder, value, width: int):
    """Whole number in every lane."""
    kind, places = ir.VectorType(INTEGER, width), ir.VectorType(ir.IntType(32), width)
    single = b.insert_element(ir.Constant(kind, ir.Undefined), value, ir.IntType(32)(0))
    return b.shuffle_vector(single, ir.Constant(kind, ir.Undefined), ir.Constant(places, [0] * width))
