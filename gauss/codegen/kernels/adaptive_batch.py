"""Loop of an adaptive integrator over a batch of motions, one per SIMD lane, each with its own step length.

All lanes try a step at once. A lane with a rejected step retries with a shorter one while the others advance; a lane that
has reached the end is refilled with the next motion of the queue. Lanes are independent: a motion does not depend on the
others.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, Writer, intrinsic, processor
from gauss.codegen.kernels.adaptive import LAST_STEP_SHARE, PROJECTION_FAILED_FACTOR, TRIAL_RESULTS, TRIAL_SETTINGS, Adaptive
from gauss.codegen.kernels.compiled_loop import BatchLoop
from gauss.codegen.kernels.energy_record import ENERGY_RECORD
from gauss.codegen.kernels.loop_code import LoopCode
from gauss.codegen.kernels.loop_control import LoopStatus, Numbers, numbers

NAME, POINTERS = "adaptive_batch", ("control", "lanes", "motions", "grid", "out")
MOTION_RECORD = (
    "h",
    "refused",
    "sample",
    "due",
    "steps",
    "rejected",
    "worst",
    *ENERGY_RECORD,
)  # record of a motion, behind its point


@numbers
class MotionQueue(Numbers):
    """Queue of the motions, and settings and counters of the loop.

    Parameters
    ----------
    columns, rows : float
        Number of motions in the arrays, and samples of each.
    following, last : float
        Index of the next motion, and the one after the last.
    more : float
        Above 0 if more motions will follow: the loop then returns as soon as a lane is empty.
    end, largest, smallest, rtol, atol, atol_rates, acceleration_tolerance, every, constraint_tolerance
        See :class:`gauss.codegen.kernels.Control`.
    turns : float
        Trial steps so far, of all lanes together.
    status : float
        DONE or PAUSED.
    """

    columns: float
    rows: float
    following: float = 0.0
    last: float = 0.0
    more: float = 1.0
    end: float = 0.0
    largest: float = np.inf
    smallest: float = 0.0
    rtol: float = 0.0
    atol: float = 0.0
    atol_rates: float = 0.0
    acceleration_tolerance: float = 1e-9
    every: float = 1.0
    constraint_tolerance: float = 1e-10
    turns: float = 0.0
    status: float = LoopStatus.PAUSED


class AdaptiveBatchLoop(BatchLoop):
    """Compiled loop, called with the arrays ``POINTERS`` and a budget of steps.

    Parameters
    ----------
    method : Adaptive
        Functions of the method, compiled for SIMD vectors of motions.
    written : slice
        Part of a point that is a sample.
    """

    def __init__(self, method: Adaptive, written: slice):
        self.size, self.written = method.size, written
        writer = Writer()
        write_adaptive_batch(writer, method, written, processor.width())
        super().__init__(writer, NAME, MotionQueue, len(POINTERS) - 1, processor.width())

    def lanes(self) -> np.ndarray:
        """Array (size + len(MOTION_RECORD) + 1, width) of empty lanes."""
        empty = np.zeros((self.size + len(MOTION_RECORD) + 1, self.width))
        empty[-1] = -1.0
        return empty

    def __call__(self, queue: MotionQueue, lanes, motions, grid, out, budget: int):
        """Step until the queue is done, a lane is empty, or the budget is used up; releases Python's global lock.

        Parameters
        ----------
        queue : MotionQueue
            Changed.
        lanes : ndarray
            See :meth:`lanes`; changed.
        motions : ndarray, shape (size + len(MOTION_RECORD), columns)
            Point and record of each motion, changed when it ends; one that stops before the end has failed.
        grid : ndarray, shape (rows + 1,)
            Times of the samples, then infinity.
        out : ndarray, shape (columns, rows, row)
            Changed.
        """
        self._call(queue, (lanes, motions, grid, out), budget)


def write_adaptive_batch(writer: Writer, method: Adaptive, written: slice, width: int) -> ir.Function:
    """Write the loop for a number of lanes: (*POINTERS, budget)."""
    code = LoopCode(writer, NAME, POINTERS, MotionQueue, width)
    _AdaptiveBatchWriter(method, code, written).write()
    return code.function


class _AdaptiveBatchWriter:
    """Emitter of the loop; ``now`` are the points in the lanes, ``tried`` and ``projected`` those after a step."""

    def __init__(self, method: Adaptive, code: LoopCode, written: slice):
        self.method, self.code, self.written = method, code, written
        self.b, self.lanes, self.now = code.b, code.lanes, code.pointer["lanes"]
        self.given, self.tried = code.buffer(method.size + len(TRIAL_SETTINGS)), code.buffer(len(method.trial.outputs))
        self.projected, self.error = code.buffer(method.size + 1), code.buffer(len(method.check.outputs))
        self.place = {name: method.size + k for k, name in enumerate((*MOTION_RECORD, "motion"))}

    def write(self):
        code, b, lanes = self.code, self.b, self.lanes
        budget = code.counter(code.budget)
        with code.loop() as leave_if:
            self._refill()
            active = b.fcmp_ordered(">=", self._take("motion"), lanes.constant(0.0))
            code.set("status", LoopStatus.DONE)
            leave_if(b.not_(b.or_(lanes.any_lane(active), b.fcmp_ordered(">", code.get("more"), code.number(0.0)))))
            code.set("status", LoopStatus.PAUSED)
            wanting = b.and_(b.not_(lanes.all_lanes(active)), b.fcmp_ordered(">", code.get("more"), code.number(0.0)))
            leave_if(b.or_(wanting, b.icmp_signed("<=", b.load(budget), INTEGER(0))))
            b.store(b.sub(b.load(budget), INTEGER(1)), budget)
            h, last = self._length(active)
            reached = self._reached(h, last, active)
            self._check(reached)
            self._samples(h, reached)
            for k in range(self.method.size):
                code.put(b.select(reached, code.take(self.projected, k), code.take(self.now, k)), self.now, k)
        code.finish()

    def _take(self, name: str):
        return self.code.take(self.now, self.place[name])

    def _put(self, value, name: str):
        self.code.put(value, self.now, self.place[name])

    def _add(self, where, name: str):
        self._put(self.b.fadd(self._take(name), self.b.uitofp(where, self.lanes.kind)), name)

    def _spread(self, name: str):
        return self.lanes.broadcast(self.code.get(name))

    def _refill(self):
        """Store motions that have ended or failed, and refill their lanes."""
        code, b, lanes = self.code, self.b, self.lanes
        empty = b.fcmp_ordered("<", self._take("motion"), lanes.constant(0.0))
        arrived = b.fcmp_ordered(">=", code.take(self.now, 0), self._spread("end"))
        small = b.fcmp_unordered("<", self._take("h"), self._spread("smallest"))
        unconfirmed = b.fcmp_unordered(">", self._take("worst"), self._spread("acceleration_tolerance"))
        free = b.or_(b.or_(empty, arrived), b.or_(small, unconfirmed))
        waiting = b.icmp_signed("<", code.index("following"), code.index("last"))
        with b.if_then(b.or_(lanes.any_lane(b.and_(free, b.not_(empty))), b.and_(waiting, lanes.any_lane(free)))):
            flags = code.buffer(1)
            code.put(lanes.number(free), flags, 0)
            with self.code.each(self.code.width) as lane, b.if_then(self._is_set(flags, lane)):
                self._store(lane)
                self._begin(lane)

    @property
    def _numbers(self) -> int:
        return self.method.size + len(MOTION_RECORD)

    def _motion(self, lane):
        """Pointer to the index of the motion in a lane."""
        return self.b.gep(self.code.at(self.now, self._numbers), [lane])

    def _store(self, lane):
        b, number = self.b, self.b.load(self._motion(lane))
        with b.if_then(b.fcmp_ordered(">=", number, self.code.number(0.0))):
            column = b.gep(self.code.pointer["motions"], [b.fptosi(number, INTEGER)])
            self._copied(column, self.code.index("columns"), b.gep(self.now, [lane]), INTEGER(self.code.width))
            b.store(self.code.number(-1.0), self._motion(lane))

    def _begin(self, lane):
        code, b = self.code, self.b
        with b.if_then(b.icmp_signed("<", code.index("following"), code.index("last"))):
            column = b.gep(code.pointer["motions"], [code.index("following")])
            self._copied(b.gep(self.now, [lane]), INTEGER(code.width), column, code.index("columns"))
            b.store(code.get("following"), self._motion(lane))
            code.add("following")

    def _copied(self, target, target_apart, source, source_apart):
        """Copy a point and its record between arrays of any stride."""
        with self.code.each(self._numbers) as k:
            value = self.b.load(self.b.gep(source, [self.b.mul(k, source_apart)]))
            self.b.store(value, self.b.gep(target, [self.b.mul(k, target_apart)]))

    def _length(self, active):
        """Length of the step, 0 in empty lanes, and whether it is the last one."""
        code, b, lanes = self.code, self.b, self.lanes
        h, largest = self._take("h"), self._spread("largest")
        h = b.select(b.fcmp_ordered("<", h, largest), h, largest)
        remaining = b.fsub(self._spread("end"), code.take(self.now, 0))
        last = b.fcmp_ordered(">=", h, b.fmul(remaining, lanes.constant(LAST_STEP_SHARE)))
        return b.select(active, b.select(last, remaining, h), lanes.constant(0.0)), last

    def _reached(self, h, last, active):
        """Make the step; mask of the lanes in which it was accepted and projected."""
        code, b, lanes, size = self.code, self.b, self.lanes, self.method.size
        code.copy(self.given, self.now, size)
        own = {"h": h, "refused": self._take("refused"), "last": lanes.number(last)}
        for k, name in enumerate(TRIAL_SETTINGS):
            code.put(own[name] if name in own else self._spread(name), self.given, size + k)
        code.call(self.method.trial, self.given, self.tried)
        code.put(b.select(last, self._spread("end"), code.take(self.tried, 0)), self.tried, 0)
        following = b.fmul(h, code.take(self.tried, size + 1))
        reached = b.and_(active, b.fcmp_ordered("<=", code.take(self.tried, size), lanes.constant(1.0)))
        code.copy(self.projected, self.tried, size)
        if self.method.project is not None:
            with b.if_then(lanes.any_lane(reached)):
                code.call(self.method.project, self.tried, self.projected)
            closed = b.fcmp_ordered("<=", code.take(self.projected, size), self._spread("constraint_tolerance"))
            off = b.and_(reached, b.not_(closed))
            following = b.select(off, b.fmul(h, lanes.constant(PROJECTION_FAILED_FACTOR)), following)
            reached = b.and_(reached, closed)
        refused = b.and_(active, b.not_(reached))
        self._put(b.select(active, following, self._take("h")), "h")
        self._put(b.select(refused, b.fadd(own["refused"], lanes.constant(1.0)), lanes.constant(0.0)), "refused")
        self._add(reached, "steps")
        self._add(refused, "rejected")
        return reached

    def _check(self, reached):
        """Check the accelerations every so many turns; update the largest error and the energy record."""
        code, b = self.code, self.b
        code.add("turns")
        with b.if_then(b.and_(code.is_multiple("turns", "every"), self.lanes.any_lane(reached))):
            code.call(self.method.check, self.projected, self.error)
            larger = intrinsic(code.writer.module, "llvm.maximum", self.lanes.kind, 2)  # propagates NaN
            found = b.call(larger, [self._take("worst"), code.take(self.error, 0)])
            self._put(b.select(reached, found, self._take("worst")), "worst")
            record = [self._take(name) for name in ENERGY_RECORD]
            following = code.energies_after(record, self.projected, self.error)
            for name, before, after in zip(ENERGY_RECORD, record, following, strict=True):
                self._put(b.select(reached, after, before), name)

    def _samples(self, h, reached):
        """Write the samples due in this step: its end point, or dense output."""
        code, b, lanes, method = self.code, self.b, self.lanes, self.method
        known, coefficients = code.counter(INTEGER(0)), code.buffer(len(method.dense.outputs))
        row, chosen, flags = code.buffer(method.row), code.buffer(method.row), code.buffer(1)
        end, before = code.take(self.projected, 0), code.take(self.now, 0)
        with code.loop() as leave_if:
            t = self._take("due")
            due = b.and_(reached, b.fcmp_ordered("<=", t, end))
            leave_if(b.not_(lanes.any_lane(due)))
            inside = b.and_(due, b.fcmp_ordered("<", t, end))
            with b.if_then(lanes.any_lane(inside)):
                with b.if_then(b.icmp_signed("==", b.load(known), INTEGER(0))):
                    b.store(INTEGER(1), known)
                    self._dense(h, coefficients)
                t = b.select(inside, t, before)
                found = code.join((self.now, method.size), h, (coefficients, len(method.dense.outputs)), t)
                code.call(method.sample, found, row)
            for k in range(self.written.start, self.written.stop):
                code.put(b.select(inside, code.take(row, k), code.take(self.projected, k)), chosen, k)
            code.put(lanes.number(due), flags, 0)
            with self.code.each(self.code.width) as lane, b.if_then(self._is_set(flags, lane)):
                self._write_row(lane, chosen)

    def _dense(self, h, coefficients):
        size = self.method.size
        kept = (self.code.at(self.tried, size + TRIAL_RESULTS), len(self.method.trial.outputs) - size - TRIAL_RESULTS)
        given = self.code.join((self.now, size), (self.tried, size), h, kept)
        self.code.call(self.method.dense, given, coefficients)

    def _write_row(self, lane, chosen):
        """Write the sample of a lane, and load the time of the next one."""
        code, b, size = self.code, self.b, self.written.stop - self.written.start
        sample, due = (b.gep(code.at(self.now, self.place[name]), [lane]) for name in ("sample", "due"))
        place = b.mul(b.fptosi(b.load(self._motion(lane)), INTEGER), code.index("rows"))
        place = b.add(place, b.fptosi(b.load(sample), INTEGER))
        target = b.gep(code.pointer["out"], [b.mul(place, INTEGER(size))])
        for k in range(size):
            value = b.load(b.gep(code.at(chosen, self.written.start + k), [lane]))
            b.store(value, b.gep(target, [INTEGER(k)]))
        following = b.fadd(b.load(sample), code.number(1.0))
        b.store(following, sample)
        b.store(b.load(b.gep(code.pointer["grid"], [b.fptosi(following, INTEGER)])), due)

    def _is_set(self, flags, lane) -> ir.Value:
        return self.b.fcmp_ordered(">", self.b.load(self.b.gep(flags, [lane])), self.code.number(0.0))
