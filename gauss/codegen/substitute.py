"""Expressions with some of their symbols given: everything that then is constant folds away."""

import numpy as np

from gauss.codegen.expression import BINARY, UNARY, Expression, reachable


def substitute(outputs, symbols, values) -> np.ndarray:
    """Outputs in which each symbol is replaced by a value.

    Parameters
    ----------
    outputs : array_like of Expression or float
        What is rewritten.
    symbols : sequence of Expression
        Inputs that are given.
    values : sequence of Expression or float
        What stands in their place.

    Returns
    -------
    ndarray of Expression or float
        In the shape of ``outputs``.
    """
    outputs = np.asarray(outputs, dtype=object)
    given = {symbol.index: symbol.graph.lift(value) for symbol, value in zip(symbols, values, strict=True)}
    for node in reachable(outputs.ravel()):
        if node.index not in given:
            given[node.index] = _again(node, [given[operand.index] for operand in node.operands])
    result = np.empty(outputs.shape, dtype=object)
    for index, node in np.ndenumerate(outputs):
        result[index] = given[node.index] if isinstance(node, Expression) else node
    return result


def _again(node: Expression, operands) -> Expression:
    """The same operation on other operands."""
    if all(new is old for new, old in zip(operands, node.operands, strict=True)):
        return node
    if node.op == "select":
        return node.graph.select(*operands)
    if node.op not in BINARY and node.op not in UNARY:
        raise TypeError(f"cannot substitute in a {node.op!r}.")
    return node.graph.binary(node.op, *operands) if node.op in BINARY else node.graph.unary(node.op, *operands)
