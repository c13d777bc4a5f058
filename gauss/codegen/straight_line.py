"""Straight-line code of a schedule: an input is loaded at its first use, an output stored as soon as it is computed.

This keeps few values live, so that they stay in registers.
"""

from collections import defaultdict
from collections.abc import Callable

from llvmlite import ir

from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import POINTER
from gauss.codegen.ir_module import INTEGER, vector_width
from gauss.codegen.lanes import Lanes, kind
from gauss.codegen.schedule import Schedule
from gauss.codegen.superword import IsomorphicPart, ordered_operands, superword_groups


def straight_line(
    lanes: Lanes, scheduled: Schedule, fetch: Callable, keep: Callable, calls=None, vectorise: bool = True, results=None
):
    """Emit the operations of a function at the insertion point.

    Parameters
    ----------
    lanes : Lanes
        Emitter of operations.
    scheduled : Schedule
        The function. Its inputs may be any nodes outside its operations.
    fetch : callable
        ``fetch(k)`` loads input k, at most once; unused inputs are not loaded.
    keep : callable
        ``keep(k, value)`` stores output k, possibly before other inputs are loaded.
    calls : dict, optional
        Emitter of the call of each called function, {function: callable}.
    vectorise : bool
        Whether independent isomorphic parts are packed into SIMD lanes (:mod:`gauss.codegen.superword`).
    results : dict, optional
        Memory of the results of calls that are passed on as a whole, by their index; see :func:`passed_on`.
    """
    values = _Values(scheduled, fetch, keep)
    nodes = scheduled.nodes
    width = vector_width(lanes.module)
    groups = superword_groups(scheduled, width) if vectorise and lanes.width == 1 < width else []
    for parts in groups:
        _vectorised(lanes, parts, values)
    written = {node.index for parts in groups for part in parts for node in part}
    _emit(lanes, [node for node in nodes if node.index not in written], values, calls or {}, results or {})
    values.keep_inputs(lanes)


def _emit(lanes: Lanes, nodes: list[Expression], values: "_Values", calls: dict, results: dict):
    """Emit operations one after the other; the value of a call is the function that loads its results."""
    lanes.sincos_together({angle: values[angle.index] for angle in _angles(nodes)})
    operation, positions = lanes.operation, values.positions
    for node in nodes:
        if node.op == "call":
            values[node.index] = calls[node.value]([values[x.index] for x in node.operands], results.get(node.index))
        elif node.op == "item":
            values.record(node, values[node.operands[0].index](node.value))
        elif node.op != "symbol":
            values[node.index] = value = operation(node, values)
            if node.index in positions:
                values.record(node, value)


class _Values(dict):
    """Values of nodes by their index."""

    def __init__(self, scheduled: Schedule, fetch: Callable, keep: Callable):
        super().__init__()
        self.inputs = {x.index: k for k, x in enumerate(scheduled.inputs)}
        self.fetch, self.keep, self.outputs = fetch, keep, scheduled.outputs
        self.positions: dict[int, list[int]] = defaultdict(list)
        for k, output in enumerate(scheduled.outputs):
            if isinstance(output, Expression):
                self.positions[output.index].append(k)

    def __missing__(self, index: int):
        self[index] = self.fetch(self.inputs[index])
        return self[index]

    def record(self, node: Expression, value):
        """Record a value, and store it if it is an output."""
        self[node.index] = value
        for k in self.positions.get(node.index, ()):
            self.keep(k, value)

    def keep_inputs(self, lanes: Lanes):
        """Store outputs that are inputs or constants."""
        for k, output in enumerate(self.outputs):
            if not isinstance(output, Expression):
                self.keep(k, lanes.constant(float(output)))
            elif output.index in self.inputs:
                self.keep(k, self[output.index])


def _angles(nodes) -> list[Expression]:
    """Inputs of sines and cosines."""
    return [node.operands[0] for node in nodes if node.op in ("sin", "cos") and node.operands[0].op == "symbol"]


