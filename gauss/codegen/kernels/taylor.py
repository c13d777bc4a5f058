"""The loop of a Taylor method: expand the motion, see how far that reaches, go there, settle, check, sample, go on."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import FLAGS, HIGHEST, INTEGER, LEAD, ROW, Function, Series, Writer
from gauss.codegen.kernels.adaptive import Stepping
from gauss.codegen.kernels.compiled_loop import POINTERS, Loop
from gauss.codegen.kernels.loop_code import Code

LEAST = 2  # order that tells a step: the first is a rate, which may be as large as it likes
JUMP = 8.0  # of a step over the last one: all terms are asked, for the last ones may be missing


@dataclass(frozen=True)
class TaylorStep:
    """Functions of a Taylor method on points (t, …) of ``size`` numbers, of which the first ``row`` are written out.

    Parameters
    ----------
    size, row : int
        Numbers of a point, and of a row: t, then what is expanded.
    series : Series
        What the motion is expanded by.
    reach : Function
        (point, rtol, atol, atol_rates, order, orders of terms, their coefficients) → longest step; not a number if there is
        none.
    watched : int
        So many terms are asked.
    finish : Function
        (point, h, change of what is expanded) → point after, with the rates of the point before.
    renew : Function
        Point → the same with its own rates, by one evaluation: they are needed where they are checked.
    defect : Function or None
        (point, the one before, accelerations of the series there, h, rtol, atol, atol_rates) → what they are off by, over
        what is allowed, infinite where a law may have acted between; None where no law may do what its series does not tell.
    rates_at : int
        Place of the first rate among what is expanded.
    settle : Function or None
        Point → (point on the constraints, gap), by one evaluation; None where nothing is to be settled.
    check : Function
        Point → (error of its accelerations, what closing rows lack under them, a look at its energies).
    sample : Function
        (point before, h, change) → row.
    rates : Function
        What is evaluated: (t, q, v) → what drives the motion on.
    """

    size: int
    row: int
    series: Series
    reach: Function
    watched: int
    finish: Function
    renew: Function
    defect: Function | None
    rates_at: int
    settle: Function | None
    check: Function
    sample: Function
    rates: Function

    def compile(self, start: Function) -> Loop:
        """Machine code of the loop, and of a function that is called by name before it."""
        writer = Writer()
        _Expanding(self, Code(writer, "expanded", POINTERS), self.size).write()
        return Loop(writer, "expanded", (self.rates, self.check, start))


class _Expanding(Stepping):
    """The loop while it is written."""

    def __init__(self, method: TaylorStep, code: Code, tried: int):
        super().__init__(method, code, tried)
        self.n = method.row - 1
        self.coefficients = code.buffer(len(method.series.outputs), aligned=True)
        self.last = code.buffer(1)
        self.b.store(code.number(0.0), self.last)

    def _length(self):
        code, b, row = self.code, self.b, self.method.row
        order = code.get("order")
        code.call(self.method.series, code.join((self.point, row), order), self.coefficients)
        code.add("evaluations", order)
        top, reach = code.index("order"), code.buffer(1)
        b.store(self._reach(top, b.sdiv(b.add(top, INTEGER(1)), INTEGER(2))), reach)
        usual = b.fmul(b.load(self.last), code.number(JUMP))
        with b.if_then(b.fcmp_ordered(">", b.load(reach), usual)):
            for after in range(0, HIGHEST, self.method.watched):
                found, shortest = self._reach(b.sub(top, INTEGER(after)), INTEGER(LEAST)), b.load(reach)
                b.store(b.select(b.fcmp_ordered("<", found, shortest), found, shortest), reach)
        reach, allowed = b.load(reach), code.get("h")
        reach = b.select(b.fcmp_ordered(">", reach, code.number(0.0)), reach, code.number(0.0))
        b.store(reach, self.last)
        return b.select(b.fcmp_ordered("<", allowed, reach), allowed, reach)

    def _reach(self, first, least):
        """Longest step by terms from an order down, but none below another."""
        code, b, watched = self.code, self.b, self.method.watched
        settings = [code.get(name) for name in ("rtol", "atol", "atol_rates", "order")]
        given = code.join((self.point, self.method.size), *settings, *[0.0] * watched * (1 + self.n))
        place = self.method.size + len(settings)
        for back in range(watched):
            k = b.sub(first, INTEGER(back))
            k = b.select(b.icmp_signed(">", k, least), k, least)
            b.store(b.sitofp(k, code.kind), code.at(given, place + back))
            for i in range(self.n):
                b.store(self._coefficient(i, k), code.at(given, place + watched + back * self.n + i))
        found = code.buffer(1)
        code.call(self.method.reach, given, found)
        return b.load(found)

    def _try(self, h, last):
        code, b = self.code, self.b
        code.call(self.method.finish, self._moved(h), self.tried)
        code.set("h", np.inf)
        if self.method.defect is None:
            return b.fcmp_ordered("==", h, h)
        off = self._defect(h)
        kept = b.fcmp_ordered("<=", off, code.number(1.0))
        code.set("h", b.select(kept, code.number(np.inf), b.fmul(h, code.number(0.5))))
        return kept

    def _defect(self, h):
        """What the accelerations of the series are off by after a step, over what is allowed."""
        code, b, method = self.code, self.b, self.method
        renewed = code.buffer(method.size)
        code.call(method.renew, self.tried, renewed)
        code.copy(self.tried, renewed, method.size)
        code.add("evaluations")
        slopes = range(method.rates_at, len(method.defect.inputs) - 2 * method.size - 4 + method.rates_at)
        settings = [code.get(name) for name in ("rtol", "atol", "atol_rates")]
        points = (self.tried, method.size), (self.point, method.size)
        given, found = code.join(*points, *[0.0] * len(slopes), h, *settings), code.buffer(1)
        k = code.counter(code.index("order"))
        with code.loop() as leave_if:
            leave_if(b.icmp_signed("<", b.load(k), INTEGER(1)))
            order = b.sitofp(b.load(k), code.kind)
            for place, i in enumerate(slopes):
                total = code.at(given, 2 * method.size + place)
                term = b.fmul(order, self._coefficient(i, b.load(k)))
                b.store(b.fadd(b.fmul(b.load(total), h, flags=FLAGS), term, flags=FLAGS), total)
            b.store(b.sub(b.load(k), INTEGER(1)), k)
        code.call(method.defect, given, found)
        return b.load(found)

    def _check(self, error):
        if self.method.settle is None:
            renewed = self.code.buffer(self.method.size)
            self.code.call(self.method.renew, self.settled, renewed)
            self.code.copy(self.settled, renewed, self.method.size)
            self.code.add("evaluations")
        super()._check(error)

    def _inside(self, h):
        code, method = self.code, self.method
        return lambda t: code.call(method.sample, self._moved(self.b.fsub(t, self.b.load(self.point))), code.row(method.row))

    def _moved(self, h):
        """Point, a time that has passed, and the change in it by Horner's scheme."""
        code, b, size = self.code, self.b, self.method.size
        given = code.join((self.point, size), h, *[0.0] * self.n)
        sums = [code.at(given, size + 1 + i) for i in range(self.n)]
        k = code.counter(code.index("order"))
        with code.loop() as leave_if:
            leave_if(b.icmp_signed("<", b.load(k), INTEGER(1)))
            for i, total in enumerate(sums):
                further = b.fmul(b.load(total), h, flags=FLAGS)
                b.store(b.fadd(further, self._coefficient(i, b.load(k)), flags=FLAGS), total)
            b.store(b.sub(b.load(k), INTEGER(1)), k)
        for total in sums:
            b.store(b.fmul(b.load(total), h), total)
        return given

    def _coefficient(self, i: int, k):
        """Coefficient of order k of a number that is expanded."""
        return self.b.load(self.b.gep(self.coefficients, [self.b.add(k, INTEGER(ROW * i + LEAD))]))
