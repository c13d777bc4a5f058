"""The loop of an integrator of fixed step over many motions, a vector register of motions at a time.

Points are a structure of arrays: one column for each motion. A motion goes through all its steps before the next one begins,
so that it stays in the nearest cache, and does not depend on the others, nor on who steps them.
"""

import ctypes

import numpy as np

from gauss.codegen import INTEGER, Function, Writer, intrinsic, machine
from gauss.codegen.kernels.energy_record import ENERGIES, LOOK, opened
from gauss.codegen.kernels.fixed_step import Fixed
from gauss.codegen.kernels.loop_code import Code
from gauss.codegen.kernels.loop_control import Numbers, numbers

POINTERS = ("control", "points", "worst", "out")
WORST = ("error", "gap", "unseen", *ENERGIES)  # of a motion


@numbers
class Span(Numbers):
    """Which motions a call of the loop is about, and which steps.

    Parameters
    ----------
    columns : float
        Number of motions that the arrays have room for.
    rows : float
        Number of rows of each motion.
    begin, end : float
        First motion, and the one after the last; multiples of the width.
    first, last : float
        Steps made before, and after. Before the first one, motions are given their rates.
    h : float
        Length of a step [s].
    keep, every : float
        Every so many steps a row is written, and the accelerations are checked.
    """

    columns: float
    rows: float
    begin: float
    end: float
    first: float = 0.0
    last: float = 0.0
    h: float = 0.0
    keep: float = 1.0
    every: float = 1.0


class FixedStepBatchLoop:
    """Compiled loop of the arrays ``POINTERS``.

    Parameters
    ----------
    method : Fixed
        What a step is; its functions are compiled for vectors of motions.
    start : Function
        Point → (the same point with its rates, gap, a look at its energies), for the first point of each motion.
    written : slice
        Part of a point that a row is.

    Attributes
    ----------
    width : int
        Number of motions at a time; arrays have columns for a multiple of it.
    """

    def __init__(self, method: Fixed, start: Function, written: slice):
        self.method, self.written, self.width = method, written, machine.width()
        writer = Writer()
        _write(Code(writer, "many", POINTERS, Span, self.width), method, start, written)
        self.code = machine.load(str(writer.module))
        pointer = np.ctypeslib.ndpointer(float, flags=("C_CONTIGUOUS", "WRITEABLE"))
        pointers = [ctypes.POINTER(Span), *[pointer] * len(POINTERS[1:])]
        self._function = ctypes.CFUNCTYPE(None, *pointers, ctypes.c_int64)(self.code.address("many"))

    def __call__(self, span: Span, points, worst, out):
        """Make these steps of these motions, without Python's global lock.

        Parameters
        ----------
        span : Span
            Which.
        points : ndarray, shape (size, columns)
            Where the motions are; changed. Before the first step it needs no rates.
        worst : ndarray, shape (len(WORST), columns)
            Largest error of the accelerations and largest gap so far, which are no numbers once one was none, and the record
            of the energies; changed.
        out : ndarray, shape (columns, rows, row)
            Row k of each motion is that after ``k * keep`` steps.
        """
        self._function(span, points, worst, out, 0)


def _write(code: Code, method: Fixed, start: Function, written: slice):
    b, size = code.b, method.size
    given, reached = code.buffer(size + 1), code.buffer(max(len(method.step.outputs), len(start.outputs)))
    error, worst = code.buffer(len(method.check.outputs)), code.buffer(len(WORST))
    columns, end, last = (code.index(name) for name in ("columns", "end", "last"))
    motion = code.counter(code.index("begin"))
    with code.loop() as leave_if:
        column = b.load(motion)
        leave_if(b.icmp_signed(">=", column, end))
        points, worsts = (b.gep(code.pointer[name], [column]) for name in ("points", "worst"))
        _gather(code, given, points, columns, size)
        _gather(code, worst, worsts, columns, len(WORST))
        with b.if_then(b.icmp_signed("==", code.index("first"), INTEGER(0))):
            code.call(start, given, reached)
            code.copy(given, reached, size)
            _raise(code, worst, 1, code.take(reached, size))
            _keep(code, worst, opened([code.take(reached, size + 1 + k) for k in range(LOOK)]))
        code.put(code.lanes.spread(code.get("h")), given, size)
        step = code.counter(code.index("first"))
        with code.loop() as leave_if:
            done = b.load(step)
            leave_if(b.icmp_signed(">=", done, last))
            done = b.add(done, INTEGER(1))
            b.store(done, step)
            code.call(method.step, given, reached)
            t = b.fmul(b.sitofp(done, code.kind), code.get("h"))
            code.put(code.lanes.spread(t), reached, 0)
            code.copy(given, reached, size)
            _raise(code, worst, 1, code.take(reached, size))
            _raise(code, worst, 2, code.take(reached, size + 4))
            due = b.or_(_is_multiple(code, done, "every"), b.icmp_signed("==", done, last))
            with b.if_then(due):
                code.call(method.check, reached, error)
                _raise(code, worst, 0, code.take(error, 0))
                record = [code.take(worst, WORST.index(name)) for name in ENERGIES]
                _keep(code, worst, code.looked(record, reached, error))
            with b.if_then(_is_multiple(code, done, "keep")):
                _write_rows(code, reached, written, column, b.sdiv(done, code.index("keep")))
        _scatter(code, points, given, columns, size)
        _scatter(code, worsts, worst, columns, len(WORST))
        b.store(b.add(column, INTEGER(code.width)), motion)
    code.finish()


def _gather(code: Code, room, source, columns, size: int):
    """Read a column of numbers for each lane into a buffer."""
    for k in range(size):
        code.put(code.lanes.load(source, code.b.mul(columns, INTEGER(k))), room, k)


def _scatter(code: Code, target, room, columns, size: int):
    """Write a buffer to columns."""
    for k in range(size):
        code.lanes.store(code.take(room, k), target, code.b.mul(columns, INTEGER(k)))


def _write_rows(code: Code, room, written: slice, column, row):
    """Write a row of each motion in a buffer."""
    b, size = code.b, written.stop - written.start
    with code.each(code.width) as k:
        place = b.add(b.mul(b.add(column, k), code.index("rows")), row)
        target = b.gep(code.pointer["out"], [b.mul(place, INTEGER(size))])
        source = b.gep(code.at(room, written.start), [k])
        for j in range(size):
            b.store(b.load(code.at(source, j)), b.gep(target, [INTEGER(j)]))


def _raise(code: Code, room, k: int, value):
    """Raise an entry to a value, if that is more or no number."""
    larger = intrinsic(code.writer.module, "llvm.maximum", code.lanes.kind, 2)
    code.put(code.b.call(larger, [code.take(room, k), value]), room, k)


def _keep(code: Code, room, record):
    """Write a record of the energies."""
    for name, value in zip(ENERGIES, record, strict=True):
        code.put(code.lanes.constant(value) if isinstance(value, float) else value, room, WORST.index(name))


def _is_multiple(code: Code, count, of: str):
    return code.b.icmp_signed("==", code.b.srem(count, code.index(of)), INTEGER(0))
