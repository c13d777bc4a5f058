"""Loop of a fixed-step integrator: from one time of a grid to the next.

A sample between two grid times (off-grid sample) is the result of a shorter step that the motion does not continue from: so
samples do not change the motion, and have the order of the method.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import reduce

from gauss.codegen import INTEGER, Function, NativeFunction, Writer
from gauss.codegen.kernels.compiled_loop import POINTERS, Loop
from gauss.codegen.kernels.loop_code import LoopCode
from gauss.codegen.kernels.loop_control import LoopStatus

MOST_PROJECTIONS = 8  # projections after a step


class Due(IntEnum):
    """Action at a time of the grid."""

    STEP = 0  # step
    SAMPLE = 1  # step and write a sample
    OFF_GRID_SAMPLE = 2  # write the sample of a step, but continue from the point before
    UNCHECKED = 3  # step, without a check where the call ends but that it is finite


@dataclass(frozen=True)
class Notes:
    """Steps that are noted, as (t, codes, results), where codes of the point change.

    Parameters
    ----------
    codes : slice
        Their place in a point.
    results : int
        Number of further results of the step, its last ones.
    """

    codes: slice
    results: int

    @property
    def size(self) -> int:
        """Numbers of a note."""
        return 1 + self.codes.stop - self.codes.start + self.results


@dataclass(frozen=True)
class Fixed:
    """Functions of a method on points (t, …) of ``size`` numbers; the first ``row`` of them are sampled.

    The grid holds pairs: a time, and its :class:`Due`.

    Parameters
    ----------
    size, row : int
        Length of a point, and of a sample.
    step : Function or NativeFunction
        (point, h) → (point after, constraint residual, evaluations, factorisations, unsolved equations, switching surfaces
        passed undetected).
    project : Function or None
        Point → (projected point, constraint residual), one Newton step by one evaluation; None without projection.
    check : Function or NativeFunction
        Point → (error of its accelerations, residual of the loop constraints, energy sample).
    evaluations : int
        Approximate number of evaluations in a step.
    rates : Function or NativeFunction
        Equations of motion: (t, q, v) → rates.
    notes : Notes or None
        Steps that are noted, behind the samples in ``out``: where ``notes_at`` of the control says.
    """

    size: int
    row: int
    step: Function | NativeFunction
    project: Function | None
    check: Function | NativeFunction
    evaluations: int
    rates: Function | NativeFunction
    notes: Notes | None = None

    def compile(self) -> Loop:
        """Machine code of the loop; its budget is the number of pairs in the grid."""
        writer = Writer()
        _write(LoopCode(writer, "fixed", POINTERS), self)
        return Loop(writer, "fixed", (self.rates, self.check))


def _write(code: LoopCode, method: Fixed):
    b, size, results = code.b, method.size, 0 if method.notes is None else method.notes.results
    point, grid = code.pointer["point"], code.pointer["grid"]
    reached, error, place = code.buffer(size + 5 + results), code.buffer(len(method.check.outputs)), code.counter(INTEGER(0))
    with code.loop() as leave_if:
        code.set("status", LoopStatus.DONE)
        i = b.load(place)
        leave_if(b.icmp_signed(">=", i, code.budget))
        pair = b.gep(grid, [b.mul(i, INTEGER(2))])
        t = b.load(pair)
        code.call(method.step, code.join((point, size), b.fsub(t, b.load(point))), reached)
        b.store(t, reached)
        code.add("evaluations", b.load(code.at(reached, size + 1)))
        code.add("factorisations", b.load(code.at(reached, size + 2)))
        code.add("unseen", b.load(code.at(reached, size + 4)))
        code.set("status", LoopStatus.UNSOLVED)
        leave_if(b.fcmp_unordered(">", b.load(code.at(reached, size + 3)), code.number(0.0)))
        if method.project is not None:
            _project(code, method, method.project, reached)
        code.set("status", LoopStatus.OFF_CONSTRAINTS)
        leave_if(b.fcmp_unordered(">", b.load(code.at(reached, size)), code.get("constraint_tolerance")))
        i = b.add(i, INTEGER(1))
        kind = b.load(code.at(pair, 1))
        goes_on = b.fcmp_ordered("!=", kind, code.number(Due.OFF_GRID_SAMPLE))
        is_end, unchecked = b.icmp_signed("==", i, code.budget), b.fcmp_ordered("==", kind, code.number(Due.UNCHECKED))
        due = b.and_(goes_on, b.or_(b.and_(is_end, b.not_(unchecked)), code.is_multiple("steps", "every")))
        b.store(code.number(0.0), error)
        with b.if_then(b.and_(is_end, unchecked)), code.each(method.row) as k:
            none = b.fmul(b.load(b.gep(reached, [k])), code.number(0.0))  # NaN if an entry is not finite
            b.store(b.fadd(b.load(error), none), error)
        code.set("status", LoopStatus.NOT_FINITE)
        leave_if(b.fcmp_unordered("!=", b.load(error), code.number(0.0)))
        with b.if_then(due):
            code.check(method.check, reached, error)
        code.set("status", LoopStatus.UNCONFIRMED)
        leave_if(b.fcmp_unordered(">", b.load(error), code.get("acceleration_tolerance")))
        is_sample = b.or_(*(b.fcmp_ordered("==", kind, code.number(due)) for due in (Due.SAMPLE, Due.OFF_GRID_SAMPLE)))
        with b.if_then(is_sample):
            code.copy(code.row(method.row), reached, method.row)
            code.add("rows")
        if method.notes is not None:
            _note(code, method.notes, size, reached, kind)
        with b.if_then(goes_on):
            code.add("steps")
            code.copy(point, reached, size)
        with b.if_then(due):
            code.copy(code.pointer["confirmed"], point, size)
        code.add("sample")
        b.store(i, place)
    code.finish()


def _note(code: LoopCode, notes: Notes, size: int, reached, kind):
    """Note a step that changes codes, unless it is a sample beside the grid, or a step of a caller without room."""
    b, codes = code.b, notes.codes
    differs = [
        b.fcmp_unordered("!=", b.load(code.at(reached, k)), b.load(code.at(code.pointer["point"], k)))
        for k in range(codes.start, codes.stop)
    ]
    noted = b.fcmp_ordered("<", kind, code.number(Due.OFF_GRID_SAMPLE))
    with b.if_then(b.and_(noted, reduce(b.or_, differs))):
        place = b.add(code.index("notes_at"), b.mul(code.index("notes"), INTEGER(notes.size)))
        note, count = b.gep(code.pointer["out"], [place]), codes.stop - codes.start
        b.store(b.load(reached), note)
        code.copy(code.at(note, 1), code.at(reached, codes.start), count)
        code.copy(code.at(note, 1 + count), code.at(reached, size + 5), notes.results)
        code.add("notes")


def _project(code: LoopCode, method: Fixed, project: Function, reached):
    """Project a point until the residual is within tolerance, or the iteration limit is reached."""
    b, size, projected, tries = code.b, method.size, code.buffer(method.size + 1), code.counter(INTEGER(0))
    with code.loop() as leave_if:
        is_projected = b.fcmp_ordered("<=", b.load(code.at(reached, size)), code.get("constraint_tolerance"))
        leave_if(b.or_(is_projected, b.icmp_signed(">=", b.load(tries), INTEGER(MOST_PROJECTIONS))))
        code.call(project, reached, projected)
        code.copy(reached, projected, size + 1)
        code.add("evaluations")
        b.store(b.add(b.load(tries), INTEGER(1)), tries)
