"""A piece of a program: outputs written as expressions of inputs, in a graph of its own, to be called by others."""

from dataclasses import dataclass

import numpy as np

from gauss.tracing.expression import Expression, Graph, count, reachable


@dataclass(frozen=True, eq=False)
class Function:
    """Straight-line function of a vector.

    Parameters
    ----------
    name : str
        What it computes.
    inputs : list of Expression
        Symbols.
    outputs : list of Expression or float
        What is computed from them.
    """

    name: str
    inputs: list
    outputs: list

    @property
    def nodes(self) -> list[Expression]:
        """All nodes that the outputs depend on, operands first."""
        return reachable(self.outputs)

    def operations(self) -> dict[str, int]:
        """Number of operations of each kind, those of functions that are called included."""
        return count(self.outputs)

    def text(self) -> str:
        """All operations, written out: equal texts compute the same."""
        nodes = self.nodes
        ends = [output.index if isinstance(output, Expression) else output for output in self.outputs]
        return f"{[(node.index, node.op, node.value, [x.index for x in node.operands]) for node in nodes]} → {ends}"

    def __call__(self, *arguments) -> np.ndarray:
        """Outputs (n_out,) for arguments that contain at least one expression; they are joined to one vector."""
        given = self._joined(arguments)
        graph = next(part.graph for part in given if isinstance(part, Expression))
        return graph.call(self, given)

    def inlined(self, *arguments) -> np.ndarray:
        """Return the same outputs, written out where they are used, so that they fold with what is known there."""
        given = self._joined(arguments)
        graph = next(part.graph for part in given if isinstance(part, Expression))
        values = {symbol.index: graph.lift(part) for symbol, part in zip(self.inputs, given, strict=True)}
        for node in self.nodes:
            if node.op != "symbol":
                values[node.index] = graph.copy(node, [values[x.index] for x in node.operands])
        outputs = [values[x.index] if isinstance(x, Expression) else graph.constant(x) for x in self.outputs]
        return np.array([*outputs, None], dtype=object)[:-1]

    def _joined(self, arguments) -> np.ndarray:
        given = np.concatenate([np.ravel(np.asarray(argument, dtype=object)) for argument in arguments])
        if given.size != len(self.inputs):
            raise TypeError(f"function {self.name!r} takes {len(self.inputs)} numbers, got {given.size}.")
        return given


def write(function, *sizes: int, name: str = "function") -> Function:
    """Write a Python function of vectors down, by calling it once with symbols.

    Parameters
    ----------
    function : callable
        Takes one object array for each size, returns an array, or a tuple of arrays that are joined.
    *sizes : int
        Length of each argument.
    name : str
        What it computes.
    """
    graph = Graph()
    arguments = [graph.symbols(f"x{k}", size) for k, size in enumerate(sizes)]
    outputs = function(*arguments)
    parts = outputs if isinstance(outputs, tuple) else (outputs,)
    flat = [entry for part in parts for entry in np.ravel(np.asarray(part, dtype=object))]
    return Function(name, [symbol for argument in arguments for symbol in argument], flat)
