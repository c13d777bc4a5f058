"""The loop of an integrator of fixed step: from one given time to the next."""

from dataclasses import dataclass

from gauss.kernels.code import Code
from gauss.kernels.control import Status
from gauss.kernels.loop import POINTERS, Loop
from gauss.tracing import INTEGER, Function, Writer


@dataclass(frozen=True)
class Fixed:
    """Functions of a method on points (t, …) of ``size`` numbers, of which the first ``row`` are written out.

    The grid holds pairs: time to step to, and 1 if a row is to be written there, else 0.

    Parameters
    ----------
    size, row : int
        Numbers of a point, and of a row.
    step : Function
        (point, h) → (point after, gap).
    check : Function
        Point → error of its accelerations.
    evaluations : int
        Evaluations of the accelerations in a step.
    """

    size: int
    row: int
    step: Function
    check: Function
    evaluations: int

    def compile(self) -> Loop:
        """Machine code of the loop; its budget is the number of pairs in the grid."""
        writer = Writer()
        _write(Code(writer, "fixed", POINTERS), self)
        return Loop(writer, "fixed")


def _write(code: Code, method: Fixed):
    b, size = code.b, method.size
    point, grid = code.pointer["point"], code.pointer["grid"]
    reached, error, place = code.buffer(size + 1), code.buffer(1), code.counter(INTEGER(0))
    with code.loop() as leave_if:
        code.set("status", Status.DONE)
        i = b.load(place)
        leave_if(b.icmp_signed(">=", i, code.budget))
        pair = b.gep(grid, [b.mul(i, INTEGER(2))])
        t = b.load(pair)
        code.call(method.step, code.join((point, size), b.fsub(t, b.load(point))), reached)
        b.store(t, reached)
        code.add("steps")
        code.add("evaluations", method.evaluations)
        code.set("status", Status.OFF)
        leave_if(b.fcmp_unordered(">", b.load(code.at(reached, size)), code.get("closed")))
        i = b.add(i, INTEGER(1))
        due = b.or_(b.icmp_signed("==", i, code.budget), code.is_multiple("steps", "every"))
        b.store(code.number(0.0), error)
        with b.if_then(due):
            code.check(method.check, reached, error)
        code.set("status", Status.DISTRUSTED)
        leave_if(b.fcmp_unordered(">", b.load(error), code.get("trust")))
        with b.if_then(b.fcmp_ordered("!=", b.load(code.at(pair, 1)), code.number(0.0))):
            code.copy(code.row(method.row), reached, method.row)
            code.add("rows")
        code.copy(point, reached, size)
        with b.if_then(due):
            code.copy(code.pointer["confirmed"], reached, size)
        b.store(i, place)
    code.finish()
