"""Functions → straight-line LLVM IR: the same walk writes code for one state and for a SIMD vector of states.

A function is written once for each width as ``void name(double* in, i64 in_stride, double* out, i64 out_stride)`` over
structures of arrays; a function that calls another calls it with as many lanes as it has itself. A function that is too
long is run from a table.
"""

from llvmlite import ir

from gauss.tracing import machine
from gauss.tracing.alike import alike, ordered
from gauss.tracing.blocks import BODY, POINTER, strip
from gauss.tracing.expression import Expression
from gauss.tracing.function import Function
from gauss.tracing.lanes import INTEGER, Lanes, kind
from gauss.tracing.schedule import Schedule, schedule
from gauss.tracing.table import Table, tabulate
from gauss.tracing.tape import run_table

LONGEST, LONGEST_CALLER = 10_000, 5_000  # operations that are compiled in about a second; a caller's time goes elsewhere
LONGEST_ALONE = 18_000  # the same for the only function of a module: the loops of integrators have several
LONGEST_PLAIN = 100_000  # operations that are compiled in a few seconds when they are not optimised
PAGE = 4096  # bytes


class Writer:
    """Writer of one module of functions and of the loops that call them.

    Parameters
    ----------
    longest : int, optional
        Operations of a function beyond which it is run from a table.
    """

    def __init__(self, longest: int | None = None):
        self.longest = LONGEST if longest is None else longest
        self.module = ir.Module(name="gauss")
        self._bodies: dict[tuple, ir.Function] = {}
        self._schedules: dict[Function, Schedule] = {}
        self._tables: dict[Function, tuple[str, Table]] = {}

    def body(self, function: Function, width: int = 1) -> ir.Function:
        """Code of a function for one vector width, written when it is first asked for.

        Anything with ``inputs``, ``outputs`` and ``write(writer, width)`` that returns such code may stand for a function.

        Raises
        ------
        TypeError
            If an output depends on a symbol that is no input.
        """
        key = (function, width)
        if key not in self._bodies:
            traced = isinstance(function, Function)
            self._bodies[key] = self._write(function, width) if traced else function.write(self, width)
        return self._bodies[key]

    def over_states(self, function: Function, widths):
        """Write ``run(i64 count, double* in, i64 in_stride, double* out, i64 out_stride)``, input j of state i being
        ``in[j * in_stride + i]``: vectors of the widest width as long as they fit, then single states.
        """  # noqa: D205
        bodies = {width: self.body(function, width) for width in sorted({1, *widths}, reverse=True)}
        run = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [INTEGER, *BODY.args]), name="run")
        count, source, in_stride, target, out_stride = run.args
        b = ir.IRBuilder(run.append_basic_block("entry"))
        start = ir.Constant(INTEGER, 0)
        for width, body in bodies.items():
            call = lambda i, body=body: b.call(body, [b.gep(source, [i]), in_stride, b.gep(target, [i]), out_stride])  # noqa: E731
            start = strip(b, start, count, width, call)
        b.ret_void()

    def export(self, function: Function, name: str):
        """Write ``name(double* in, double* out)``, one state."""
        entry = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [POINTER, POINTER]), name=name)
        b, one = ir.IRBuilder(entry.append_basic_block("entry")), INTEGER(1)
        b.call(self.body(function), [entry.args[0], one, entry.args[1], one])
        b.ret_void()

    def _scheduled(self, function: Function) -> Schedule:
        """Order of the operations, the same for all widths."""
        if function not in self._schedules:
            self._schedules[function] = schedule(function)
        return self._schedules[function]

    def _write(self, function: Function, width: int) -> ir.Function:
        nodes, inputs = function.nodes, set(function.inputs)
        strangers = [n.value for n in nodes if n.op == "symbol" and n not in inputs]
        if strangers:
            raise TypeError(
                f"the outputs of {function.name!r} depend on {', '.join(strangers[:5])}, which is none of its inputs."
            )
        if len(nodes) > (LONGEST_CALLER if any(node.op == "call" for node in nodes) else self.longest):
            return self._write_table(function, width)
        callees = {node.value: self.body(node.value, width) for node in nodes if node.op == "call"}
        body = ir.Function(self.module, BODY, name=f"{function.name}_{len(self._bodies)}_{width}")
        body.linkage = "internal"
        body.args[0].add_attribute("noalias")
        body.args[2].add_attribute("noalias")
        b = ir.IRBuilder(body.append_basic_block("entry"))
        if width > 1:
            _at_a_page(b)
        lanes = Lanes(self.module, width, b)
        calls = {callee: _Call(lanes, callee, code) for callee, code in callees.items()}
        source, in_stride, target, out_stride = body.args
        given = [lanes.load(source, b.mul(in_stride, INTEGER(k))) for k in range(len(function.inputs))]
        for k, value in enumerate(straight_line(lanes, self._scheduled(function), given, calls)):
            lanes.store(value, target, b.mul(out_stride, INTEGER(k)))
        b.ret_void()
        return body

    def _write_table(self, function: Function, width: int) -> ir.Function:
        if function not in self._tables:
            self._tables[function] = f"{function.name}_{len(self._tables)}", tabulate(function)
        name, table = self._tables[function]
        callees = [self.body(callee, width) for callee in table.callees]
        return run_table(self.module, name, table, len(function.inputs), callees, width)


