"""Stages of evaluation: what depends on the early inputs alone is one function, whose results later functions read.

Operations on early inputs alone are traced in a graph of their own (Knoblock and Ruf, Data Specialization, PLDI 1996). Where
one of them enters an operation of a later function, it becomes a result of the early function and an input of the later one.
So the same source that traces a function in one piece traces it in two stages.
"""

from collections.abc import Callable, Mapping

import numpy as np

from gauss.codegen.expression import Expression, graph_of, reachable
from gauss.codegen.function import Function, traced
from gauss.codegen.graph import COMMUTATIVE, Graph

REPEATED = ("neg", "less", "less_equal")  # signs fold, and conditions are no numbers: each function evaluates its own


class EarlyGraph(Graph):
    """Graph of the early inputs.

    Attributes
    ----------
    evaluated : set, optional
        Indices of the nodes that may become results, if not all may: later functions evaluate the others themselves.
    """

    def __init__(self):
        super().__init__()
        self.evaluated: set[int] | None = None

    def entered(self, value: Expression, graph: Graph) -> Expression:
        """Expression of this graph in a later one: a result where it is evaluated here, else evaluated again from these."""
        assert isinstance(graph, LaterGraph)
        known = graph.from_early  # by index: a law that is traced along its branches may not be a key
        found = known.get(value.index)
        if found is not None:
            return found
        if not self._is_rebuilt(value, known):
            found = known[value.index] = graph.early_result(value)
            return found
        for node in reachable([value], lambda node: node.operands if self._is_rebuilt(node, known) else ()):
            if self._is_rebuilt(node, known):
                known[node.index] = graph.copy(node, [known[operand.index] for operand in node.operands])
            elif node.index not in known:
                known[node.index] = graph.early_result(node)
        return known[value.index]

    def _is_rebuilt(self, node: Expression, known: dict[int, Expression]) -> bool:
        """Whether a later function evaluates a node itself, as constants and what is :data:`REPEATED`."""
        early = self.evaluated is None or node.index in self.evaluated
        return node.index not in known and (node.is_constant or node.op in REPEATED or not early)

    def evaluation(self, op: str, operands: list[Expression]) -> Expression | None:
        """Node of an operation on nodes of this graph, if it may be evaluated here."""
        if op in COMMUTATIVE:
            operands = sorted(operands, key=lambda x: x.index)
        if self.evaluated is None:
            return self._make(op, tuple(operands))
        node = self._known.get((op, None, *[x.index for x in operands]))
        return node if node is not None and node.index in self.evaluated else None


class LaterGraph(Graph):
    """Graph of a later function; an operation on early results alone is one of the early graph."""

    def __init__(self, early: EarlyGraph):
        super().__init__(early)
        self._first = early
        self._origins: dict[int, Expression] = {}  # node of the early graph by the index of the result
        self.from_early: dict[int, Expression] = {}  # node of this graph by the index of that of the early graph

    def early_result(self, node: Expression) -> Expression:
        """Result of the early function as an input."""
        symbol = self.symbol(f"early[{node.index}]")
        self._origins[symbol.index] = node
        return symbol

    def used(self, outputs) -> dict[int, Expression]:
        """Nodes of the early graph on which outputs depend, by their index."""
        nodes = [self._origins[x.index] for x in reachable(outputs) if x.index in self._origins]
        return {node.index: node for node in nodes}

    def _are_early(self, operands: tuple) -> bool:
        """Whether operands are early results and constants alone."""
        for x in operands:  # a generator would take longer than the rest of an operation
            if x.index not in self._origins and not x.is_constant:
                return False
        return True

    def _make(self, op: str, operands: tuple, value=None) -> Expression:
        origins = self._origins
        if value is None and op not in REPEATED and self._are_early(operands):
            nodes = [self._first.constant(x.value) if x.is_constant else origins[x.index] for x in operands]
            node = self._first.evaluation(op, nodes)
            if node is not None:
                return self.lift(node)
        return super()._make(op, operands, value)


def staged(
    early: Callable, later: Mapping[str, tuple[Callable, tuple[int, ...]]], *sizes: int, name: str
) -> tuple[Function, dict[str, Function]]:
    """Function of the early inputs, and the later functions that read all its results, followed by inputs of their own.

    The early function evaluates what the first of the later ones uses, which is called most; the others evaluate the rest.

    Parameters
    ----------
    early : callable
        Takes one object array for each size; returns an object that holds expressions.
    later : mapping
        Function and sizes of its arguments, by name. It takes the object, then its arguments, and returns an array, or a
        tuple of arrays that are joined.
    *sizes : int
        Length of each early argument.
    name : str
        Name of the early function in the code.
    """
    graph = EarlyGraph()
    arguments = [graph.symbols(f"x{k}", size) for k, size in enumerate(sizes)]
    inputs = [symbol for argument in arguments for symbol in argument]
    known, parts, used = early(*arguments), {}, dict[int, Expression]()
    for key, (function, own) in later.items():
        inner = LaterGraph(graph)
        part = traced(inner, lambda *given, function=function: function(known, *given), *own, name=key)
        parts[key] = inner, part
        used |= inner.used(part.outputs)
        if graph.evaluated is None:
            graph.evaluated = {node.index for node in reachable([*inputs, *used.values()])}
    first = Function(name, [*inputs, *graph.free.values()], [*used.values()], tuple(graph.free))
    written = {}
    for key, (inner, part) in parts.items():
        read = [inner.early_result(node) for node in used.values()]
        written[key] = Function(key, [*read, *part.inputs], part.outputs, part.parameters)
    return first, written


def entered(values, given) -> np.ndarray:
    """Values as expressions of the graph of given ones: operations on them are traced there; numbers if these are."""
    values = np.asarray(values)
    if values.dtype != object or not any(isinstance(value, Expression) for value in np.ravel(given)):
        return values
    return np.frompyfunc(graph_of(np.ravel(given)).lift, 1, 1)(values)
