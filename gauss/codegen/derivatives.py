"""Algorithmic differentiation on the graph: the chain rule as further expressions.

Griewank and Walther, Evaluating Derivatives, 2nd ed., ch. 3: forward (tangent) and reverse (adjoint) mode.
"""

import numpy as np

from gauss.codegen.expression import Expression, Graph, reachable, varying


def partials(node: Expression) -> tuple:
    """Partial derivative of a node with respect to each of its operands.

    Raises
    ------
    TypeError
        If the operation has none, as a call of a function.
    """
    graph, ops = node.graph, node.operands
    one, zero = graph.constant(1.0), graph.constant(0.0)
    if node.op == "add":
        return one, one
    if node.op == "sub":
        return one, -one
    if node.op == "neg":
        return (-one,)
    if node.op == "mul":
        return ops[1], ops[0]
    if node.op == "div":
        return 1.0 / ops[1], -node / ops[1]
    if node.op == "sqrt":
        return (0.5 / node,)
    if node.op == "sin":
        return (ops[0].cos(),)
    if node.op == "cos":
        return (-ops[0].sin(),)
    if node.op == "exp":
        return (node,)
    if node.op == "log":
        return (1.0 / ops[0],)
    if node.op == "atan2":
        y, x = ops
        square = x * x + y * y
        return x / square, -y / square
    if node.op in ("min", "max"):
        first = ops[0] < ops[1] if node.op == "min" else ops[1] < ops[0]
        return graph.select(first, one, zero), graph.select(first, zero, one)
    if node.op == "select":
        return zero, graph.select(ops[0], one, zero), graph.select(ops[0], zero, one)
    if node.op in ("less", "less_equal"):
        return zero, zero
    if node.op == "floor":
        return (zero,)
    raise TypeError(f"no derivative of {node.op!r}.")


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


def _graph(outputs, inputs) -> Graph:
    return next(node.graph for node in (*inputs, *outputs.ravel()) if isinstance(node, Expression))


def _map(array: np.ndarray, function) -> np.ndarray:
    result = np.empty(array.shape, dtype=object)
    for index, node in np.ndenumerate(array):
        result[index] = function(node)
    return result
