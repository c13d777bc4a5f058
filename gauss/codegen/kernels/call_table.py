"""Loop in machine code that executes calls from a table: function index, addresses of inputs and outputs."""

import ctypes
from functools import cached_property

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Lanes, NativeFunction, Writer, machine, schedule, straight_line

VOID, ENTRY = ir.VoidType(), ir.IntType(32)
TABLE = ENTRY.as_pointer()
SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)


class CallTable(NativeFunction):
    """Functions on one memory, and the loop that calls them from a table; scenes with the same functions share its code.

    Its code is ``calls(double* memory, i32* table, i64 size)``, as the table is no vector of doubles.
    """

    name = "calls"

    def __init__(self, functions: list[Function]):
        self.functions, self.count = functions, len(functions)

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code of the loop and of the functions, for one memory at a time."""
        module = writer.module
        codes = [_code(module, f"function_{k}", function) for k, function in enumerate(self.functions)]
        lengths = [1 + len(function.inputs) + len(function.outputs) for function in self.functions]
        return _loop(module, codes, lengths)

    @cached_property
    def _run(self):
        writer = Writer()
        calls = writer.body(self)
        run = ir.Function(writer.module, calls.ftype, "run")
        b = ir.IRBuilder(run.append_basic_block("entry"))
        b.call(calls, run.args)
        b.ret_void()
        self.code = machine.load(str(writer.module))
        return self.code.entry("run", SIGNATURE)

    def run(self, memory: np.ndarray, table: np.ndarray):
        """Execute a table of int32 entries: index of a function, addresses of its inputs, then of its outputs."""
        self._run.call(memory.ctypes.data, table.ctypes.data, table.size)


def _code(module: ir.Module, name: str, function: Function) -> ir.Function:
    """Code of one function: (memory, pointer to its addresses in the table)."""
    code = ir.Function(module, ir.FunctionType(VOID, [POINTER, TABLE]), name)
    code.linkage = "internal"
    code.attributes.add("noinline")
    memory, table = code.args
    table.add_attribute("noalias")
    b = ir.IRBuilder(code.append_basic_block("entry"))
    lanes, n_in = Lanes(module, 1, b), len(function.inputs)

    def place(k: int):
        return b.sext(b.load(b.gep(table, [INTEGER(k)])), INTEGER)

    straight_line(
        lanes,
        schedule(function),
        lambda k: lanes.load(memory, place(k)),
        lambda k, value: lanes.store(value, memory, place(n_in + k)),
        vectorise=False,
    )
    b.ret_void()
    return code


def _loop(module: ir.Module, codes, lengths) -> ir.Function:
    """Emit ``calls(double* memory, i32* table, i64 size)``."""
    run = ir.Function(module, ir.FunctionType(VOID, [POINTER, TABLE, INTEGER]), "calls")
    run.linkage = "internal"
    memory, table, size = run.args
    b = ir.IRBuilder(run.append_basic_block("entry"))
    before = b.block
    head, call, done = (run.append_basic_block(name) for name in ("head", "call", "done"))
    b.branch(head)
    b.position_at_end(head)
    at = b.phi(INTEGER)
    at.add_incoming(INTEGER(0), before)
    b.cbranch(b.icmp_signed("<", at, size), call, done)
    b.position_at_end(call)
    own = b.gep(table, [b.add(at, INTEGER(1))])
    nothing = run.append_basic_block("nothing")
    switch = b.switch(b.load(b.gep(table, [at])), nothing)
    for k, (code, length) in enumerate(zip(codes, lengths, strict=True)):
        block = run.append_basic_block("kind")
        switch.add_case(ENTRY(k), block)
        b.position_at_end(block)
        b.call(code, [memory, own])
        at.add_incoming(b.add(at, INTEGER(length)), block)
        b.branch(head)
    b.position_at_end(nothing)
    b.unreachable()
    b.position_at_end(done)
    b.ret_void()
    return run
