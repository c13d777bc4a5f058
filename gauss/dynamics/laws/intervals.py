"""Interval arithmetic over numbers, arrays or expressions; enclosures of traced expressions.

An operation on intervals [a, b] encloses all results of the operation on their elements (Moore, Kearfott, Cloud,
Introduction to Interval Analysis, ch. 2 and 5). Endpoints are not rounded outwards: callers allow for rounding where needed.
"""

from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import LOOKUPS, Column, Expression, Function, looked_up, reachable, write

UNBOUNDED = 1e150  # in place of infinity: its square is finite, and its product with zero is zero


class Interval(NamedTuple):
    """Interval [low, high]; endpoints are numbers, arrays of one shape, or expressions."""

    low: Any
    high: Any

    @classmethod
    def point(cls, value) -> "Interval":
        """Interval of one value."""
        return cls(value, value)

    def hull(self, other: "Interval") -> "Interval":
        """Least interval that contains both."""
        return Interval(math.minimum(self.low, other.low), math.maximum(self.high, other.high))

    def __neg__(self):
        return Interval(-self.high, -self.low)

    def __add__(self, other):
        return Interval(self.low + other.low, self.high + other.high)

    def __sub__(self, other):
        return Interval(self.low - other.high, self.high - other.low)

    def __mul__(self, other):
        if other is self:
            return self.square()
        products = [x * y for x in self for y in other]
        return Interval(_least(products), _largest(products))

    def square(self) -> "Interval":
        """Range of x² on the interval."""
        low, high = self.low * self.low, self.high * self.high
        least = math.where(self.low > 0.0, low, math.where(self.high < 0.0, high, 0.0))
        return Interval(least, math.maximum(low, high))

    def __truediv__(self, other):
        regular = math.where(other.low > 0.0, 1.0, math.where(other.high < 0.0, 1.0, 0.0))
        safe = Interval(math.where(regular > 0.0, other.low, 1.0), math.where(regular > 0.0, other.high, 1.0))
        found = self * Interval(1.0 / safe.high, 1.0 / safe.low)
        return Interval(math.where(regular > 0.0, found.low, -UNBOUNDED), math.where(regular > 0.0, found.high, UNBOUNDED))


def enclose(outputs, given: dict[int, Interval]) -> list[Interval]:
    """Enclosures of expressions, given the interval of every symbol, or of any expression, by its index."""
    known = dict(given)
    for node in _needed(outputs, known):
        if node.index not in known:
            operands = [known[x.index] for x in node.operands if x.index in known]
            known[node.index] = _operation(node, operands)
    return [known[x.index] if isinstance(x, Expression) else Interval.point(float(x)) for x in outputs]


def written_values(outputs, symbols: list[Expression], name: str) -> Function:
    """Function of the values of some symbols → those of expressions."""

    def values(given):
        found = {symbol.index: Interval.point(value) for symbol, value in zip(symbols, given, strict=True)}
        return [value.low for value in enclose(outputs, found)]

    return write(values, len(symbols), name=name)


def written_enclosures(outputs, symbols: list[Expression], name: str) -> Function:
    """Function of low and high of some symbols, one after the other, → low and high of expressions."""

    def enclosures(ends):
        given = {symbol.index: Interval(*pair) for symbol, pair in zip(symbols, ends.reshape(-1, 2), strict=True)}
        return [end for value in enclose(outputs, given) for end in value]

    return write(enclosures, 2 * len(symbols), name=name)


def _needed(outputs, known) -> list[Expression]:
    return reachable(outputs, lambda node: () if node.index in known else node.operands)


def _operation(node: Expression, x: list):
    if node.op == "call":  # intervals of all its outputs
        x = [*x[0], *x[1:]] if isinstance(x[0], list) else x  # all results of another call
        own = dict(zip((symbol.index for symbol in node.value.inputs), x, strict=True))
        return enclose(node.value.outputs, own)
    if node.op == "item":
        return x[0][node.value]
    if node.op in LOOKUPS:
        return (_row if node.op == "row" else _entry)(node.value, *x)
    return Interval.point(node.value) if node.op == "constant" else OPERATIONS[node.op](*x)


