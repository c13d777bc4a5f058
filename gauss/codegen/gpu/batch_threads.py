"""Loops of batches as thread code: each thread moves one motion by the loop that moves a vector of them on a CPU."""

from collections.abc import Callable

from llvmlite import ir

from gauss.codegen.emit import Writer
from gauss.codegen.function import Function
from gauss.codegen.gpu.thread_code import ThreadCode
from gauss.codegen.intrinsics import copy
from gauss.codegen.ir_blocks import POINTER
from gauss.codegen.kernels.adaptive import Adaptive
from gauss.codegen.kernels.adaptive_batch import MOTION_RECORD, MotionQueue, write_adaptive_batch
from gauss.codegen.kernels.adaptive_batch import POINTERS as ADAPTIVE_POINTERS
from gauss.codegen.kernels.fixed_step import Fixed
from gauss.codegen.kernels.fixed_step_batch import POINTERS as FIXED_POINTERS
from gauss.codegen.kernels.fixed_step_batch import BatchSpan, write_fixed_step_batch
from gauss.codegen.lanes import DOUBLE, INTEGER


def fixed_step_threads(method: Fixed, start: Function, written: slice, inputs: int = 0) -> ThreadCode:
    """Loop of :class:`gauss.codegen.kernels.FixedStepBatchLoop`: (*POINTERS, inputs if there are some, count, budget).

    Thread k moves motion ``begin`` + k of the control, which all threads share.
    """
    pointers = len(FIXED_POINTERS) + bool(inputs)

    def arguments(code: ThreadCode, control, others):
        b, names = code.b, BatchSpan.names()
        own = b.alloca(DOUBLE, len(names))
        copy(b, own, control, len(names))
        at = lambda name: b.gep(own, [INTEGER(names.index(name))])  # noqa: E731
        begin = b.fadd(b.load(at("begin")), b.sitofp(code.thread, DOUBLE))
        b.store(begin, at("begin"))
        b.store(b.fadd(begin, DOUBLE(1.0)), at("end"))
        return [own, *others]

    return _threads(
        "fixed_step_threads",
        pointers,
        lambda writer: write_fixed_step_batch(writer, method, start, written, inputs, 1),
        arguments,
    )


def adaptive_threads(method: Adaptive, written: slice) -> ThreadCode:
    """Loop of :class:`gauss.codegen.kernels.AdaptiveBatchLoop`: (which, status, *POINTERS, count, budget).

    Thread k moves motion ``which[k]``, which has a row of its own in the arrays of controls and of lanes, so that it is
    continued after a pause by whatever thread; ``status[k]`` is that of its control then.
    """
    names = MotionQueue.names()

    def arguments(code: ThreadCode, which, others):
        b, (_, controls, lanes, *rest) = code.b, others
        motion = b.fptosi(b.load(b.gep(which, [code.thread])), INTEGER)
        row = lambda pointer, length: b.gep(pointer, [b.mul(motion, INTEGER(length))])  # noqa: E731
        return [row(controls, len(names)), row(lanes, method.size + len(MOTION_RECORD) + 1), *rest]

    def after(code: ThreadCode, given, others):
        b = code.b
        status = b.gep(given[0], [INTEGER(names.index("status"))])
        b.store(b.load(status), b.gep(others[0], [code.thread]))

    return _threads(
        "adaptive_threads",
        2 + len(ADAPTIVE_POINTERS),
        lambda writer: write_adaptive_batch(writer, method, written, 1),
        arguments,
        after,
    )


def _threads(
    name: str, pointers: int, write: Callable[[Writer], ir.Function], arguments: Callable, after: Callable | None = None
) -> ThreadCode:
    """Thread code (*pointers, count, budget) that calls a loop with arguments of the thread."""
    code = ThreadCode(name, [POINTER] * pointers + [INTEGER, INTEGER])
    loop, b = write(code.writer), code.b
    loop.linkage = "internal"
    *given, count, budget = code.arguments
    with b.if_then(b.icmp_signed("<", code.thread, count)):
        own = arguments(code, given[0], given[1:])
        b.call(loop, [*own, budget])
        if after is not None:
            after(code, own, given[1:])
    b.ret_void()
    return code
