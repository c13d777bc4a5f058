"""Scalar expression graph with hash-consing: equal subexpressions are one node, constants are folded.

x·0, x·1, x + 0 and x − x are simplified (:mod:`gauss.codegen.simplification`).
"""

import math
import operator
from collections.abc import Callable
from numbers import Real

import numpy as np

from gauss.codegen.expression import INDEX_OF, NUMBERS, Expression, as_number, reachable
from gauss.codegen.lookup import LOOKUPS, Column
from gauss.codegen.simplification import SIMPLER, SIMPLIFIED

# Evaluation of operations of constants: these are folded.
UNARY: dict[str, Callable[[float], float]] = {
    "neg": lambda x: -x,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "exp": math.exp,
    "log": math.log,
    "floor": lambda x: float(math.floor(x)),
}
BINARY: dict[str, Callable[[float, float], float]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": lambda x, y: x / y if y else x * math.inf,  # IEEE 754, as machine code divides: 0/0 is NaN, not an error
    "atan2": math.atan2,
    "min": lambda x, y: y if y < x or y != y else x,  # NaN if one is
    "max": lambda x, y: y if x < y or y != y else x,
    "less": lambda x, y: float(x < y),
    "less_equal": lambda x, y: float(x <= y),
}
COMMUTATIVE = frozenset({"add", "mul", "min", "max"})
COMPARISONS = ("less", "less_equal")
NEW = object.__new__
TURNS = frozenset({"sin", "cos"})
# Operations on zero and another expression: what folding and the rules of simplification give, sooner; or None. The product
# of zero and a constant is not a number where that is infinite.
WITH_ZERO: dict[str, Callable[[Expression, Expression, Expression], Expression | None]] = {
    "add": lambda zero, x, y: y if x is zero else x,
    "sub": lambda zero, x, y: x if y is zero else None,
    "mul": lambda zero, x, y: None if x.is_constant and y.is_constant else zero,
}


