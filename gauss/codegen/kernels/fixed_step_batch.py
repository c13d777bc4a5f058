"""Loop of a fixed-step integrator over a batch of motions, one per SIMD lane.

Points are a structure of arrays, one column per motion. A vector of motions makes all its steps before the next one
begins, so that it stays in the first-level cache; a motion does not depend on the others, nor on the number of threads.
"""

from llvmlite import ir

from gauss.codegen import INTEGER, Function, Writer, processor
from gauss.codegen.kernels.compiled_loop import BatchLoop
from gauss.codegen.kernels.energy_record import ENERGY_RECORD, ENERGY_SAMPLE, initial_energy_record
from gauss.codegen.kernels.fixed_step import Fixed
from gauss.codegen.kernels.loop_code import LoopCode
from gauss.codegen.kernels.loop_control import Numbers, numbers

OPTIONAL = 3  # numbers of a sample: the work
NAME, POINTERS = "fixed_step_batch", ("control", "points", "worst", "out")
WORST_RECORD = ("error", "constraint_residual", "unseen", "unsolved", *ENERGY_RECORD)  # record of a motion


@numbers
class BatchSpan(Numbers):
    """Range of motions and steps of one call.

    Parameters
    ----------
    columns : float
        Number of motions in the arrays.
    rows : float
        Number of samples of each motion.
    begin, end : float
        First motion, and the one after the last; multiples of the width.
    first, last : float
        Number of steps before and after the call. Before step 0 the rates of the points are computed.
    h : float
        Length of a step [s].
    keep, every, hold : float
        Steps between samples, between checks of the accelerations, and between changes of the inputs.
    motions, changes : float
        Number of motions with inputs, and of rows of inputs of each.
    row : float
        Numbers of a sample: all that may be written, or those without the optional ones.
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
    hold: float = 1.0
    motions: float = 0.0
    changes: float = 0.0
    row: float = 0.0


class FixedStepBatchLoop(BatchLoop):
    """Compiled loop, called with the arrays ``POINTERS``.

    Parameters
    ----------
    method : Fixed
        Functions of the method, compiled for SIMD vectors of motions.
    start : Function
        Initial point → (point with its rates, constraint residual, energy sample).
    written : slice
        Part of a point that is a sample; its last ``OPTIONAL`` entries are written on request.
    inputs : int
        Number of inputs, the last entries of a point: each motion has a row of them for every ``hold`` steps.
    width : int, optional
        Number of lanes; as many as the vector register holds when not given.
    """

    def __init__(self, method: Fixed, start: Function, written: slice, inputs: int = 0, width: int | None = None):
        self.size, self.evaluations, self.written, self.inputs = method.size, method.evaluations, written, inputs
        writer, width = Writer(), processor.width() if width is None else width
        write_fixed_step_batch(writer, method, start, written, inputs, width)
        super().__init__(writer, NAME, BatchSpan, len(POINTERS) - 1 + bool(inputs), width)

    def __call__(self, span: BatchSpan, points, worst, out, *inputs):
        """Make steps of a range of motions; releases Python's global lock.

        Parameters
        ----------
        points : ndarray, shape (size, columns)
            Points of the motions, changed; before step 0 their rates may be missing.
        worst : ndarray, shape (len(WORST_RECORD), columns)
            Largest error of the accelerations, largest constraint residual, steps that may have passed a condition of a law,
            unsolved equations (NaN propagates), and the energy record; changed.
        out : ndarray, shape (columns, rows, row)
            Sample k of each motion is that after ``k * keep`` steps.
        inputs : ndarray, shape (motions, changes, n_u)
            Inputs of each motion, of a loop that has some; those of the last one serve the columns beyond.
        """
        self._call(span, (points, worst, out, *inputs), 0)


def write_fixed_step_batch(
    writer: Writer, method: Fixed, start: Function, written: slice, inputs: int, width: int
) -> ir.Function:
    """Write the loop for a number of motions at a time: (*POINTERS, inputs if there are some, budget)."""
    code = LoopCode(writer, NAME, (*POINTERS, *(["inputs"] if inputs else [])), BatchSpan, width)
    b, size = code.b, method.size
    given, reached = code.buffer(size + 1), code.buffer(max(len(method.step.outputs), len(start.outputs)))
    error, worst = code.buffer(len(method.check.outputs)), code.buffer(len(WORST_RECORD))
    columns, end, last = (code.index(name) for name in ("columns", "end", "last"))
    motion = code.counter(code.index("begin"))
    with code.loop() as leave_if:
        column = b.load(motion)
        leave_if(b.icmp_signed(">=", column, end))
        points, worsts = (b.gep(code.pointer[name], [column]) for name in ("points", "worst"))
        _gather(code, given, points, columns, size)
        _gather(code, worst, worsts, columns, len(WORST_RECORD))
        with b.if_then(b.icmp_signed("==", code.index("first"), INTEGER(0))):
            code.call(start, given, reached)
            code.copy(given, reached, size)
            _raise(code, worst, 1, code.take(reached, size))
            _keep(code, worst, initial_energy_record([code.take(reached, size + 1 + k) for k in range(ENERGY_SAMPLE)]))
        code.put(code.lanes.broadcast(code.get("h")), given, size)
        step = code.counter(code.index("first"))
        with code.loop() as leave_if:
            done = b.load(step)
            leave_if(b.icmp_signed(">=", done, last))
            if inputs:
                _take_inputs(code, code.at(given, size - inputs), inputs, column, b.sdiv(done, code.index("hold")))
            done = b.add(done, INTEGER(1))
            b.store(done, step)
            code.call(method.step, given, reached)
            t = b.fmul(b.sitofp(done, code.kind), code.get("h"))
            code.put(code.lanes.broadcast(t), reached, 0)
            code.copy(given, reached, size)
            _raise(code, worst, 1, code.take(reached, size))
            _raise(code, worst, 2, code.take(reached, size + 4))
            _raise(code, worst, 3, code.take(reached, size + 3))
            due = b.or_(code.is_multiple(done, "every"), b.icmp_signed("==", done, last))
            with b.if_then(due):
                code.call(method.check, reached, error)
                _raise(code, worst, 0, code.take(error, 0))
                record = [code.take(worst, WORST_RECORD.index(name)) for name in ENERGY_RECORD]
                _keep(code, worst, code.energies_after(record, reached, error))
            with b.if_then(code.is_multiple(done, "keep")):
                _write_rows(code, reached, written, column, b.sdiv(done, code.index("keep")))
        _scatter(code, points, given, columns, size)
        _scatter(code, worsts, worst, columns, len(WORST_RECORD))
        b.store(b.add(column, INTEGER(code.width)), motion)
    code.finish()
    return code.function


def _take_inputs(code: LoopCode, room, count: int, column, row):
    """Load a row of inputs of each motion to a buffer."""
    b, last = code.b, code.b.sub(code.index("motions"), INTEGER(1))
    with code.each(code.width) as k:
        motion = b.add(column, k)
        motion = b.select(b.icmp_signed("<", motion, last), motion, last)
        place = b.mul(b.add(b.mul(motion, code.index("changes")), row), INTEGER(count))
        source, target = b.gep(code.pointer["inputs"], [place]), b.gep(room, [k])
        for j in range(count):
            b.store(b.load(b.gep(source, [INTEGER(j)])), code.at(target, j))


def _gather(code: LoopCode, room, source, columns, size: int):
    """Load the columns of all lanes to a buffer."""
    for k in range(size):
        code.put(code.lanes.load(source, code.b.mul(columns, INTEGER(k))), room, k)


def _scatter(code: LoopCode, target, room, columns, size: int):
    """Store a buffer to the columns of all lanes."""
    for k in range(size):
        code.lanes.store(code.take(room, k), target, code.b.mul(columns, INTEGER(k)))


def _write_rows(code: LoopCode, room, written: slice, column, row):
    """Write a sample of each motion."""
    b, size = code.b, written.stop - written.start
    with b.if_else(b.icmp_signed("==", code.index("row"), INTEGER(size))) as (all_of_it, without_optional):
        for branch, count in ((all_of_it, size), (without_optional, size - OPTIONAL)):
            with branch, code.each(code.width) as k:
                place = b.add(b.mul(b.add(column, k), code.index("rows")), row)
                target = b.gep(code.pointer["out"], [b.mul(place, INTEGER(count))])
                source = b.gep(code.at(room, written.start), [k])
                for j in range(count):
                    b.store(b.load(code.at(source, j)), b.gep(target, [INTEGER(j)]))


def _raise(code: LoopCode, room, k: int, value):
    """Raise an entry to a larger value; NaN propagates."""
    code.put(code.larger(code.take(room, k), value), room, k)


def _keep(code: LoopCode, room, record):
    """Store an energy record."""
    for name, value in zip(ENERGY_RECORD, record, strict=True):
        code.put(code.lanes.constant(value) if isinstance(value, float) else value, room, WORST_RECORD.index(name))
