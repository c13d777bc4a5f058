"""Loop of an adaptive integrator: trial step, step-size control, projection onto the constraints, check, samples."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import INTEGER, Function, NativeFunction, Writer
from gauss.codegen.kernels.compiled_loop import POINTERS, Loop
from gauss.codegen.kernels.loop_code import LoopCode
from gauss.codegen.kernels.loop_control import LoopStatus

TRIAL_SETTINGS = ("h", "rtol", "atol", "atol_rates", "refused", "last", "smallest")  # inputs of a trial beside the point
TRIAL_RESULTS = 4  # error, factor, evaluations, factorisations
LAST_STEP_SHARE = 1.0 - 1e-12  # share of the remaining time above which a step is stretched to the end
PROJECTION_FAILED_FACTOR = 0.2  # factor of the step length after a failed projection


@dataclass(frozen=True)
class Adaptive:
    """Functions of an adaptive method on points (t, …) of ``size`` numbers; the first ``row`` of them are sampled.

    Parameters
    ----------
    size, row : int
        Length of a point, and of a sample.
    trial : Function
        ``(point, *TRIAL_SETTINGS)`` → (point after, error, factor of the next step, evaluations, factorisations,
        inputs of dense output).
    project : Function or None
        Point → (projected point, constraint residual), with one evaluation; None without projection.
    check : Function or NativeFunction
        Point → (error of its accelerations, residual of the loop constraints, energy sample).
    dense : Function
        (point before, point after, h, inputs of dense output) → coefficients.
    sample : Function
        (point before, h, coefficients, t) → row.
    dense_evaluations : int
        Evaluations of the accelerations in ``dense``.
    rates : Function or NativeFunction
        Equations of motion: (t, q, v) → rates.
    """

    size: int
    row: int
    trial: Function | NativeFunction
    project: Function | NativeFunction | None
    check: Function | NativeFunction
    dense: Function | NativeFunction
    sample: Function | NativeFunction
    dense_evaluations: int
    rates: Function | NativeFunction

    def compile(self, start: Function | NativeFunction) -> Loop:
        """Machine code of the loop, and of ``start``, which is called by name."""
        writer = Writer()
        AdaptiveWriter(self, LoopCode(writer, "adaptive", POINTERS), len(self.trial.outputs)).write()
        return Loop(writer, "adaptive", (self.rates, self.check, start))


class AdaptiveWriter:
    """Emitter of the loop.

    The buffers ``tried`` and ``projected`` begin with the point after a step, before and after projection.
    """

    def __init__(self, method, code: LoopCode, tried: int):
        self.method, self.code, self.b = method, code, code.b
        self.point = code.pointer["point"]
        self.given, self.tried = code.buffer(method.size + len(TRIAL_SETTINGS)), code.buffer(tried)
        self.projected = code.buffer(method.size + 1)
        self.residual = code.at(self.projected, method.size)

    def write(self):
        """Emit the loop."""
        code, b, size = self.code, self.b, self.method.size
        budget, error = code.counter(code.budget), code.buffer(len(self.method.check.outputs))
        with code.loop() as leave_if:
            code.set("status", LoopStatus.DONE)
            leave_if(b.fcmp_ordered(">=", b.load(self.point), code.get("end")))
            code.set("status", LoopStatus.PAUSED)
            leave_if(b.icmp_signed("<=", b.load(budget), INTEGER(0)))
            b.store(b.sub(b.load(budget), INTEGER(1)), budget)
            h, last = self._clipped(self._length())
            code.set("status", LoopStatus.TOO_SMALL)
            leave_if(b.fcmp_unordered("<", h, code.get("smallest")))
            reached = self._reached(h, last)
            due = b.and_(reached, b.or_(last, code.is_multiple("steps", "every")))
            b.store(code.number(0.0), error)
            with b.if_then(due):
                self._check(error)
            code.set("status", LoopStatus.UNCONFIRMED)
            leave_if(b.fcmp_unordered(">", b.load(error), code.get("acceleration_tolerance")))
            with b.if_then(reached):
                with b.if_else(b.fcmp_ordered(">", code.get("samples"), code.number(0.0))) as (some, every_step):
                    with some:
                        self._samples(h)
                    with every_step:
                        code.copy(code.row(self.method.row), self.projected, self.method.row)
                        code.add("rows")
                code.copy(self.point, self.projected, size)
            with b.if_then(due):
                code.copy(code.pointer["confirmed"], self.projected, size)
        code.finish()

    def _length(self):
        """Length of the step to try."""
        return self.code.get("h")

    def _clipped(self, h):
        """Length of the step, and whether it is the last one."""
        code, b = self.code, self.b
        largest = code.get("largest")
        h = b.select(b.fcmp_ordered("<", h, largest), h, largest)
        remaining = b.fsub(code.get("end"), b.load(self.point))
        last = b.fcmp_ordered(">=", h, b.fmul(remaining, code.number(LAST_STEP_SHARE)))
        return b.select(last, remaining, h), last

    def _try(self, h, last):
        """Try the step and set the length of the next; whether the error is accepted."""
        code, b, size = self.code, self.b, self.method.size
        code.copy(self.given, self.point, size)
        own = {"h": h, "last": b.uitofp(last, code.kind)}
        for k, name in enumerate(TRIAL_SETTINGS):
            b.store(own[name] if name in own else code.get(name), code.at(self.given, size + k))
        code.call(self.method.trial, self.given, self.tried)
        code.add("evaluations", b.load(code.at(self.tried, size + 2)))
        code.add("factorisations", b.load(code.at(self.tried, size + 3)))
        code.set("h", b.fmul(h, b.load(code.at(self.tried, size + 1))))
        return b.fcmp_ordered("<=", b.load(code.at(self.tried, size)), code.number(1.0))

    def _reached(self, h, last):
        """Make the step; whether it was accepted and projected."""
        code, b = self.code, self.b
        accepted = self._try(h, last)
        b.store(b.select(last, code.get("end"), b.load(self.tried)), self.tried)
        b.store(code.number(np.inf), self.residual)
        with b.if_then(accepted):
            self._project()
            with b.if_then(b.not_(self._is_projected())):
                code.set("h", b.fmul(h, code.number(PROJECTION_FAILED_FACTOR)))
        reached = self._is_projected()
        code.add("steps", b.uitofp(reached, code.kind))
        code.add("rejected", b.uitofp(b.not_(reached), code.kind))
        code.set("refused", b.select(reached, code.number(0.0), b.fadd(code.get("refused"), code.number(1.0))))
        return reached

    def _check(self, error):
        """Check the accelerations of the projected point."""
        self.code.check(self.method.check, self.projected, error)

    def _project(self):
        if self.method.project is None:
            self.code.copy(self.projected, self.tried, self.method.size)
            self.b.store(self.code.number(0.0), self.residual)
        else:
            self.code.call(self.method.project, self.tried, self.projected)
            self.code.add("evaluations")

    def _is_projected(self):
        return self.b.fcmp_ordered("<=", self.b.load(self.residual), self.code.get("constraint_tolerance"))

    def _samples(self, h):
        """Write the samples due in this step: its end point, or dense output."""
        code, b, row = self.code, self.b, self.method.row
        grid, inside = code.pointer["grid"], self._inside(h)
        with code.loop() as leave_if:
            leave_if(b.fcmp_ordered(">=", code.get("sample"), code.get("samples")))
            t = b.load(b.gep(grid, [code.index("sample")]))
            leave_if(b.fcmp_ordered(">", t, b.load(self.projected)))
            with b.if_else(b.fcmp_ordered("==", t, b.load(self.projected))) as (at_end, between):
                with at_end:
                    code.copy(code.row(row), self.projected, row)
                with between:
                    inside(t)
            code.add("rows")
            code.add("sample")

    def _inside(self, h):
        """Function of t that writes a sample inside the step; dense output is prepared once, at the first sample."""
        code, b, method = self.code, self.b, self.method
        prepared, coefficients = code.buffer(1), code.buffer(len(method.dense.outputs))
        b.store(code.number(0.0), prepared)

        def write(t):
            with b.if_then(b.fcmp_ordered("==", b.load(prepared), code.number(0.0))):
                b.store(code.number(1.0), prepared)
                self._dense(h, coefficients)
            given = code.join((self.point, method.size), h, (coefficients, len(method.dense.outputs)), t)
            code.call(method.sample, given, code.row(method.row))

        return write

    def _dense(self, h, coefficients):
        size = self.method.size
        kept = (self.code.at(self.tried, size + TRIAL_RESULTS), len(self.method.trial.outputs) - size - TRIAL_RESULTS)
        given = self.code.join((self.point, size), (self.tried, size), h, kept)
        self.code.call(self.method.dense, given, coefficients)
        self.code.add("evaluations", self.method.dense_evaluations)
