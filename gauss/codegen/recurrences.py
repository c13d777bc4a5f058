"""Taylor coefficients of the solution of y' = f(t, y): the series to be stored, and the Cauchy products of them.

Every node of the traced f has a series u₀ + u₁ h + u₂ h² + …, and its coefficients follow from those of its operands by
recurrences; those of y itself from y₍ₖ₊₁₎ = f₍ₖ₎ / (k + 1) (Griewank and Walther, Evaluating Derivatives, 2nd ed., table
13.2; Jorba and Zou, Experimental Mathematics 14, 2005, proposition 2.1).

Long functions are outlined into pieces, which compile sooner; values that cross pieces are stored as rows.
"""

from collections import Counter
from functools import cached_property
from itertools import groupby

from gauss.codegen.expression import Expression
from gauss.codegen.function import Function

HIGHEST_ORDER = 24
WIDEST = 8  # lanes of the widest vector register
LEAD = WIDEST - 1  # doubles before a series, so that its coefficient of order 1 begins a cache line
ROW = LEAD + HIGHEST_ORDER + 1 + WIDEST  # doubles from one series to the next
WINDOW = HIGHEST_ORDER + WIDEST  # doubles of the partial sums of one Cauchy product
LINE = 64  # bytes of a cache line, and of the widest vector register
OPERATIONS_PER_PIECE = 100  # or products
LINEAR = frozenset({"add", "sub", "neg"})
SUMS = LINEAR | {"mul"}
SERIES_OPERATIONS = LINEAR | {"constant", "symbol", "mul", "div", "sqrt", "sin", "cos", "exp", "log"}


def without_series(function: Function) -> list[str]:
    """Operations of a function without Taylor series, such as the selections of a branch."""
    return sorted({node.op for node in function.nodes} - SERIES_OPERATIONS)


class SeriesPlan:
    """Series of a function that are stored, and Cauchy products of two series.

    A series is identified by its node, or by a kind and its node: ("slope", u) has the coefficients k uₖ, ("inverse", u)
    only 1/u₀. A sum or product whose only user is a sum becomes a term of it.

    Attributes
    ----------
    rows : dict
        Row of each stored series; those of y come first.
    history : int
        Number of the leading rows of which coefficients of lower orders are read.
    products : list
        (sum, sign, one, other), names of series: Cauchy products, without the terms of order 0, that are added to the sum.
    pieces : list
        Operations in runs of ``OPERATIONS_PER_PIECE``.
    depth : dict
        Depth of each operation in the graph.
    """

    def __init__(self, rates: Function):
        self.rates = rates
        nodes = [node for node in rates.nodes if node.op not in ("symbol", "constant")]
        self.inside = _inside(nodes, rates.outputs)
        nodes = [node for node in nodes if node not in self.inside]
        self.pieces = [nodes[k : k + OPERATIONS_PER_PIECE] for k in range(0, len(nodes), OPERATIONS_PER_PIECE)]
        products = (product for node in nodes for product in self._products(node))
        self.products = list(dict.fromkeys(products))  # sine and cosine of an angle share theirs
        self.depth: dict[Expression, int] = {}
        for node in nodes:
            self.depth[node] = 1 + max((self.depth.get(x, 0) for x in self._sources(node)), default=0)
        self.rows, self.history = self._layout(nodes)

    def _layout(self, nodes: list[Expression]) -> tuple[dict, int]:
        """Row of each stored series, and the number of those of which coefficients of lower orders are read."""
        rates = self.rates
        ends = [x for x in rates.outputs if isinstance(x, Expression) and not x.is_constant]
        inverse = [("inverse", x) for node in nodes for x in _divisors(node)]
        named = [name for *_, one, other in self.products for name in (one, other)]
        past = dict.fromkeys([*rates.inputs[1:], *named])
        names = dict.fromkeys([*past, rates.inputs[0], *self._crossing(nodes), *ends, *inverse])
        return {name: k for k, name in enumerate(names)}, len(past)

    def _crossing(self, nodes: list[Expression]) -> list[Expression]:
        """Values of one piece that another one uses."""
        piece_of = {node: k for k, piece in enumerate(self.pieces) for node in piece}
        return [x for node in nodes for x in self._sources(node) if piece_of.get(x, piece_of[node]) != piece_of[node]]

    @property
    def parts(self) -> list:
        """Products in runs; those of one sum stay together, because its window is shifted once."""
        found: list[list] = [[]]
        for _, products in groupby(self.products, lambda product: product[0]):
            if len(found[-1]) >= OPERATIONS_PER_PIECE:
                found.append([])
            found[-1] += products
        return found

    @cached_property
    def sums(self) -> dict:
        """Index of each sum."""
        return {name: k for k, name in enumerate(dict.fromkeys(total for total, *_ in self.products))}

    @property
    def size(self) -> int:
        """Doubles of all rows, of the latest coefficients, and of all windows."""
        return self.windows + WINDOW * len(self.sums)

    @property
    def windows(self) -> int:
        """Offset of the windows of the sums, aligned to a cache line."""
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
        found: list[tuple] = []
        waiting = [(1, node)]
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
        """Operands of a node, terms of nested sums included."""
        if node.op in SUMS:
            return [x for _, factors in self.terms(node) for x in factors]
        return list(node.operands)

    def _products(self, node: Expression) -> list[tuple]:
        """Cauchy products of a node."""
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
    """Sums and products with one user, a sum."""
    uses = Counter(x for node in nodes for x in node.operands)
    ends = {x for x in outputs if isinstance(x, Expression)}
    terms = (x for node in nodes if node.op in LINEAR for x in node.operands)
    return {x for x in terms if x.op in SUMS and uses[x] == 1 and x not in ends}


def _divisors(node: Expression) -> tuple:
    """Nodes by which all coefficients of a node are divided."""
    return {"div": node.operands[1:], "sqrt": (node,), "log": node.operands}.get(node.op, ())
