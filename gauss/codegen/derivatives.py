"""Algorithmic differentiation on the graph: the chain rule as further expressions.

Griewank and Walther, Evaluating Derivatives, 2nd ed., ch. 3: forward (tangent) and reverse (adjoint) mode.
"""

from collections.abc import Callable

import numpy as np

from gauss.codegen.expression import Expression, reachable
from gauss.codegen.graph import Graph

# partial derivatives of a node y by its operands; one and zero are constants of its graph
_PARTIALS: dict[str, Callable[..., tuple]] = {
    "add": lambda y, one, zero, a, b: (one, one),
    "sub": lambda y, one, zero, a, b: (one, -one),
    "neg": lambda y, one, zero, x: (-one,),
    "mul": lambda y, one, zero, a, b: (b, a),
    "div": lambda y, one, zero, a, b: (1.0 / b, -y / b),
    "sqrt": lambda y, one, zero, x: (0.5 / y,),
    "sin": lambda y, one, zero, x: (x.cos(),),
    "cos": lambda y, one, zero, x: (-x.sin(),),
    "exp": lambda y, one, zero, x: (y,),
    "log": lambda y, one, zero, x: (1.0 / x,),
    "atan2": lambda y, one, zero, a, b: (b / (square := b * b + a * a), -a / square),
    "min": lambda y, one, zero, a, b: _selected(a < b, one, zero),
    "max": lambda y, one, zero, a, b: _selected(b < a, one, zero),
    "select": lambda y, one, zero, condition, a, b: (zero, *_selected(condition, one, zero)),
    "less": lambda y, one, zero, a, b: (zero, zero),
    "less_equal": lambda y, one, zero, a, b: (zero, zero),
    "floor": lambda y, one, zero, x: (zero,),
    "row": lambda y, one, zero, x: (zero,),
    "entry": lambda y, one, zero, x: (zero,),
}

# Leading operands of operations that are locally constant in these.
_DECIDES = {"select": 1, "less": 2, "less_equal": 2, "floor": 1, "row": 1, "entry": 1}


def varying(outputs) -> list[Expression]:
    """Nodes on which the outputs depend differentiably, operands first; conditions are left out."""
    return reachable(outputs, lambda node: node.operands[_DECIDES.get(node.op, 0) :])


def partials(node: Expression) -> tuple:
    """Partial derivative of a node with respect to each of its operands.

    TypeError if the operation has none, as a call of a function.
    """
    if node.op not in _PARTIALS:
        raise TypeError(f"no derivative of {node.op!r}.")
    return _PARTIALS[node.op](node, node.graph.constant(1.0), node.graph.constant(0.0), *node.operands)


def _selected(condition: Expression, one: Expression, zero: Expression) -> tuple[Expression, Expression]:
    """Derivatives of a selection by its two values."""
    return condition.graph.select(condition, one, zero), condition.graph.select(condition, zero, one)


def forward(outputs, inputs, directions) -> np.ndarray:
    """Directional derivative ẏ = (∂y/∂x) ẋ of the outputs, forward mode.

    Parameters
    ----------
    outputs : array_like of Expression
        Functions y of the inputs.
    inputs : sequence of Expression
        Symbols x, or subexpressions of the outputs.
    directions : sequence of Expression or float
        Rate ẋ of each input.

    Returns
    -------
    ndarray of Expression
        In the shape of ``outputs``.
    """
    outputs = np.asarray(outputs, dtype=object)
    if any(node.is_constant for node in inputs):
        raise TypeError("cannot differentiate with respect to a constant; give symbols, or expressions of them.")
    graph = _graph(outputs, inputs)
    if graph is None:  # numbers of no inputs
        return _map(outputs, lambda number: 0.0)
    zero = graph.constant(0.0)
    rate = {node.index: graph.lift(direction) for node, direction in zip(inputs, directions, strict=True)}
    for node in varying(outputs.ravel()):
        moving = [(i, rate[x.index]) for i, x in enumerate(node.operands) if rate.get(x.index, zero) is not zero]
        if node.index not in rate and moving:
            slopes = partials(node)
            rate[node.index] = sum((slopes[i] * moved for i, moved in moving[1:]), slopes[moving[0][0]] * moving[0][1])
    return _map(outputs, lambda node: rate.get(node.index, zero) if isinstance(node, Expression) else zero)


def reverse(output: Expression, inputs) -> np.ndarray:
    """Gradient (n_in,) of one output with respect to the inputs, reverse mode."""
    graph = output.graph
    zero = graph.constant(0.0)
    adjoint = {output.index: graph.constant(1.0)}
    for node in reversed(reachable([output])):
        weight = adjoint.get(node.index, zero)
        if weight is zero or not node.operands:
            continue
        for operand, slope in zip(node.operands, partials(node), strict=True):
            adjoint[operand.index] = adjoint.get(operand.index, zero) + weight * slope
    return np.array([adjoint.get(node.index, zero) for node in inputs] + [None], dtype=object)[:-1]


def jacobian(outputs, inputs) -> np.ndarray:
    """Jacobian matrix ∂y/∂x (len(outputs), len(inputs)), column by column in forward mode."""
    columns = [forward(outputs, inputs, [float(i == k) for i in range(len(inputs))]) for k in range(len(inputs))]
    return np.array(columns, dtype=object).T


def _graph(outputs, inputs) -> Graph | None:
    return next((node.graph for node in (*inputs, *outputs.ravel()) if isinstance(node, Expression)), None)


def _map(array: np.ndarray, function) -> np.ndarray:
    result = np.empty(array.shape, dtype=object)
    for index, node in np.ndenumerate(array):
        result[index] = function(node)
    return result