def _row(breaks: Column, x: Interval) -> Interval:
    return Interval(*(looked_up("row", breaks, end) for end in x))


def _entry(column: Column, row: Interval) -> Interval:
    """Range of a column from one row to another; in code, that of all of them where they are more than two."""
    if not any(isinstance(end, Expression) for end in row):
        return Interval(*(end[()] for end in column.extent(*row)))
    ends = [looked_up("entry", column, end) for end in row]
    apart = row.high - row.low < 1.5
    low = math.where(apart, math.minimum(*ends), float(column.numbers.min()))
    return Interval(low, math.where(apart, math.maximum(*ends), float(column.numbers.max())))


def _monotone(function):
    return lambda x: Interval(function(x.low), function(x.high))


def _sqrt(x: Interval) -> Interval:
    return Interval(np.sqrt(math.maximum(x.low, 0.0)), np.sqrt(math.maximum(x.high, 0.0)))


def _log(x: Interval) -> Interval:
    low = np.log(math.maximum(x.low, 1.0 / UNBOUNDED))
    return Interval(math.where(x.low > 0.0, low, -UNBOUNDED), np.log(math.maximum(x.high, 1.0 / UNBOUNDED)))


def _exp(x: Interval) -> Interval:
    return Interval(np.exp(math.minimum(x.low, 300.0)), np.exp(math.minimum(x.high, 300.0)))  # e³⁰⁰ < UNBOUNDED


def _cos(x: Interval) -> Interval:
    """Range of the cosine: the values at the endpoints, and ±1 where the interval contains a multiple of π."""
    return _wave(x, 0.0, np.cos)


def _sin(x: Interval) -> Interval:
    return _wave(x, 0.5 * np.pi, np.sin)


def _wave(x: Interval, crest: float, function) -> Interval:
    ends = function(x.low), function(x.high)
    turns = [(end - crest) / (2.0 * np.pi) for end in x]
    troughs = [turn - 0.5 for turn in turns]
    high = math.where(np.floor(turns[1]) - np.floor(turns[0]) > 0.5, 1.0, math.maximum(*ends))
    low = math.where(np.floor(troughs[1]) - np.floor(troughs[0]) > 0.5, -1.0, math.minimum(*ends))
    return Interval(low, high)


def _atan2(y: Interval, x: Interval) -> Interval:
    """Range of the angle over a box: that of its corners where x > 0, else [−π, π]."""
    corners = [math.arctan2(a, b) for a in y for b in (math.maximum(x.low, 1.0 / UNBOUNDED), x.high)]
    right = x.low > 0.0
    return Interval(math.where(right, _least(corners), -np.pi), math.where(right, _largest(corners), np.pi))


def _less(x: Interval, y: Interval) -> Interval:
    return Interval(math.where(x.high < y.low, 1.0, 0.0), math.where(x.low < y.high, 1.0, 0.0))


def _less_equal(x: Interval, y: Interval) -> Interval:
    return Interval(math.where(x.high <= y.low, 1.0, 0.0), math.where(x.low <= y.high, 1.0, 0.0))


def _select(condition: Interval, x: Interval, y: Interval) -> Interval:
    both = x.hull(y)
    low = math.where(condition.low > 0.5, x.low, math.where(condition.high < 0.5, y.low, both.low))
    high = math.where(condition.low > 0.5, x.high, math.where(condition.high < 0.5, y.high, both.high))
    return Interval(low, high)


def _each(choice):
    return lambda x, y: Interval(choice(x.low, y.low), choice(x.high, y.high))


def _least(values):
    return reduce(math.minimum, values)


def _largest(values):
    return -_least([-value for value in values])


OPERATIONS = {
    "neg": Interval.__neg__,
    "add": Interval.__add__,
    "sub": Interval.__sub__,
    "mul": Interval.__mul__,
    "div": Interval.__truediv__,
    "sqrt": _sqrt,
    "sin": _sin,
    "cos": _cos,
    "exp": _exp,
    "log": _log,
    "floor": _monotone(np.floor),
    "atan2": _atan2,
    "min": _each(math.minimum),
    "max": _each(math.maximum),
    "less": _less,
    "less_equal": _less_equal,
    "select": _select,
}