def _at_a_page(b: ir.IRBuilder):
    """Let the frame of a function begin at a page of memory.

    Elsewhere it begins where the process happens to put it, and its vectors are read and written up to a third slower.
    """
    room = b.alloca(ir.IntType(8))
    room.align = PAGE
    b.call(ir.InlineAsm(ir.FunctionType(ir.VoidType(), [room.type]), "", "r", side_effect=True), [room])  # so that it stays


def straight_line(lanes: Lanes, scheduled: Schedule, given, calls=None) -> list:
    """Write a function where the builder stands: values of its inputs in, values of its outputs out."""
    nodes, inputs, outputs = scheduled
    values = {symbol.index: value for symbol, value in zip(inputs, given, strict=True)}
    groups = alike(scheduled, machine.width()) if lanes.width == 1 else []
    for parts in groups:
        _side_by_side(lanes, parts, values, {x.index for x in outputs if isinstance(x, Expression)})
    written = {node.index for parts in groups for part in parts for node in part}
    nodes = [node for node in nodes if node.index not in written]
    lanes.turn_together({angle: values[angle.index] for angle in _angles(nodes)})
    for node in nodes:
        if node.op == "call":
            values[node.index] = calls[node.value]([values[x.index] for x in node.operands])
        elif node.op == "item":
            values[node.index] = values[node.operands[0].index](node.value)
        elif node.op != "symbol":
            values[node.index] = lanes.operation(node, values)
    return [values[x.index] if isinstance(x, Expression) else lanes.constant(float(x)) for x in outputs]


def _side_by_side(lanes: Lanes, parts, values, wanted):
    """Write parts of a function that are alike, each in a lane; values of their inputs in, of what is wanted out."""
    symbols = [twins for twins in zip(*parts, strict=True) if twins[0].op == "symbol"]
    vectors = {twins[0].index: lanes.joined([values[x.index] for x in twins]) for twins in symbols}
    beside = Lanes(lanes.module, vectors[symbols[0][0].index].type.count, lanes.b)
    beside.turn_together({angle: vectors[angle.index] for angle in _angles(parts[0])})
    for twins in zip(*parts, strict=True):
        node = twins[0]
        if node.op != "symbol":
            operands = zip(*(ordered(twin) for twin in twins), strict=True)
            known = {
                xs[0].index: beside.constants([x.value for x in xs]) if xs[0].is_constant else vectors[xs[0].index]
                for xs in operands
            }
            vectors[node.index] = beside.operation(node, known)
        for lane, twin in enumerate(twins):
            if twin.index in wanted:
                values[twin.index] = lanes.cut(vectors[node.index], lane)


def _angles(nodes) -> list[Expression]:
    """Inputs whose sine or cosine is wanted."""
    return [node.operands[0] for node in nodes if node.op in ("sin", "cos") and node.operands[0].op == "symbol"]


class _Call:
    """Call of another function; its results are loaded before the same buffers serve the next call."""

    def __init__(self, lanes: Lanes, callee: Function, code: ir.Function):
        self.lanes, self.callee, self.code = lanes, callee, code
        code.attributes.add("noinline")
        self.given, self.found = (
            lanes.b.alloca(kind(lanes.width), max(size, 1)) for size in (len(callee.inputs), len(callee.outputs))
        )

    def __call__(self, arguments):
        lanes, b = self.lanes, self.lanes.b
        place = lambda k: ir.Constant(INTEGER, k * lanes.width)  # noqa: E731
        given, found = (b.bitcast(buffer, POINTER) for buffer in (self.given, self.found))
        for k, argument in enumerate(arguments):
            lanes.store(argument, given, place(k))
        b.call(self.code, [given, place(1), found, place(1)])
        results = [lanes.load(found, place(k)) for k in range(len(self.callee.outputs))]
        return results.__getitem__
