"""Substitution of values for symbols in expressions; what becomes constant folds."""

from collections.abc import Callable
from functools import partial
from operator import itemgetter

import numpy as np

from gauss.codegen.expression import Expression, reachable
from gauss.codegen.graph import BINARY, UNARY
from gauss.codegen.lookup import LOOKUPS


def substitute(outputs, symbols, values) -> np.ndarray:
    """Outputs with each symbol replaced by a value.

    Parameters
    ----------
    outputs : array_like of Expression or float
        Expressions of the symbols.
    symbols : sequence of Expression
        Symbols to be replaced.
    values : sequence of Expression or float
        Their values.

    Returns
    -------
    ndarray of Expression or float
        In the shape of ``outputs``.

    Raises
    ------
    TypeError
        If an output contains an operation other than arithmetic, such as a call.
    """
    outputs = np.asarray(outputs, dtype=object)
    given = {symbol.index: symbol.graph.lift(value) for symbol, value in zip(symbols, values, strict=True)}
    for node in reachable(outputs.ravel()):
        if node.index not in given:
            given[node.index] = _rebuilt(node, [given[operand.index] for operand in node.operands])
    result = np.empty(outputs.shape, dtype=object)
    for index, node in np.ndenumerate(outputs):
        result[index] = given[node.index] if isinstance(node, Expression) else node
    return result


def numbers_of(outputs, symbols) -> Callable[[list[float]], np.ndarray]:
    """Function from numbers in place of all symbols to the numbers (m,) that the outputs fold to, without new nodes.

    Raises
    ------
    TypeError
        If an output contains an operation other than arithmetic, such as a call; as :func:`substitute`.
    """
    given = [symbol.index for symbol in symbols]
    fixed, steps = {}, []
    for node in reachable(outputs):
        operands = [operand.index for operand in node.operands]
        if node.op == "constant":
            fixed[node.index] = node.value
        elif operands:
            steps.append((node.index, _function_of(node), itemgetter(*operands), len(operands) == 1))

    def numbers(values: list[float]) -> np.ndarray:
        known = {**fixed, **dict(zip(given, values, strict=True))}
        for index, function, operands, single in steps:
            known[index] = function(operands(known)) if single else function(*operands(known))
        return np.array([known[x.index] if isinstance(x, Expression) else x for x in outputs], dtype=float)

    return numbers


def _function_of(node: Expression) -> Callable[..., float]:
    """Evaluation of the operation of a node over numbers."""
    op = node.op
    if op == "select":
        return lambda condition, x, y: x if condition else y
    if op in LOOKUPS:
        return partial(LOOKUPS[op], node.value)
    return _numeric(op)


def _numeric(op: str) -> Callable[..., float]:
    found = BINARY.get(op) or UNARY.get(op)
    if found is None:
        raise TypeError(f"cannot substitute in a {op!r}.")
    return found


def _rebuilt(node: Expression, operands) -> Expression:
    """Node of the same operation on other operands."""
    if all(new is old for new, old in zip(operands, node.operands, strict=True)):
        return node
    if node.op != "select" and node.op not in LOOKUPS:
        _numeric(node.op)
    return node.graph.copy(node, operands)
