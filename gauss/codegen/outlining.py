"""Outlining of a subgraph as a function of the varying symbols and of the invariant subexpressions it uses."""

import numpy as np

from gauss.codegen.expression import Expression, reachable
from gauss.codegen.function import Function
from gauss.codegen.graph import Graph


def outlined(outputs, symbols, name: str) -> tuple[Function, list[Expression]]:
    """Function of the symbols, and of the subexpressions of its outputs that do not depend on the symbols.

    Parameters
    ----------
    outputs : sequence of Expression or float
        Its results.
    symbols : sequence of Expression
        Inputs that change from call to call.
    name : str
        Name of the function.

    Returns
    -------
    Function, list of Expression
        The function; its inputs are the symbols, then the invariant expressions, which are returned.
    """
    inner = Graph()
    copies = {symbol.index: inner.symbol(f"x[{k}]") for k, symbol in enumerate(symbols)}
    dependent = [node for node in reachable(outputs) if _changes(node, copies)]
    given: list[Expression] = []

    def copied(node: Expression) -> Expression:
        if node.index not in copies:
            if node.is_constant:
                return inner.constant(node.value)
            copies[node.index] = inner.symbol(f"given[{len(given)}]")
            given.append(node)
        return copies[node.index]

    for node in dependent:
        copies[node.index] = inner.copy(node, [copied(operand) for operand in node.operands])
    results = [copied(output) if isinstance(output, Expression) else output for output in outputs]
    inputs = [copies[symbol.index] for symbol in symbols] + [copies[node.index] for node in given]
    return Function(name, inputs, results), given


def _changes(node: Expression, dependent: dict) -> bool:
    """Whether a node depends on a changing one; operands precede their users."""
    if node.index in dependent or not any(operand.index in dependent for operand in node.operands):
        return False
    dependent[node.index] = None
    return True


def fresh_symbols(graph: Graph, name: str, count: int) -> np.ndarray:
    """Symbols that are new in a graph."""
    return graph.symbols(f"{name}{len(graph.nodes)}", count)
