"""Interpreter loop in machine code for functions too long to compile: it executes their operation table.

Its compile time does not depend on the length of the table. Each run of operations of one kind is an inner loop, so that
branch prediction seldom fails.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen.expression import Expression, Graph
from gauss.codegen.ir_blocks import BODY, POINTER, strip_mined_loop
from gauss.codegen.lanes import INTEGER, Lanes
from gauss.codegen.operation_table import ARITY, CALL, KINDS, OperationTable

INDEX, BYTE = ir.IntType(32), ir.IntType(8)
PLACES, ROOM, CODES = INDEX.as_pointer(), BYTE.as_pointer(), BODY.as_pointer().as_pointer()
ARGUMENTS = {"runs": PLACES, "operands": PLACES, "constants": POINTER, "outputs": PLACES, "callees": CODES}
ARGUMENTS |= dict.fromkeys(("n_runs", "n_constants", "n_in", "n_out", "size"), INTEGER)


def run_table(
    module: ir.Module, name: str, table: OperationTable, n_in: int, callees: list[ir.Function], width: int
) -> ir.Function:
    """Code of a function for one vector width that interprets a table.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Module of the code.
    name : str
        Name of the function.
    table : Table
        Operation table.
    n_in : int
        Number of inputs.
    callees : list of llvmlite.ir.Function
        Code of the called functions, for this width.
    width : int
        Number of states at a time.
    """
    loop = module.globals.get(f"tape_{width}") or _TableLoopWriter(module, width).function
    body = ir.Function(module, BODY, name=f"{name}_{width}")
    body.linkage = "internal"
    b = ir.IRBuilder(body.append_basic_block("entry"))
    given = {
        "runs": _numbers(module, f"{name}_runs", np.array(table.runs, dtype=np.int32), PLACES),
        "operands": _numbers(module, f"{name}_operands", np.array(table.operands, dtype=np.int32), PLACES),
        "constants": _numbers(module, f"{name}_constants", np.array(table.constants, dtype=float), POINTER),
        "outputs": _numbers(module, f"{name}_outputs", np.array(table.outputs, dtype=np.int32), PLACES),
        "callees": _addresses(module, f"{name}_callees_{width}", callees),
        "n_runs": INTEGER(len(table.runs) // 2),
        "n_constants": INTEGER(len(table.constants)),
        "n_in": INTEGER(n_in),
        "n_out": INTEGER(len(table.outputs)),
        "size": INTEGER(table.size),
    }
    b.call(loop, [*body.args, *(given[name] for name in ARGUMENTS)])
    b.ret_void()
    return body


def _numbers(module: ir.Module, name: str, numbers: np.ndarray, kind: ir.Type):
    """Pointer to constant data of the module, once for all widths; llvmlite prints bytes faster than numbers."""
    known = module.globals.get(name)
    if known is None:
        data = bytearray(numbers.tobytes())
        known = ir.GlobalVariable(module, ir.ArrayType(BYTE, len(data)), name)
        known.initializer, known.global_constant = ir.Constant(known.value_type, data), True
        known.linkage, known.align = "internal", 8
    return known.bitcast(kind)


def _addresses(module: ir.Module, name: str, functions):
    kind = ir.ArrayType(BODY.as_pointer(), len(functions))
    table = ir.GlobalVariable(module, kind, name)
    table.initializer, table.linkage = ir.Constant(kind, functions), "internal"
    return table.bitcast(CODES)


class _TableLoopWriter:
    """Emitter of the loop for one vector width: (in, in_stride, out, out_stride, …) with ``ARGUMENTS``."""

    def __init__(self, module: ir.Module, width: int):
        self.module, self.width = module, width
        kinds = [*BODY.args, *ARGUMENTS.values()]
        self.function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name=f"tape_{width}")
        self.function.linkage = "internal"
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.lanes = Lanes(module, width, self.b)
        self.arguments = dict(zip(ARGUMENTS, self.function.args[4:], strict=True))
        self._write(*self.function.args[:4])

    def _write(self, source, in_stride, target, out_stride):
        b, args = self.b, self.arguments
        room = b.call(self._external("malloc", ROOM, INTEGER), [b.mul(args["size"], INTEGER(8 * self.width))])
        self.room = b.bitcast(room, POINTER)
        constant = lambda i: self.lanes.broadcast(b.load(b.gep(args["constants"], [i])))  # noqa: E731
        self._each(args["n_constants"], lambda i: self._keep(i, constant(i)))
        given = lambda i: self.lanes.load(source, b.mul(in_stride, i))  # noqa: E731
        self._each(args["n_in"], lambda i: self._keep(b.add(args["n_constants"], i), given(i)))
        self._runs()
        found = lambda i: self._value(self._place(args["outputs"], i))  # noqa: E731
        self._each(args["n_out"], lambda i: self.lanes.store(found(i), target, b.mul(out_stride, i)))
        b.call(self._external("free", ir.VoidType(), ROOM), [room])
        b.ret_void()

    def _external(self, name: str, kind: ir.Type, argument: ir.Type) -> ir.Function:
        return self.module.globals.get(name) or ir.Function(self.module, ir.FunctionType(kind, [argument]), name)

    def _each(self, count, body):
        """Write ``for (i = 0; i < count; i++) body(i)``."""
        strip_mined_loop(self.b, INTEGER(0), count, 1, body)

    def _place(self, places, i):
        return self.b.sext(self.b.load(self.b.gep(places, [i])), INTEGER)

    def _value(self, place):
        return self.lanes.load(self.room, self.b.mul(place, INTEGER(self.width)))

    def _keep(self, place, value):
        self.lanes.store(value, self.room, self.b.mul(place, INTEGER(self.width)))

    def _runs(self):
        """Emit the loop over runs."""
        b, args = self.b, self.arguments
        with b.goto_entry_block():
            operands, place = b.alloca(PLACES), b.alloca(INTEGER)
        b.store(args["operands"], operands)
        b.store(b.add(args["n_constants"], args["n_in"]), place)

        def run(i):
            kind, count = (self._place(args["runs"], b.add(b.mul(i, INTEGER(2)), INTEGER(k))) for k in (0, 1))
            first, given = b.load(place), b.load(operands)
            unknown, after = (b.function.append_basic_block(name) for name in ("unknown", "after"))
            switch = b.switch(kind, unknown)
            b.position_at_end(unknown)
            b.unreachable()
            for number, name in enumerate([*KINDS, "call"]):
                block = b.function.append_basic_block(name)
                switch.add_case(INTEGER(number), block)
                b.position_at_end(block)
                taken, made = self._call(given, first) if number == CALL else self._run(name, count, given, first)
                b.store(b.gep(given, [taken]), operands)
                b.store(b.add(first, made), place)
                b.branch(after)
            b.position_at_end(after)

        self._each(args["n_runs"], run)

    def _run(self, name: str, count, given, first):
        """Emit a run of one kind; returns the numbers of operands and of results."""
        b, arity = self.b, ARITY[name]

        def one(k):
            values = [self._value(self._place(given, b.add(b.mul(k, INTEGER(arity)), INTEGER(j)))) for j in range(arity)]
            self._keep(b.add(first, k), self._result(name, values))

        self._each(count, one)
        return b.mul(count, INTEGER(arity)), count

    def _result(self, name: str, values):
        symbols = Graph().symbols("x", len(values))
        node = Expression(symbols[0].graph, name, tuple(symbols), None, len(values))
        self.lanes.sincos_values.clear()  # operands differ from run to run
        return self.lanes.operation(node, {symbol.index: value for symbol, value in zip(symbols, values, strict=True)})

    def _call(self, given, first):
        """Emit the call of another function; returns the numbers of operands and of results."""
        b, head = self.b, 3
        callee, n_in, n_out = (self._place(given, INTEGER(k)) for k in range(head))
        bytes_ = b.mul(n_in, INTEGER(8 * self.width))
        room = b.call(self._external("malloc", ROOM, INTEGER), [bytes_])
        buffer, apart = b.bitcast(room, POINTER), INTEGER(self.width)
        value = lambda i: self._value(self._place(given, b.add(i, INTEGER(head))))  # noqa: E731
        self._each(n_in, lambda i: self.lanes.store(value(i), buffer, b.mul(i, apart)))
        found = b.gep(self.room, [b.mul(first, apart)])
        b.call(b.load(b.gep(self.arguments["callees"], [callee])), [buffer, apart, found, apart])
        b.call(self._external("free", ir.VoidType(), ROOM), [room])
        return b.add(n_in, INTEGER(head)), n_out
