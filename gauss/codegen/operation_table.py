"""A function as a table of its operations, in runs of one kind, for the interpreter loop of :mod:`gauss.codegen.tape`."""

from collections import defaultdict
from dataclasses import dataclass

from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.multiply_add import FUSED, fused

ARITY = {"neg": 1, "sqrt": 1, "sin": 1, "cos": 1, "exp": 1, "log": 1, "floor": 1, "select": 3}
ARITY |= dict.fromkeys(("add", "sub", "mul", "div", "atan2", "min", "max", "less", "less_equal"), 2)
ARITY |= dict.fromkeys(FUSED, 3)
KINDS = list(ARITY)
CALL = len(KINDS)  # call of another function, a run of length one


@dataclass(frozen=True)
class OperationTable:
    """Operations of a function on registers: constants first, then inputs, then results in the order of the operations.

    Parameters
    ----------
    runs : list of int
        Kind and number of operations, alternating.
    operands : list of int
        Registers of the operands of all operations; those of a call follow the index of the callee and its numbers of inputs
        and outputs.
    constants : list of float
        Values of the first registers.
    outputs : list of int
        Registers of the outputs.
    callees : list of Function
        Called functions.
    size : int
        Number of registers.
    """

    runs: list[int]
    operands: list[int]
    constants: list[float]
    outputs: list[int]
    callees: list[Function]
    size: int


def tabulate(function: Function) -> OperationTable:
    """Operation table of a function."""
    steps, constants = _steps(function)
    place: dict = {("constant", value): k for k, value in enumerate(constants)}
    place |= {symbol.index: len(constants) + k for k, symbol in enumerate(function.inputs)}
    runs, operands, size = [], [], len(constants) + len(function.inputs)
    callees = list(dict.fromkeys(kind for kind, _ in steps.values() if not isinstance(kind, str)))

    def where(x) -> int:
        if not isinstance(x, Expression) or x.is_constant:
            return place["constant", float(x.value if isinstance(x, Expression) else x)]
        return place[x.operands[0].index] + x.value if x.op == "item" else place[x.index]

    for kind, nodes in _scheduled(steps):
        if isinstance(kind, str):
            runs += [KINDS.index(kind), len(nodes)]
        for index in nodes:
            given, found = steps[index][1], 1
            if not isinstance(kind, str):
                found = len(kind.outputs)
                runs += [CALL, 1]
                operands += [callees.index(kind), len(given), found]
            operands += [where(operand) for operand in given]
            place[index], size = size, size + found
    return OperationTable(runs, operands, constants, [where(x) for x in function.outputs], callees, size)


def _steps(function: Function) -> tuple[dict[int, tuple], list[float]]:
    """Operations {index: (kind or callee, operands)} after contraction to multiply–adds, and all constants."""
    steps, constants = {}, dict.fromkeys(float(x) for x in function.outputs if not isinstance(x, Expression))
    for node in fused(function.nodes, function.outputs):
        if node.is_constant:
            constants[node.value] = None
        elif node.op == "call":
            steps[node.index] = node.value, _arguments(node)
        elif node.op not in ("symbol", "item"):
            steps[node.index] = node.op, node.operands
    return steps, list(constants)


def _arguments(call: Expression) -> tuple[Expression, ...]:
    """Arguments of a call, one by one."""
    if not call.operands or call.operands[0].op != "call":
        return call.operands
    first, rest = call.operands[0], call.operands[1:]
    return *(first.graph.result(first, k) for k in range(len(first.value.outputs))), *rest


def _scheduled(steps):
    """Runs of independent operations, their kind and indices: list scheduling, always the kind with the most ready ones."""
    waiting, users, ready = {}, defaultdict(list), defaultdict(list)
    for index, (kind, operands) in steps.items():
        sources = {x.operands[0].index if x.op == "item" else x.index for x in operands}
        needed = [source for source in sources if source in steps]
        for source in needed:
            users[source].append(index)
        waiting[index] = len(needed)
        if not needed:
            ready[kind].append(index)
    while ready:
        kind = max(ready, key=lambda kind: len(ready[kind]))
        nodes = ready.pop(kind)
        yield kind, nodes
        for index in nodes:
            for user in users[index]:
                waiting[user] -= 1
                if not waiting[user]:
                    ready[steps[user][0]].append(user)
