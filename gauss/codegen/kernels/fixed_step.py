"""The loop of an integrator of fixed step: from one given time to the next.

A sample between two steps is reached by a shorter step aside, from which the motion does not go on: samples do not
change a motion, and are of the order of the method.
"""

from dataclasses import dataclass
from enum import IntEnum

from gauss.codegen import INTEGER, Function, Writer
from gauss.codegen.kernels.compiled_loop import POINTERS, Loop
from gauss.codegen.kernels.loop_code import Code
from gauss.codegen.kernels.loop_control import Status

MOST = 8  # times that a step which leads far off the constraints is settled again


class Due(IntEnum):
    """What is done at a time of the grid."""

    STEP = 0  # go there
    KEPT = 1  # go there and write a row
    ASIDE = 2  # write the row of a step there, but do not go on from it


@dataclass(frozen=True)
class Fixed:
    """Functions of a method on points (t, …) of ``size`` numbers, of which the first ``row`` are written out.

    The grid holds pairs: time to step to, and what is :class:`Due` there.

    Parameters
    ----------
    size, row : int
        Numbers of a point, and of a row.
    step : Function
        (point, h) → (point after, gap, evaluations, factorisations, what is unsolved, switching surfaces passed unseen).
    settle : Function or None
        Point → (point nearer to the constraints, gap that is left), by one evaluation; None where steps do not end off them.
    check : Function
        Point → (error of its accelerations, what closing rows lack under them, a look at its energies).
    evaluations : int
        Evaluations of the accelerations in a step, or about as many.
    rates : Function
        What is evaluated: (t, q, v) → what drives the motion on.
    """

    size: int
    row: int
    step: Function
    settle: Function | None
    check: Function
    evaluations: int
    rates: Function

    def compile(self) -> Loop:
        """Machine code of the loop; its budget is the number of pairs in the grid."""
        writer = Writer()
        _write(Code(writer, "fixed", POINTERS), self)
        return Loop(writer, "fixed", (self.rates, self.check))


def _write(code: Code, method: Fixed):
    b, size = code.b, method.size
    point, grid = code.pointer["point"], code.pointer["grid"]
    reached, error, place = code.buffer(size + 5), code.buffer(len(method.check.outputs)), code.counter(INTEGER(0))
    with code.loop() as leave_if:
        code.set("status", Status.DONE)
        i = b.load(place)
        leave_if(b.icmp_signed(">=", i, code.budget))
        pair = b.gep(grid, [b.mul(i, INTEGER(2))])
        t = b.load(pair)
        code.call(method.step, code.join((point, size), b.fsub(t, b.load(point))), reached)
        b.store(t, reached)
        code.add("evaluations", b.load(code.at(reached, size + 1)))
        code.add("factorisations", b.load(code.at(reached, size + 2)))
        code.add("unseen", b.load(code.at(reached, size + 4)))
        code.set("status", Status.UNSOLVED)
        leave_if(b.fcmp_unordered(">", b.load(code.at(reached, size + 3)), code.number(0.0)))
        if method.settle is not None:
            _settle(code, method, reached)
        code.set("status", Status.OFF)
        leave_if(b.fcmp_unordered(">", b.load(code.at(reached, size)), code.get("closed")))
        i = b.add(i, INTEGER(1))
        kind = b.load(code.at(pair, 1))
        goes_on = b.fcmp_ordered("!=", kind, code.number(Due.ASIDE))
        due = b.and_(goes_on, b.or_(b.icmp_signed("==", i, code.budget), code.is_multiple("steps", "every")))
        b.store(code.number(0.0), error)
        with b.if_then(due):
            code.check(method.check, reached, error)
        code.set("status", Status.DISTRUSTED)
        leave_if(b.fcmp_unordered(">", b.load(error), code.get("trust")))
        with b.if_then(b.fcmp_ordered("!=", kind, code.number(Due.STEP))):
            code.copy(code.row(method.row), reached, method.row)
            code.add("rows")
        with b.if_then(goes_on):
            code.add("steps")
            code.copy(point, reached, size)
        with b.if_then(due):
            code.copy(code.pointer["confirmed"], point, size)
        code.add("sample")
        b.store(i, place)
    code.finish()


def _settle(code: Code, method: Fixed, reached):
    """Bring a point nearer to the constraints until no gap is left; that does not converge everywhere."""
    b, size, settled, tries = code.b, method.size, code.buffer(method.size + 1), code.counter(INTEGER(0))
    with code.loop() as leave_if:
        closed = b.fcmp_ordered("<=", b.load(code.at(reached, size)), code.get("closed"))
        leave_if(b.or_(closed, b.icmp_signed(">=", b.load(tries), INTEGER(MOST))))
        code.call(method.settle, reached, settled)
        code.copy(reached, settled, size + 1)
        code.add("evaluations")
        b.store(b.add(b.load(tries), INTEGER(1)), tries)
