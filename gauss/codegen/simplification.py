"""Algebraic simplification of binary operations: x + 0, x − x, x·0, x·1, x/1, signs drawn out of products and sums."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gauss.codegen.expression import Expression
    from gauss.codegen.graph import Graph


def _add(graph: "Graph", x: "Expression", y: "Expression") -> "Expression | None":
    if x.is_constant and x.value == 0:
        return y
    if y.is_constant and y.value == 0:
        return x
    if y.op == "neg":
        return graph.binary("sub", x, y.operands[0])
    if x.op == "neg":
        return graph.binary("sub", y, x.operands[0])
    return None


def _sub(graph: "Graph", x: "Expression", y: "Expression") -> "Expression | None":
    if y.is_constant and y.value == 0:
        return x
    if x.is_constant and x.value == 0:
        return graph.unary("neg", y)
    if x is y:
        return graph.constant(0.0)
    if y.op == "neg":
        return graph.binary("add", x, y.operands[0])
    return None


def _mul(graph: "Graph", x: "Expression", y: "Expression") -> "Expression | None":
    if x.is_constant or y.is_constant:
        one, other = (x, y) if x.is_constant else (y, x)
        if one.value == 0:
            return one
        if one.value == 1:
            return other
        if one.value == -1:
            return graph.unary("neg", other)
    if x.op == "neg" or y.op == "neg":
        sign = (x.op == "neg") != (y.op == "neg")
        product = graph.binary("mul", *(e.operands[0] if e.op == "neg" else e for e in (x, y)))
        return graph.unary("neg", product) if sign else product
    return None


def _div(graph: "Graph", x: "Expression", y: "Expression") -> "Expression | None":
    if x.is_constant and x.value == 0:
        return x
    if y.is_constant and abs(y.value) == 1:
        return x if y.value == 1 else graph.unary("neg", x)
    return None


def _extreme(graph: "Graph", x: "Expression", y: "Expression") -> "Expression | None":
    """Smaller or larger of two numbers: NaN if one is."""
    is_missing = [one.is_constant and one.value != one.value for one in (x, y)]
    return y if is_missing[1] else x if is_missing[0] or x is y else None


SIMPLIFIED = frozenset({"constant", "neg"})  # operands at which the rules look, beside two that are the same
# rule of each operation: the simpler expression, or None
SIMPLER: dict[str, Callable] = {"add": _add, "sub": _sub, "mul": _mul, "div": _div, "min": _extreme, "max": _extreme}