class Graph:
    """Owner of expressions: every distinct node exists once.

    Nodes are numbered in the order of construction, so operands precede the nodes that use them.

    Parameters
    ----------
    early : Graph, optional
        Graph of the inputs that are known first: its expressions may enter this one, see :mod:`gauss.codegen.staging`.
    shared : bool
        Whether its symbols are parameters: its expressions may enter any other graph, where a symbol becomes the value set
        by :meth:`bind`, or a further input.
    """

    def __init__(self, early: "Graph | None" = None, shared: bool = False):
        self.early, self.shared = early, shared
        self.bound: dict[str, Expression] = {}  # parameters with a value in this graph
        self.free: dict[str, Expression] = {}  # parameters that are further inputs of this graph
        self._entered: dict[Expression, Expression] = {}
        self.nodes: list[Expression] = []
        self._known: dict[tuple, Expression] = {}
        self.constants: dict[float | Real, Expression] = {}  # node of each number so far
        self.zero: Expression | None = None  # the constant, once it is made

    def symbol(self, name: str) -> Expression:
        """Return the input of this name."""
        return self._make("symbol", (), name)

    def symbols(self, name: str, count: int) -> np.ndarray:
        """Object array (count,) of the inputs ``name[0]``, ``name[1]`` and so on."""
        return np.array([self.symbol(f"{name}[{i}]") for i in range(count)] + [None], dtype=object)[:-1]

    def constant(self, value: float | Real) -> Expression:
        """Return the node of a number."""
        node = self.constants.get(value)
        if node is None:
            value = float(value) + 0.0  # −0 and 0 are one
            node = self.constants[value] = Expression(self, "constant", (), value, len(self.nodes))
            self.nodes.append(node)
            if value == 0.0:
                self.zero = node
        return node

    def lift(self, value) -> Expression:
        """Return an expression of this graph as it is, a number as a constant.

        Raises
        ------
        TypeError
            If it is neither.
        """
        if isinstance(value, Expression):
            if value.graph is self:
                return value
            if value.graph.precedes(self):
                return value.graph.entered(value, self)
            raise TypeError("expressions of two graphs cannot be combined; trace everything in one Graph.")
        if isinstance(value, NUMBERS):
            return self.constant(value)
        raise TypeError(f"cannot trace {value!r} ({type(value).__name__}); expected a number or an Expression.")

    def precedes(self, graph: "Graph") -> bool:
        """Whether expressions of this graph may enter another one."""
        return self.shared or self is graph.early

    def bind(self, names, values):
        """Set the values of parameters in this graph."""
        self.bound |= dict(zip(names, values, strict=True))

    def parameter(self, name: str) -> Expression:
        """Return the value of a parameter in this graph: the bound one, else an input."""
        if name in self.bound:
            return self.bound[name]
        return self.free.setdefault(name, self.symbol(name))

    def entered(self, value: Expression, graph: "Graph") -> Expression:
        """Copy in another graph of an expression of this shared one, with the values of its parameters there."""
        for node in reachable([value]):
            if node not in graph._entered:
                is_symbol = node.op == "symbol"
                operands = [graph._entered[operand] for operand in node.operands]
                graph._entered[node] = graph.parameter(node.value) if is_symbol else graph.copy(node, operands)
        return graph._entered[value]

    def unary(self, op: str, x: Expression) -> Expression:
        """Return op(x), folded."""
        if x.is_constant:
            return self.constant(UNARY[op](x.value))
        if op == "neg":
            if x.op == "neg":
                return x.operands[0]
            if x.op == "sub":
                return self._make("sub", x.operands[::-1])
        return self._make(op, (x,))

    def binary(self, op: str, x: Expression, y: Expression) -> Expression:
        """Return op(x, y), folded."""
        zero = self.zero  # an operand of two in three operations of a mechanism
        if x is zero or y is zero:
            folded = WITH_ZERO.get(op, _nothing)(zero, x, y)
            if folded is not None:
                return folded
        if x.op in SIMPLIFIED or y.op in SIMPLIFIED or x is y:  # no rule looks at other operands
            folded = self._folded(op, x, y)
            if folded is not None:
                return folded
        if x.index > y.index and op in COMMUTATIVE:
            x, y = y, x
        return self._make(op, (x, y))

    def _folded(self, op: str, x: Expression, y: Expression) -> Expression | None:
        """Result of an operation on constants, or the simpler expression of a rule; else None."""
        if x.is_constant and y.is_constant:
            value = BINARY[op](x.value, y.value)
            return x if value == x.value else y if value == y.value else self.constant(value)
        simplified = SIMPLER.get(op)
        return None if simplified is None else simplified(self, x, y)

    def select(self, condition: Expression, x, y) -> Expression:
        """Return x where the condition holds, else y."""
        condition, x, y = self.lift(condition), self.lift(x), self.lift(y)
        if condition.is_constant:
            return x if condition.value else y
        return x if x is y else self._make("select", (condition, x, y))

    def lookup(self, op: str, column: Column, x: Expression) -> Expression:
        """Return an operation of a column of a table, folded; see :mod:`gauss.codegen.lookup`."""
        return self.constant(float(LOOKUPS[op](column, x.value))) if x.is_constant else self._make(op, (x,), column)

    def call(self, function, arguments) -> np.ndarray:
        """Outputs of a :class:`gauss.codegen.Function` for these arguments, an object array; constant ones are numbers."""
        call = self._make("call", _passed([self.lift(argument) for argument in arguments]), function)
        numbers = map(as_number, function.outputs)
        outputs = [self._make("item", (call,), k) if x is None else self.constant(x) for k, x in enumerate(numbers)]
        return np.array([*outputs, None], dtype=object)[:-1]

    def copy(self, node: Expression, operands) -> Expression:
        """Node of another graph, with operands of this one, folded."""
        if node.op in BINARY:
            return self.binary(node.op, *operands)
        if node.op == "constant":
            return self.constant(node.value)
        if node.op in UNARY:
            return self.unary(node.op, *operands)
        if node.op == "select":
            return self.select(*operands)
        if node.op in LOOKUPS:
            return self.lookup(node.op, node.value, *operands)
        return self._make(node.op, tuple(operands), node.value)

    def forget(self):
        """Drop the nodes, which refer to the graph: those without other references are freed at once, not as garbage.

        A node that is made again later is another object.
        """
        self.nodes, self._known, self.constants = [None] * len(self.nodes), {}, {}  # type: ignore[list-item]
        self.zero = None

    def _make(self, op: str, operands: tuple, value=None) -> Expression:
        if len(operands) == 2:  # the key without its overhead
            x, y = operands
            key: tuple = (op, value, x.index, y.index)
        else:
            key = (op, value, *map(INDEX_OF, operands))
        node = self._known.get(key)
        if node is None:
            nodes = self.nodes
            node = self._known[key] = NEW(Expression)  # its attributes without the overhead of its constructor
            node.graph = self
            node.op = op
            node.operands = operands
            node.value = value
            node.index = len(nodes)
            node.is_constant = False
            nodes.append(node)
        return node


def _nothing(zero: Expression, x: Expression, y: Expression) -> None:
    """No simpler expression, for operations on zero that are not of :data:`WITH_ZERO`."""


def _passed(operands: list[Expression]) -> tuple[Expression, ...]:
    """Operands of a call; if the first ones are all results of another call, in order, this call stands for them.

    Code passes such results where they are, in memory.
    """
    if operands and operands[0].op == "item":
        call = operands[0].operands[0]
        count = len(call.value.outputs)
        if [(x.op, x.value, x.operands) for x in operands[:count]] == [("item", k, (call,)) for k in range(count)]:
            return call, *operands[count:]
    return tuple(operands)
