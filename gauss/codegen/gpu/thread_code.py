"""Code of one thread: a function of the thread's index, and its entries for a GPU and for this CPU.

A thread evaluates a function for one state, or moves one state by a loop. Its code is the same on both processors; a GPU
starts all threads at once, and this CPU one after the other, so that what a GPU computes can be checked without one.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from llvmlite import ir

from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.ir_blocks import POINTER, counted_loop
from gauss.codegen.ir_module import INTEGER, DeviceModule, SingleDeviceModule
from gauss.codegen.native_function import NativeFunction

THREADS_PER_BLOCK = 128  # a multiple of the 32 of a warp; more leave a thread fewer registers
INDEX = "llvm.nvvm.read.ptx.sreg."  # special registers of PTX
WORD = ir.IntType(32)


class Lowered(NamedTuple):
    """Thread code for a device: name of its entry, its text, and which of its arguments are arrays."""

    name: str
    text: str
    is_array: tuple[bool, ...]


class ThreadCode:
    """Module with one function (thread, *arguments), and what calls it."""

    def __init__(self, name: str, kinds: Sequence[ir.Type], single: bool = False):
        self.name, self.writer = name, Writer(SingleDeviceModule(name="gauss") if single else DeviceModule(name="gauss"))
        self.function = ir.Function(self.writer.module, ir.FunctionType(ir.VoidType(), [INTEGER, *kinds]), f"{name}_thread")
        self.function.linkage = "internal"
        self.thread, *self.arguments = self.function.args
        _aligned(self.function)
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))

    @property
    def is_array(self) -> tuple[bool, ...]:
        """Which of its arguments are arrays; the others are whole numbers."""
        return tuple(kind == POINTER for kind in self.function.ftype.args[1:])

    def gpu_text(self) -> str:
        """Module with an entry ``name(*arguments)`` that a GPU calls in every thread."""
        return self._with_entry(self._gpu_entry)

    def cpu_text(self) -> str:
        """Module with an entry ``name(threads, *arguments)`` that runs the threads one after the other."""
        return self._with_entry(self._cpu_entry)

    def _with_entry(self, write: Callable) -> str:
        """Text of the module with an entry, which is removed from the module afterwards."""
        module, (_, *kinds) = self.writer.module, self.function.ftype.args
        known = dict(module.globals)
        write(module, kinds)
        text = str(module)
        for name in set(module.globals) - set(known):
            del module.globals[name]
            module.scope._useset.discard(name)
        return text

    def _gpu_entry(self, module: ir.Module, kinds):
        entry = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), self.name)
        entry.calling_convention = "ptx_kernel"
        _aligned(entry)
        b = ir.IRBuilder(entry.append_basic_block("entry"))
        register = lambda name: b.zext(b.call(_register(module, name), []), INTEGER)  # noqa: E731
        thread = b.add(b.mul(register("ctaid.x"), register("ntid.x")), register("tid.x"))
        b.call(self.function, [thread, *entry.args])
        b.ret_void()

    def _cpu_entry(self, module: ir.Module, kinds):
        entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGER, *kinds]), self.name)
        b = ir.IRBuilder(entry.append_basic_block("entry"))
        with counted_loop(b, INTEGER(0), entry.args[0]) as thread:
            b.call(self.function, [thread, *entry.args[1:]])
        b.ret_void()


def _aligned(function: ir.Function):
    """Arrays begin at doubles: they are not copied byte by byte."""
    for argument in function.args:
        if argument.type == POINTER:
            argument.attributes.align = 8


def _register(module: ir.Module, name: str) -> ir.Function:
    return module.globals.get(INDEX + name) or ir.Function(module, ir.FunctionType(WORD, []), INDEX + name)


def states_code(function: Function | NativeFunction) -> ThreadCode:
    """``run(count, in, in_stride, out, out_stride)``: input j of state i is ``in[j * in_stride + i]``, a state in a thread.

    Neighbouring threads read neighbouring numbers.
    """
    code = ThreadCode("run", [INTEGER, POINTER, INTEGER, POINTER, INTEGER])
    count, source, in_stride, target, out_stride = code.arguments
    b = code.b
    with b.if_then(b.icmp_signed("<", code.thread, count)):
        body = code.writer.body(function, 1, strided=True)
        b.call(body, [b.gep(source, [code.thread]), in_stride, b.gep(target, [code.thread]), out_stride])
    b.ret_void()
    return code
