"""Calls of Python from machine code: (inputs, outputs) by address, to the object that is entered last in this thread.

The machine code of a scene calls one external function, so that it may be kept on disk. That function is made once a
process: it calls Python's C API (PyObject_CallFunction), and writes NaN where an exception is raised. The exception stays
with the thread, later calls are not made, and ctypes raises it when the machine code returns. Therefore such code is called
through :data:`HOLDING`, function types that keep the interpreter's lock.
"""

import ctypes
import sys
import threading
from functools import cache

import llvmlite.binding as llvm
from llvmlite import ir

from gauss.codegen.emit import Writer
from gauss.codegen.ir_blocks import POINTER
from gauss.codegen.ir_module import INTEGER, external
from gauss.codegen.native_function import NativeFunction

SYMBOL = "gauss_python_callback"
HOLDING = ctypes.PYFUNCTYPE
ARGUMENTS = b"nn"  # two numbers of the size of an address, in the words of Py_BuildValue
NEEDED = "PyErr_Occurred", "PyObject_CallFunction", "Py_DecRef"
CODE = """
define void @enter(double* %given, i64 %n_in, double* %found, i64 %n_out) {{
entry:
  %raised = call i8* inttoptr (i64 {PyErr_Occurred} to i8* ()*)()
  %quiet = icmp eq i8* %raised, null
  br i1 %quiet, label %ask, label %failed
ask:
  %source = ptrtoint double* %given to i64
  %target = ptrtoint double* %found to i64
  %answer = call i8* (i8*, i8*, ...) inttoptr (i64 {PyObject_CallFunction} to i8* (i8*, i8*, ...)*)(
    i8* inttoptr (i64 {receiver} to i8*), i8* inttoptr (i64 {format} to i8*), i64 %source, i64 %target)
  %lost = icmp eq i8* %answer, null
  br i1 %lost, label %failed, label %answered
answered:
  call void inttoptr (i64 {Py_DecRef} to void (i8*)*)(i8* %answer)
  ret void
failed:
  %k = phi i64 [0, %entry], [0, %ask], [%next, %written]
  %more = icmp slt i64 %k, %n_out
  br i1 %more, label %written, label %done
written:
  %place = getelementptr double, double* %found, i64 %k
  store double 0x7FF8000000000000, double* %place
  %next = add i64 %k, 1
  br label %failed
done:
  ret void
}}
"""


class PythonCallback(NativeFunction):
    """Function of machine code that asks Python: the object that is entered last, see :class:`Receiver`."""

    def __init__(self, name: str, n_in: int, n_out: int):
        self.name, self.n_in, self.n_out = name, n_in, n_out

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return self.n_in, self.n_out

    def operations(self) -> dict[str, int]:
        """None are counted: what Python does is not known."""
        return {}

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state at a time, whose inputs and outputs are contiguous."""
        body = self.begin_scalar(writer.module, width)
        given, _, found, _ = body.args
        b = ir.IRBuilder(body.append_basic_block("entry"))
        callee = external(writer.module, SYMBOL, ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
        b.call(callee, [given, INTEGER(self.n_in), found, INTEGER(self.n_out)])
        b.ret_void()
        return body


class Receiver:
    """Context in which machine code of this thread calls this object with the addresses of inputs and outputs."""

    def __enter__(self):
        _entered().append(self)
        return self

    def __exit__(self, *_):
        _entered().pop()

    def __call__(self, given: int, found: int):
        """Read the inputs, and write the outputs."""
        raise NotImplementedError


_local = threading.local()


def _entered() -> list[Receiver]:
    """Receivers of this thread, the last one in use."""
    found = getattr(_local, "entered", None)
    if found is None:
        found = _local.entered = []
    return found


def _receive(given: int, found: int):
    _local.entered[-1](given, found)


def callbacks_are_available() -> bool:
    """Whether machine code can call Python here."""
    return sys.implementation.name == "cpython"


def register_callback():
    """Let machine code that is linked from now on call Python."""
    with _lock:
        _registered()


_lock = threading.Lock()  # threads may link at the same time, and code that is linked needs the function for ever


@cache
def _registered() -> object:
    address = {name: ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value for name in NEEDED}
    form = ctypes.create_string_buffer(ARGUMENTS)
    text = CODE.format(**address, receiver=id(_receive), format=ctypes.addressof(form))
    machine = llvm.Target.from_default_triple().create_target_machine(opt=1, codemodel="jitdefault")
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine)
    engine.finalize_object()
    llvm.add_symbol(SYMBOL, engine.get_function_address("enter"))
    return engine, form