def _vectorised(lanes: Lanes, parts: list[IsomorphicPart], values: _Values):
    """Emit isomorphic parts of a function, each in a lane."""
    symbols = [twins for twins in zip(*parts, strict=True) if twins[0].op == "symbol"]
    vectors = {twins[0].index: lanes.joined([values[x.index] for x in twins]) for twins in symbols}
    beside = Lanes(lanes.module, vectors[symbols[0][0].index].type.count, lanes.b)
    beside.sincos_together({angle: vectors[angle.index] for angle in _angles(parts[0])})
    for twins in zip(*parts, strict=True):
        node = twins[0]
        if node.op == "symbol":
            continue
        vectors[node.index] = beside.operation(node, _packed_operands(beside, twins, vectors))
        for lane, twin in enumerate(twins):
            if twin.index in values.positions:
                values.record(twin, lanes.lane_group(vectors[node.index], lane))


def _packed_operands(beside: Lanes, twins: tuple[Expression, ...], vectors: dict) -> dict:
    """Vectors of the operands of isomorphic nodes; constants may differ from lane to lane."""
    operands = zip(*(ordered_operands(twin) for twin in twins), strict=True)
    value = lambda xs: beside.constants([x.value for x in xs]) if xs[0].is_constant else vectors[xs[0].index]  # noqa: E731
    return {xs[0].index: value(xs) for xs in operands}


def passed_on(nodes) -> dict[Expression, int]:
    """Calls whose results are passed on as a whole to other calls, and the numbers of values in memory for it.

    The arguments of those calls follow the results.
    """
    found: dict[Expression, int] = {}
    for node in nodes:
        if node.op == "call" and node.operands and node.operands[0].op == "call":
            first = node.operands[0]
            found[first] = max(found.get(first, 0), len(first.value.outputs) + len(node.operands) - 1)
    return found


def result_rooms(lanes: Lanes, nodes) -> dict:
    """Memory of the results of calls that are passed on as a whole."""
    room = lambda size: lanes.b.alloca(kind(lanes.width), size)  # noqa: E731
    return {call.index: Results(lanes, room(size), call.value) for call, size in passed_on(nodes).items()}


class Results:
    """Results of a call in memory of their own: they are loaded where they are used."""

    def __init__(self, lanes: Lanes, room, function: Function):
        self.lanes, self.room, self.count = lanes, lanes.b.bitcast(room, POINTER), len(function.outputs)

    def __call__(self, k: int):
        """Load result k."""
        return self.lanes.load(self.room, ir.Constant(INTEGER, k * self.lanes.width))


def calling(lanes: Lanes, callees) -> dict:
    """Emitters of the calls of functions {function: code}."""
    return {callee: _CalleeWriter(lanes, callee, code) for callee, code in callees.items()}


class _CalleeWriter:
    """Call of another function; its results are loaded before the next call overwrites the buffers."""

    def __init__(self, lanes: Lanes, callee: Function, code: ir.Function):
        self.lanes, self.callee, self.code = lanes, callee, code
        code.attributes.add("noinline")
        self.given, self.found = (
            lanes.b.bitcast(lanes.b.alloca(kind(lanes.width), max(size, 1)), POINTER)
            for size in (len(callee.inputs), len(callee.outputs))
        )

    def __call__(self, arguments, results: Results | None = None):
        lanes, b = self.lanes, self.lanes.b
        place = lambda k: ir.Constant(INTEGER, k * lanes.width)  # noqa: E731
        given, found, first = self.given, self.found if results is None else results.room, 0
        if arguments and isinstance(arguments[0], Results):  # the other arguments follow them in their memory
            given, first, arguments = arguments[0].room, arguments[0].count, arguments[1:]
        for k, argument in enumerate(arguments, first):
            lanes.store(argument, given, place(k))
        b.call(self.code, [given, place(1), found, place(1)])
        if results is not None:
            return results
        values = [lanes.load(found, place(k)) for k in range(len(self.callee.outputs))]
        return values.__getitem__
