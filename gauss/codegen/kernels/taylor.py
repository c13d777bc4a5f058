"""Loop of a Taylor method: series expansion, step length from its last terms, step, projection, check, samples."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import FLAGS, HIGHEST_ORDER, INTEGER, LEAD, ROW, Function, NativeFunction, Series, Writer
from gauss.codegen.kernels.adaptive import AdaptiveWriter
from gauss.codegen.kernels.compiled_loop import POINTERS, Loop
from gauss.codegen.kernels.loop_code import LoopCode

LOWEST_ORDER = 2  # lowest order of a term that limits the step: the first is a rate, and not bounded
STEP_GROWTH = 8.0  # ratio of a step to the last one above which all terms limit it: the last ones may vanish


@dataclass(frozen=True)
class TaylorStep:
    """Functions of a Taylor method on points (t, …) of ``size`` numbers; the first ``row`` of them are sampled.

    Parameters
    ----------
    size, row : int
        Length of a point, and of a sample: t, then the expanded quantities.
    series : Series
        Series of the motion.
    reach : Function
        (point, rtol, atol, atol_rates, order, orders of terms, their coefficients) → longest step; NaN if there is none.
    watched : int
        Number of terms in ``reach``.
    finish : Function
        (point, h, change of the expanded quantities) → point after, with the rates of the point before.
    renew : Function
        Point → the same point with its own rates, by one evaluation; for the check.
    defect : Function or None
        (point, point before, accelerations of the series, h, rtol, atol, atol_rates) → their error relative to the
        tolerance, infinite where a law may have switched in between; None if no law can leave its series.
    rates_at : int
        Index of the first rate among the expanded quantities.
    project : Function or None
        Point → (projected point, constraint residual), with one evaluation; None without projection.
    check : Function or NativeFunction
        Point → (error of its accelerations, residual of the loop constraints, energy sample).
    sample : Function
        (point before, h, change) → row.
    rates : Function or NativeFunction
        Equations of motion: (t, q, v) → rates.
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
    project: Function | None
    check: Function | NativeFunction
    sample: Function
    rates: Function | NativeFunction

    def compile(self, start: Function | NativeFunction) -> Loop:
        """Machine code of the loop, and of ``start``, which is called by name."""
        writer = Writer()
        _TaylorWriter(self, LoopCode(writer, "taylor", POINTERS), self.size).write()
        return Loop(writer, "taylor", (self.rates, self.check, start))


class _TaylorWriter(AdaptiveWriter):
    """Emitter of the loop."""

    def __init__(self, method: TaylorStep, code: LoopCode, tried: int):
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
        usual = b.fmul(b.load(self.last), code.number(STEP_GROWTH))
        with b.if_then(b.fcmp_ordered(">", b.load(reach), usual)):
            for after in range(0, HIGHEST_ORDER, self.method.watched):
                found, shortest = self._reach(b.sub(top, INTEGER(after)), INTEGER(LOWEST_ORDER)), b.load(reach)
                b.store(b.select(b.fcmp_ordered("<", found, shortest), found, shortest), reach)
        reach, allowed = b.load(reach), code.get("h")
        reach = b.select(b.fcmp_ordered(">", reach, code.number(0.0)), reach, code.number(0.0))
        b.store(reach, self.last)
        return b.select(b.fcmp_ordered("<", allowed, reach), allowed, reach)

    def _reach(self, first, least):
        """Longest step by the terms from order ``first`` down to ``least``."""
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
        """Error of the accelerations of the series after a step, relative to the tolerance."""
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
        if self.method.project is None:
            renewed = self.code.buffer(self.method.size)
            self.code.call(self.method.renew, self.projected, renewed)
            self.code.copy(self.projected, renewed, self.method.size)
            self.code.add("evaluations")
        super()._check(error)

    def _inside(self, h):
        code, method = self.code, self.method
        return lambda t: code.call(method.sample, self._moved(self.b.fsub(t, self.b.load(self.point))), code.row(method.row))

    def _moved(self, h):
        """Buffer of the point, a time h, and the change during h by Horner's scheme."""
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
        """Coefficient of order k of an expanded quantity."""
        return self.b.load(self.b.gep(self.coefficients, [self.b.add(k, INTEGER(ROW * i + LEAD))]))
