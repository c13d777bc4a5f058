"""The loop of an adaptive integrator: try a step, settle it on the constraints, check it, write samples, go on."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import INTEGER, Function, Writer
from gauss.codegen.kernels.compiled_loop import POINTERS, Loop
from gauss.codegen.kernels.loop_code import Code
from gauss.codegen.kernels.loop_control import Status

GIVEN = ("h", "rtol", "atol", "atol_rates", "refused", "last", "smallest")  # what a trial is told beside the point
TRIED = 4  # numbers between the point after a trial and what dense output needs
LAST = 1.0 - 1e-12  # a step that reaches the end but for this share goes all the way
SLOWEST = 0.2  # of a step that cannot be settled on the constraints


@dataclass(frozen=True)
class Adaptive:
    """Functions of an adaptive method on points (t, …) of ``size`` numbers, of which the first ``row`` are written out.

    Parameters
    ----------
    size, row : int
        Numbers of a point, and of a row.
    trial : Function
        (point, *GIVEN) → (point after, error, factor of the next step, evaluations, factorisations,
        what dense output needs).
    settle : Function or None
        Point → (point on the constraints, gap), by one evaluation; None where nothing is to be settled.
    check : Function
        Point → (error of its accelerations, what closing rows lack under them, a look at its energies).
    dense : Function
        (point before, point after, h, what the trial left) → coefficients.
    sample : Function
        (point before, h, coefficients, t) → row.
    dense_evaluations : int
        Evaluations of the accelerations in ``dense``.
    rates : Function
        What is evaluated: (t, q, v) → what drives the motion on.
    """

    size: int
    row: int
    trial: Function
    settle: Function | None
    check: Function
    dense: Function
    sample: Function
    dense_evaluations: int
    rates: Function

    def compile(self, start: Function) -> Loop:
        """Machine code of the loop, and of a function that is called by name before it."""
        writer = Writer()
        Stepping(self, Code(writer, "adaptive", POINTERS), len(self.trial.outputs)).write()
        return Loop(writer, "adaptive", (self.rates, self.check, start))


class Stepping:
    """The loop while it is written.

    ``tried``, of so many numbers, and ``settled`` begin with the points after a step before and after settling.
    """

    def __init__(self, method, code: Code, tried: int):
        self.method, self.code, self.b = method, code, code.b
        self.point = code.pointer["point"]
        self.given, self.tried = code.buffer(method.size + len(GIVEN)), code.buffer(tried)
        self.settled = code.buffer(method.size + 1)
        self.gap = code.at(self.settled, method.size)

    def write(self):
        """Write it to its end."""
        code, b, size = self.code, self.b, self.method.size
        budget, error = code.counter(code.budget), code.buffer(len(self.method.check.outputs))
        with code.loop() as leave_if:
            code.set("status", Status.DONE)
            leave_if(b.fcmp_ordered(">=", b.load(self.point), code.get("end")))
            code.set("status", Status.PAUSED)
            leave_if(b.icmp_signed("<=", b.load(budget), INTEGER(0)))
            b.store(b.sub(b.load(budget), INTEGER(1)), budget)
            h, last = self._clipped(self._length())
            code.set("status", Status.TOO_SMALL)
            leave_if(b.fcmp_unordered("<", h, code.get("smallest")))
            reached = self._reached(h, last)
            due = b.and_(reached, b.or_(last, code.is_multiple("steps", "every")))
            b.store(code.number(0.0), error)
            with b.if_then(due):
                self._check(error)
            code.set("status", Status.DISTRUSTED)
            leave_if(b.fcmp_unordered(">", b.load(error), code.get("trust")))
            with b.if_then(reached):
                with b.if_else(b.fcmp_ordered(">", code.get("samples"), code.number(0.0))) as (some, every_step):
                    with some:
                        self._samples(h)
                    with every_step:
                        code.copy(code.row(self.method.row), self.settled, self.method.row)
                        code.add("rows")
                code.copy(self.point, self.settled, size)
            with b.if_then(due):
                code.copy(code.pointer["confirmed"], self.settled, size)
        code.finish()

    def _length(self):
        """Length of the step that may be tried."""
        return self.code.get("h")

    def _clipped(self, h):
        """Length of the step, and whether it is the last."""
        code, b = self.code, self.b
        largest = code.get("largest")
        h = b.select(b.fcmp_ordered("<", h, largest), h, largest)
        remaining = b.fsub(code.get("end"), b.load(self.point))
        last = b.fcmp_ordered(">=", h, b.fmul(remaining, code.number(LAST)))
        return b.select(last, remaining, h), last

    def _try(self, h, last):
        """Try the step, and say how long the next may be; whether its error is small enough."""
        code, b, size = self.code, self.b, self.method.size
        code.copy(self.given, self.point, size)
        own = {"h": h, "last": b.uitofp(last, code.kind)}
        for k, name in enumerate(GIVEN):
            b.store(own[name] if name in own else code.get(name), code.at(self.given, size + k))
        code.call(self.method.trial, self.given, self.tried)
        code.add("evaluations", b.load(code.at(self.tried, size + 2)))
        code.add("factorisations", b.load(code.at(self.tried, size + 3)))
        code.set("h", b.fmul(h, b.load(code.at(self.tried, size + 1))))
        return b.fcmp_ordered("<=", b.load(code.at(self.tried, size)), code.number(1.0))

    def _reached(self, h, last):
        """Make the step; whether it was accepted and settled."""
        code, b = self.code, self.b
        accepted = self._try(h, last)
        b.store(b.select(last, code.get("end"), b.load(self.tried)), self.tried)
        b.store(code.number(np.inf), self.gap)
        with b.if_then(accepted):
            self._settle()
            with b.if_then(b.not_(self._is_closed())):
                code.set("h", b.fmul(h, code.number(SLOWEST)))
        reached = self._is_closed()
        code.add("steps", b.uitofp(reached, code.kind))
        code.add("rejected", b.uitofp(b.not_(reached), code.kind))
        code.set("refused", b.select(reached, code.number(0.0), b.fadd(code.get("refused"), code.number(1.0))))
        return reached

    def _check(self, error):
        """Say what the error of the accelerations is in the settled point."""
        self.code.check(self.method.check, self.settled, error)

    def _settle(self):
        if self.method.settle is None:
            self.code.copy(self.settled, self.tried, self.method.size)
            self.b.store(self.code.number(0.0), self.gap)
        else:
            self.code.call(self.method.settle, self.tried, self.settled)
            self.code.add("evaluations")

    def _is_closed(self):
        return self.b.fcmp_ordered("<=", self.b.load(self.gap), self.code.get("closed"))

    def _samples(self, h):
        """Write the samples that are due in this step: its end itself, or dense output."""
        code, b, row = self.code, self.b, self.method.row
        grid, inside = code.pointer["grid"], self._inside(h)
        with code.loop() as leave_if:
            leave_if(b.fcmp_ordered(">=", code.get("sample"), code.get("samples")))
            t = b.load(b.gep(grid, [code.index("sample")]))
            leave_if(b.fcmp_ordered(">", t, b.load(self.settled)))
            with b.if_else(b.fcmp_ordered("==", t, b.load(self.settled))) as (at_end, between):
                with at_end:
                    code.copy(code.row(row), self.settled, row)
                with between:
                    inside(t)
            code.add("rows")
            code.add("sample")

    def _inside(self, h):
        """How the row of a time within a step is written; what it takes is computed once, when it is first needed."""
        code, b, method = self.code, self.b, self.method
        known, coefficients = code.buffer(1), code.buffer(len(method.dense.outputs))
        b.store(code.number(0.0), known)

        def write(t):
            with b.if_then(b.fcmp_ordered("==", b.load(known), code.number(0.0))):
                b.store(code.number(1.0), known)
                self._dense(h, coefficients)
            given = code.join((self.point, method.size), h, (coefficients, len(method.dense.outputs)), t)
            code.call(method.sample, given, code.row(method.row))

        return write

    def _dense(self, h, coefficients):
        size = self.method.size
        kept = (self.code.at(self.tried, size + TRIED), len(self.method.trial.outputs) - size - TRIED)
        given = self.code.join((self.point, size), (self.tried, size), h, kept)
        self.code.call(self.method.dense, given, coefficients)
        self.code.add("evaluations", self.method.dense_evaluations)
