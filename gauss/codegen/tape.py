"""Functions too long to be compiled: a table of their operations, run by a loop of machine code.

The loop takes no longer to compile for a longer table. Each run of operations of one kind is a loop of its own, so that the
processor seldom has to guess what comes next.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen.expression import Expression, Graph
from gauss.codegen.ir_blocks import BODY, POINTER, strip
from gauss.codegen.lanes import INTEGER, Lanes
from gauss.codegen.operation_table import ARITY, CALL, KINDS, Table

INDEX, BYTE = ir.IntType(32), ir.IntType(8)
PLACES, ROOM, CODES = INDEX.as_pointer(), BYTE.as_pointer(), BODY.as_pointer().as_pointer()
ARGUMENTS = {"runs": PLACES, "operands": PLACES, "constants": POINTER, "outputs": PLACES, "callees": CODES}
ARGUMENTS |= dict.fromkeys(("n_runs", "n_constants", "n_in", "n_out", "size"), INTEGER)


def run_table(module: ir.Module, name: str, table: Table, n_in: int, callees: list[ir.Function], width: int) -> ir.Function:
    """Code of a function for one vector width that runs a table.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Where it is written.
    name : str
        Name of the function.
    table : Table
        What it runs.
    n_in : int
        Number of inputs.
    callees : list of llvmlite.ir.Function
        Code of the functions that the table calls, for this width.
    width : int
        Number of states at a time.
    """
    loop = module.globals.get(f"tape_{width}") or _Loop(module, width).function
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
    """Pointer to numbers in the module, written once for all widths; as bytes, for these are quickly written."""
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


class _Loop:
    """Writer of the loop for one vector width: (in, in_stride, out, out_stride, …) with ``ARGUMENTS``."""

    def __init__(self, module: ir.Module, width: int):
        self.module, self.width = module, width
        kinds = [*BODY.args, *ARGUMENTS.values()]
        self.function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name=f"tape_{width}")
        self.function.linkage = "internal"
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.lanes = Lanes(module, width, self.b)
        self.told = dict(zip(ARGUMENTS, self.function.args[4:], strict=True))
        self._write(*self.function.args[:4])

    def _write(self, source, in_stride, target, out_stride):
        b, told = self.b, self.told
        room = b.call(self._external("malloc", ROOM, INTEGER), [b.mul(told["size"], INTEGER(8 * self.width))])
        self.room = b.bitcast(room, POINTER)
        constant = lambda i: self.lanes.spread(b.load(b.gep(told["constants"], [i])))  # noqa: E731
        self._each(told["n_constants"], lambda i: self._keep(i, constant(i)))
        given = lambda i: self.lanes.load(source, b.mul(in_stride, i))  # noqa: E731
        self._each(told["n_in"], lambda i: self._keep(b.add(told["n_constants"], i), given(i)))
        self._runs()
        found = lambda i: self._value(self._place(told["outputs"], i))  # noqa: E731
        self._each(told["n_out"], lambda i: self.lanes.store(found(i), target, b.mul(out_stride, i)))
        b.call(self._external("free", ir.VoidType(), ROOM), [room])
        b.ret_void()

    def _external(self, name: str, kind: ir.Type, argument: ir.Type) -> ir.Function:
        return self.module.globals.get(name) or ir.Function(self.module, ir.FunctionType(kind, [argument]), name)

    def _each(self, count, body):
        """Write ``for (i = 0; i < count; i++) body(i)``."""
        strip(self.b, INTEGER(0), count, 1, body)

    def _place(self, places, i):
        return self.b.sext(self.b.load(self.b.gep(places, [i])), INTEGER)

    def _value(self, place):
        return self.lanes.load(self.room, self.b.mul(place, INTEGER(self.width)))

    def _keep(self, place, value):
        self.lanes.store(value, self.room, self.b.mul(place, INTEGER(self.width)))

    def _runs(self):
        """Write the loop over runs."""
        b, told = self.b, self.told
        with b.goto_entry_block():
            operands, place = b.alloca(PLACES), b.alloca(INTEGER)
        b.store(told["operands"], operands)
        b.store(b.add(told["n_constants"], told["n_in"]), place)

        def run(i):
            kind, count = (self._place(told["runs"], b.add(b.mul(i, INTEGER(2)), INTEGER(k))) for k in (0, 1))
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

        self._each(told["n_runs"], run)

    def _run(self, name: str, count, given, first):
        """Write a run of one kind; numbers of operands taken and of results."""
        b, arity = self.b, ARITY[name]

        def one(k):
            values = [self._value(self._place(given, b.add(b.mul(k, INTEGER(arity)), INTEGER(j)))) for j in range(arity)]
            self._keep(b.add(first, k), self._result(name, values))

        self._each(count, one)
        return b.mul(count, INTEGER(arity)), count

    def _result(self, name: str, values):
        symbols = Graph().symbols("x", len(values))
        node = Expression(symbols[0].graph, name, tuple(symbols), None, len(values))
        self.lanes.turned.clear()  # what was turned for one operation is not known to another
        return self.lanes.operation(node, {symbol.index: value for symbol, value in zip(symbols, values, strict=True)})

    def _call(self, given, first):
        """Write the call of another function; numbers of operands taken and of results."""
        b, head = self.b, 3
        callee, n_in, n_out = (self._place(given, INTEGER(k)) for k in range(head))
        bytes_ = b.mul(n_in, INTEGER(8 * self.width))
        room = b.call(self._external("malloc", ROOM, INTEGER), [bytes_])
        buffer, apart = b.bitcast(room, POINTER), INTEGER(self.width)
        value = lambda i: self._value(self._place(given, b.add(i, INTEGER(head))))  # noqa: E731
        self._each(n_in, lambda i: self.lanes.store(value(i), buffer, b.mul(i, apart)))
        found = b.gep(self.room, [b.mul(first, apart)])
        b.call(b.load(b.gep(self.told["callees"], [callee])), [buffer, apart, found, apart])
        b.call(self._external("free", ir.VoidType(), ROOM), [room])
        return b.add(n_in, INTEGER(head)), n_out
