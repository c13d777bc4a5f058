"""Part of a graph cut out as a function of its own: what is repeated depends on a few symbols, the rest is given to it."""

import numpy as np

from gauss.codegen.expression import Expression, Graph, reachable
from gauss.codegen.function import Function


def enclosed(outputs, symbols, name: str) -> tuple[Function, list[Expression]]:
    """Function of the symbols, and of whatever else its outputs need and that does not depend on the symbols.

    Parameters
    ----------
    outputs : sequence of Expression or float
        What it computes.
    symbols : sequence of Expression
        What changes from call to call.
    name : str
        Name of the function.

    Returns
    -------
    Function, list of Expression
        Its inputs are the symbols, then the other expressions, which are returned.
    """
    inner = Graph()
    copies = {symbol.index: inner.symbol(f"x[{k}]") for k, symbol in enumerate(symbols)}
    changing = [node for node in reachable(outputs) if _changes(node, copies)]
    given = []

    def copied(node: Expression) -> Expression:
        if node.index not in copies:
            if node.is_constant:
                return inner.constant(node.value)
            copies[node.index] = inner.symbol(f"given[{len(given)}]")
            given.append(node)
        return copies[node.index]

    for node in changing:
        copies[node.index] = inner.copy(node, [copied(operand) for operand in node.operands])
    results = [copied(output) if isinstance(output, Expression) else output for output in outputs]
    inputs = [copies[symbol.index] for symbol in symbols] + [copies[node.index] for node in given]
    return Function(name, inputs, results), given


def _changes(node: Expression, changing: dict) -> bool:
    """Whether a node depends on what changes; operands are met before what is made of them."""
    if node.index in changing or not any(operand.index in changing for operand in node.operands):
        return False
    changing[node.index] = None
    return True


def fresh(graph: Graph, name: str, count: int) -> np.ndarray:
    """Symbols that no one else has."""
    return graph.symbols(f"{name}{len(graph.nodes)}", count)
