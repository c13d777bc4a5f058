"""Scalar expressions: a node of a graph replaces a number in arithmetic, in numpy object arrays, under ``np.sin``.

So one source computes with floats, or traces its own operations (operator overloading; Griewank and Walther, Evaluating
Derivatives, 2nd ed., ch. 6). Nodes belong to a :class:`gauss.codegen.Graph`.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import chain
from numbers import Real
from operator import attrgetter
from threading import get_ident
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from gauss.codegen.graph import Graph

NUMBERS = (float, Real)  # float first: isinstance then rarely asks the abstract class
INDEX_OF, OPERANDS_OF = attrgetter("index"), attrgetter("operands")  # of a node, without the overhead of a function


def _operation(op: str, swapped: bool = False) -> Callable:
    """Method for an operation of two operands: one call less than by a common method, for it is most of tracing."""
    keeps_zero, is_product = op in ("add", "sub", "mul"), op == "mul"

    def operate(self, other):
        graph = self.graph
        if type(other) is float:
            known = graph.constants.get(other)
            other = graph.constant(other) if known is None else known
        elif type(other) is not Expression or other.graph is not graph:
            return _lifted(operate, self, other)
        zero = graph.zero
        if keeps_zero and self is other is zero:  # half of all operations of a mechanism
            return zero
        if is_product and self.is_constant is not other.is_constant and (self is zero or other is zero):
            return zero  # most of the others with zero; two constants may be 0·∞
        return graph.binary(op, other, self) if swapped else graph.binary(op, self, other)

    return operate


def _function(op: str) -> Callable:
    """Method for a function of one operand."""
    return lambda x: x.graph.unary(op, x)


def _lifted(operate: Callable, x: "Expression", other):
    """Result of an operation whose operands are brought to one graph first."""
    if not isinstance(other, OPERANDS):
        return NotImplemented
    graph = x.graph
    if isinstance(other, Expression) and graph.precedes(other.graph):
        graph, x = other.graph, other.graph.lift(x)
    return operate(x, graph.lift(other))


class Expression:
    """One node of a graph, constructed by arithmetic or by the methods of :class:`gauss.codegen.Graph`."""

    __slots__ = ("graph", "index", "is_constant", "op", "operands", "value")

    def __init__(self, graph: "Graph", op: str, operands: tuple, value, index: int):
        self.graph = graph  # one by one: no tuple in between, for this is much of tracing
        self.op = op
        self.operands = operands
        self.value = value
        self.index = index
        self.is_constant = op == "constant"

    def __repr__(self):
        if self.op in ("constant", "symbol"):
            return f"{self.value}"
        return f"{self.op}({', '.join(f'%{operand.index}' for operand in self.operands)})"

    def __bool__(self):
        tracer = _tracers.get(get_ident())
        if tracer is None:
            raise TypeError(
                "the value of a traced expression is not known while it is traced, so it cannot decide an `if`; "
                "use gauss.math.where, gauss.math.minimum or gauss.math.maximum."
            )
        return tracer.decide(self)

    def __and__(self, other):
        """Conjunction of two conditions: decided like an `if`, one after the other."""
        return (other if self else np.False_) if _is_truth(self) and _is_truth(other) else NotImplemented

    def __or__(self, other):
        return (np.True_ if self else other) if _is_truth(self) and _is_truth(other) else NotImplemented

    __rand__, __ror__ = __and__, __or__

    __add__, __radd__ = _operation("add"), _operation("add", swapped=True)
    __sub__, __rsub__ = _operation("sub"), _operation("sub", swapped=True)
    __mul__, __rmul__ = _operation("mul"), _operation("mul", swapped=True)
    __truediv__, __rtruediv__ = _operation("div"), _operation("div", swapped=True)
    __lt__, __gt__ = _operation("less"), _operation("less", swapped=True)
    __le__, __ge__ = _operation("less_equal"), _operation("less_equal", swapped=True)

    def __rpow__(self, base):
        return self.graph.lift(base).log().__mul__(self).exp()

    def __eq__(self, other):
        """Identity of nodes; while branches are traced, equality of values."""
        if self is other or not _tracers or get_ident() not in _tracers:
            return self is other
        return (self <= other) & (self >= other) if isinstance(other, OPERANDS) else NotImplemented

    def __hash__(self):
        if _tracers and not self.graph.shared and get_ident() in _tracers:
            # a dict of a law would never find it, whatever its value
            raise TypeError("a traced expression is no key of a dict and no member of a set")
        return id(self)

    __neg__, __floor__ = _function("neg"), _function("floor")

    def __pos__(self):
        return self

    def __abs__(self):
        return self.graph.binary("max", self, -self)

    def __pow__(self, exponent):
        """Power: repeated multiplication for whole exponents, a square root for ½, else exp(exponent · log x)."""
        if exponent == 0.5:
            return self.sqrt()
        if not isinstance(exponent, NUMBERS) or exponent != (whole := int(float(exponent))):
            return (exponent * self.log()).exp()
        power, square, n = self.graph.constant(1.0), self, abs(whole)
        while n:
            power = power * square if n % 2 else power
            square, n = square * square, n // 2
        return power if whole >= 0 else 1.0 / power

    def __mod__(self, divisor):
        return self - divisor * (self / divisor).__floor__()

    def __floordiv__(self, divisor):
        return (self / divisor).__floor__()

    # numpy calls these methods on the entries of object arrays: np.sin(array) → array of x.sin()

    sqrt, sin, cos, exp, log = map(_function, ("sqrt", "sin", "cos", "exp", "log"))

    def tan(self):
        """Tangent."""
        return self.sin() / self.cos()

    def arctan2(self, other):
        """Angle of the point (other, self)."""
        return _arctan2(self, other)


_arctan2 = _operation("atan2")
_tracers: dict[int, Any] = {}  # what decides an `if` over expressions in each thread; see gauss.codegen.branches
OPERANDS = (*NUMBERS, Expression)
Scalar = float | Expression  # numbers over which the mechanics is written
if TYPE_CHECKING:
    Entry = Any  # a Scalar in a record: which of both is as open to the type checker as the elements of an array are
else:
    Entry = Scalar


@contextmanager
def decided_by(tracer) -> Iterator[None]:
    """Let ``tracer.decide(condition)`` decide every `if` over expressions of this thread."""
    thread = get_ident()
    outer = _tracers.get(thread)
    _tracers[thread] = tracer
    try:
        yield
    finally:
        if outer is None:
            del _tracers[thread]
        else:
            _tracers[thread] = outer


def graph_of(values) -> "Graph":
    """Graph in which operations on values are traced: the latest one of those of their expressions."""
    found = None
    for value in values:
        if isinstance(value, Expression) and (found is None or found.precedes(value.graph)):
            found = value.graph
    if found is None:
        raise TypeError("expected at least one traced expression.")
    return found


def _is_truth(value) -> bool:
    """Whether a value is a condition, traced or not."""
    traced = isinstance(value, Expression) and (value.op in ("less", "less_equal") or value.is_constant)
    return traced or isinstance(value, bool | np.bool_)


def as_number(value) -> float | None:
    """Return a number or constant expression as a float, None for an expression that is not constant."""
    if isinstance(value, Expression):
        return value.value if value.is_constant else None
    return float(value)


def reachable(outputs, operands=OPERANDS_OF) -> list[Expression]:
    """Nodes on which the outputs depend, operands first."""
    found: dict[int, Expression] = {}
    waiting = [node for node in outputs if isinstance(node, Expression)]
    while waiting:
        node = waiting.pop()
        index = node.index
        if index not in found:
            found[index] = node
            waiting += operands(node)
    return [found[index] for index in sorted(found)]


def operand_indices(nodes: Iterable[Expression]) -> Iterator[int]:
    """Index of every operand of all nodes, as often as it is one."""
    return map(INDEX_OF, chain.from_iterable(map(OPERANDS_OF, nodes)))
