"""Traced functions: outputs as expressions of inputs in a graph of their own, callable from other graphs.

A part of a graph is outlined as a function of the varying symbols and of the invariant subexpressions that it uses.

:class:`gauss.codegen.NativeFunction` is their counterpart in LLVM IR written by hand.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss.codegen.expression import Expression, graph_of, reachable
from gauss.codegen.graph import Graph
from gauss.errors import judged_later


@dataclass(frozen=True, eq=False)
class Function:
    """Straight-line function of a vector.

    Parameters
    ----------
    name : str
        Name in the code.
    inputs : list of Expression
        Symbols.
    outputs : list of Expression or float
        Expressions of the inputs.
    parameters : tuple of str
        Names of the last inputs if these are parameters; a call does not list them.
    """

    name: str
    inputs: list
    outputs: list
    parameters: tuple[str, ...] = ()

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return len(self.inputs), len(self.outputs)

    @cached_property
    def nodes(self) -> list[Expression]:
        """All nodes on which the outputs depend, operands first."""
        return reachable(self.outputs)

    def operations(self) -> dict[str, int]:
        """Number of operations of each kind, those of called functions included."""
        return tally(self.nodes)

    def text(self) -> str:
        """Listing of all operations: functions of equal text compute the same."""
        nodes = self.nodes
        ends = [output.index if isinstance(output, Expression) else output for output in self.outputs]
        return f"{[(node.index, node.op, node.value, [x.index for x in node.operands]) for node in nodes]} → {ends}"

    def __call__(self, *arguments) -> np.ndarray:
        """Outputs (n_out,) for arguments that contain at least one expression; they are joined to one vector."""
        graph, given = self._joined(arguments)
        return graph.call(self, given)

    def inlined(self, *arguments) -> np.ndarray:
        """Return the same outputs inlined into the graph of the caller, where constants fold."""
        graph, given = self._joined(arguments)
        values = {symbol.index: graph.lift(part) for symbol, part in zip(self.inputs, given, strict=True)}
        for node in self.nodes:
            if node.op != "symbol":
                values[node.index] = graph.copy(node, [values[x.index] for x in node.operands])
        outputs = [values[x.index] if isinstance(x, Expression) else graph.constant(x) for x in self.outputs]
        return np.array([*outputs, None], dtype=object)[:-1]

    def _joined(self, arguments) -> tuple[Graph, list]:
        """Graph of the caller, and the inputs followed by the parameters."""
        given = np.concatenate([np.ravel(np.asarray(argument, dtype=object)) for argument in arguments])
        count = len(self.inputs) - len(self.parameters)
        if given.size != count:
            raise TypeError(f"function {self.name!r} takes {count} numbers, got {given.size}.")
        graph = graph_of(given)
        return graph, [*given, *(graph.parameter(name) for name in self.parameters)]


def write(function, *sizes: int, name: str = "function") -> Function:
    """Trace a Python function of vectors by one call with symbols.

    Parameters in its outputs become its last inputs, unless it binds them.

    Parameters
    ----------
    function : callable
        Takes one object array for each size, returns an array, or a tuple of arrays that are joined.
    *sizes : int
        Length of each argument.
    name : str
        Name in the code.
    """
    return traced(Graph(), function, *sizes, name=name)


def traced(graph: Graph, function, *sizes: int, name: str) -> Function:
    """Trace a Python function in a new graph; see :func:`write`."""
    arguments = [graph.symbols(f"x{k}", size) for k, size in enumerate(sizes)]
    with judged_later():  # constants fold by IEEE 754, as in machine code: a NaN is no error here
        outputs = function(*arguments)
    parts = outputs if isinstance(outputs, tuple) else (outputs,)
    flat = [entry for part in parts for entry in np.ravel(np.asarray(part, dtype=object))]
    flat = [graph.lift(entry) if isinstance(entry, Expression) else entry for entry in flat]
    inputs = [symbol for argument in arguments for symbol in argument]
    return Function(name, [*inputs, *graph.free.values()], flat, tuple(graph.free))


def count(outputs) -> dict[str, int]:
    """Number of operations of each kind in the outputs, those in called functions included."""
    return tally(reachable(np.ravel(outputs)))


def tally(nodes) -> dict[str, int]:
    """Number of operations of each kind among nodes, those in called functions included."""
    counts: dict[str, int] = {}
    for node in nodes:
        if node.op == "call":
            for op, number in node.value.operations().items():
                counts[op] = counts.get(op, 0) + number
        elif node.op not in ("constant", "symbol", "item"):
            counts[node.op] = counts.get(node.op, 0) + 1
    return counts


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
