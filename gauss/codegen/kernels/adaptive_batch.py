"""The loop of an adaptive integrator over many motions, each in a lane of a vector register, with a step of its own.

All lanes try a step at once. One whose step is refused tries again with a shorter one while the others go on; one that has
reached the end is given the next motion of the queue. Lanes do not mix: a motion does not depend on the others.
"""

import ctypes

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, Writer, intrinsic, machine
from gauss.codegen.kernels.adaptive import GIVEN, LAST, SLOWEST, TRIED, Adaptive
from gauss.codegen.kernels.energy_record import ENERGIES
from gauss.codegen.kernels.loop_code import Code
from gauss.codegen.kernels.loop_control import Numbers, Status, numbers

POINTERS = ("control", "lanes", "motions", "grid", "out")
RECORD = ("h", "refused", "sample", "due", "steps", "rejected", "worst", *ENERGIES)  # of a motion, behind its point


@numbers
class Queue(Numbers):
    """Motions that wait for a lane, and how they are stepped.

    Parameters
    ----------
    columns, rows : float
        Motions that the arrays have room for, and rows of each.
    following, last : float
        Next motion to begin, and the one after the last.
    more : float
        Above 0 if there will be others: a lane that has none then lets the loop return.
    end, largest, smallest, rtol, atol, atol_rates, trust, every, closed
        See :class:`gauss.codegen.kernels.Control`.
    turns : float
        Steps tried so far, by all lanes at once.
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
    trust: float = 1e-9
    every: float = 1.0
    closed: float = 1e-10
    turns: float = 0.0
    status: float = Status.PAUSED


class AdaptiveBatchLoop:
    """Compiled loop of the arrays ``POINTERS`` and a budget of steps.

    Parameters
    ----------
    method : Adaptive
        What a step is; its functions are compiled for vectors of motions.
    written : slice
        Part of a point that is written out.

    Attributes
    ----------
    width : int
        Number of lanes.
    """

    def __init__(self, method: Adaptive, written: slice):
        self.method, self.written, self.width = method, written, machine.width()
        writer = Writer()
        _Writing(method, Code(writer, "stream", POINTERS, Queue, self.width), written).write()
        self.code = machine.load(str(writer.module))
        pointer = np.ctypeslib.ndpointer(float, flags=("C_CONTIGUOUS", "WRITEABLE"))
        pointers = [ctypes.POINTER(Queue), *[pointer] * len(POINTERS[1:])]
        self._function = ctypes.CFUNCTYPE(None, *pointers, ctypes.c_int64)(self.code.address("stream"))

    def lanes(self) -> np.ndarray:
        """Lanes (size + len(RECORD) + 1, width) without motions."""
        empty = np.zeros((self.method.size + len(RECORD) + 1, self.width))
        empty[-1] = -1.0
        return empty

    def __call__(self, queue: Queue, lanes, motions, grid, out, budget: int):
        """Step until all lanes rest, one lacks a motion, or the budget is used up, without Python's global lock.

        Parameters
        ----------
        queue : Queue
            Changed.
        lanes : ndarray
            See :meth:`lanes`; changed.
        motions : ndarray, shape (size + len(RECORD), columns)
            Point and record of each motion; changed when it ends: where it does not reach the end, it was given up.
        grid : ndarray, shape (rows + 1,)
            Times of the rows, then infinity.
        out : ndarray, shape (columns, rows, row)
            Changed.
        budget : int
            Steps.
        """
        self._function(queue, lanes, motions, grid, out, budget)


class _Writing:
    """The loop while it is written; lanes hold the points, ``tried`` and ``settled`` what a step leads to."""

    def __init__(self, method: Adaptive, code: Code, written: slice):
        self.method, self.code, self.written = method, code, written
        self.b, self.lanes, self.now = code.b, code.lanes, code.pointer["lanes"]
        self.given, self.tried = code.buffer(method.size + len(GIVEN)), code.buffer(len(method.trial.outputs))
        self.settled, self.error = code.buffer(method.size + 1), code.buffer(len(method.check.outputs))
        self.place = {name: method.size + k for k, name in enumerate((*RECORD, "motion"))}

    def write(self):
        code, b, lanes = self.code, self.b, self.lanes
        budget = code.counter(code.budget)
        with code.loop() as leave_if:
            self._turn_over()
            active = b.fcmp_ordered(">=", self._take("motion"), lanes.constant(0.0))
            code.set("status", Status.DONE)
            leave_if(b.not_(b.or_(lanes.some(active), b.fcmp_ordered(">", code.get("more"), code.number(0.0)))))
            code.set("status", Status.PAUSED)
            hungry = b.and_(b.not_(lanes.every(active)), b.fcmp_ordered(">", code.get("more"), code.number(0.0)))
            leave_if(b.or_(hungry, b.icmp_signed("<=", b.load(budget), INTEGER(0))))
            b.store(b.sub(b.load(budget), INTEGER(1)), budget)
            h, last = self._length(active)
            reached = self._reached(h, last, active)
            self._check(reached)
            self._samples(h, reached)
            for k in range(self.method.size):
                code.put(b.select(reached, code.take(self.settled, k), code.take(self.now, k)), self.now, k)
        code.finish()

    def _take(self, name: str):
        return self.code.take(self.now, self.place[name])

    def _put(self, value, name: str):
        self.code.put(value, self.now, self.place[name])

    def _add(self, where, name: str):
        self._put(self.b.fadd(self._take(name), self.b.uitofp(where, self.lanes.kind)), name)

    def _spread(self, name: str):
        return self.lanes.spread(self.code.get(name))

    def _turn_over(self):
        """Put motions away that have ended or cannot go on, and begin others in their lanes."""
        code, b, lanes = self.code, self.b, self.lanes
        rests = b.fcmp_ordered("<", self._take("motion"), lanes.constant(0.0))
        arrived = b.fcmp_ordered(">=", code.take(self.now, 0), self._spread("end"))
        small = b.fcmp_unordered("<", self._take("h"), self._spread("smallest"))
        distrusted = b.fcmp_unordered(">", self._take("worst"), self._spread("trust"))
        free = b.or_(b.or_(rests, arrived), b.or_(small, distrusted))
        waiting = b.icmp_signed("<", code.index("following"), code.index("last"))
        with b.if_then(b.or_(lanes.some(b.and_(free, b.not_(rests))), b.and_(waiting, lanes.some(free)))):
            flags = code.buffer(1)
            code.put(lanes.number(free), flags, 0)
            with self.code.each(self.code.width) as lane, b.if_then(self._is_set(flags, lane)):
                self._put_away(lane)
                self._begin(lane)

    @property
    def _numbers(self) -> int:
        return self.method.size + len(RECORD)

    def _motion(self, lane):
        """Where the number of the motion of a lane is kept."""
        return self.b.gep(self.code.at(self.now, self._numbers), [lane])

    def _put_away(self, lane):
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
        """Length of the step, none of lanes at rest, and whether it is the last."""
        code, b, lanes = self.code, self.b, self.lanes
        h, largest = self._take("h"), self._spread("largest")
        h = b.select(b.fcmp_ordered("<", h, largest), h, largest)
        remaining = b.fsub(self._spread("end"), code.take(self.now, 0))
        last = b.fcmp_ordered(">=", h, b.fmul(remaining, lanes.constant(LAST)))
        return b.select(active, b.select(last, remaining, h), lanes.constant(0.0)), last

    def _reached(self, h, last, active):
        """Make the step; where it was accepted and settled."""
        code, b, lanes, size = self.code, self.b, self.lanes, self.method.size
        code.copy(self.given, self.now, size)
        own = {"h": h, "refused": self._take("refused"), "last": lanes.number(last)}
        for k, name in enumerate(GIVEN):
            code.put(own[name] if name in own else self._spread(name), self.given, size + k)
        code.call(self.method.trial, self.given, self.tried)
        code.put(b.select(last, self._spread("end"), code.take(self.tried, 0)), self.tried, 0)
        following = b.fmul(h, code.take(self.tried, size + 1))
        reached = b.and_(active, b.fcmp_ordered("<=", code.take(self.tried, size), lanes.constant(1.0)))
        code.copy(self.settled, self.tried, size)
        if self.method.settle is not None:
            with b.if_then(lanes.some(reached)):
                code.call(self.method.settle, self.tried, self.settled)
            closed = b.fcmp_ordered("<=", code.take(self.settled, size), self._spread("closed"))
            off = b.and_(reached, b.not_(closed))
            following = b.select(off, b.fmul(h, lanes.constant(SLOWEST)), following)
            reached = b.and_(reached, closed)
        refused = b.and_(active, b.not_(reached))
        self._put(b.select(active, following, self._take("h")), "h")
        self._put(b.select(refused, b.fadd(own["refused"], lanes.constant(1.0)), lanes.constant(0.0)), "refused")
        self._add(reached, "steps")
        self._add(refused, "rejected")
        return reached

    def _check(self, reached):
        """Check accelerations every so many turns; the largest error is kept, and the record of the energies."""
        code, b = self.code, self.b
        code.add("turns")
        with b.if_then(b.and_(code.is_multiple("turns", "every"), self.lanes.some(reached))):
            code.call(self.method.check, self.settled, self.error)
            larger = intrinsic(code.writer.module, "llvm.maximum", self.lanes.kind, 2)  # also of what is no number
            found = b.call(larger, [self._take("worst"), code.take(self.error, 0)])
            self._put(b.select(reached, found, self._take("worst")), "worst")
            record = [self._take(name) for name in ENERGIES]
            looked = code.looked(record, self.settled, self.error)
            for name, before, after in zip(ENERGIES, record, looked, strict=True):
                self._put(b.select(reached, after, before), name)

    def _samples(self, h, reached):
        """Write the samples that are due in this step: its end itself, or dense output."""
        code, b, lanes, method = self.code, self.b, self.lanes, self.method
        known, coefficients = code.counter(INTEGER(0)), code.buffer(len(method.dense.outputs))
        row, chosen, flags = code.buffer(method.row), code.buffer(method.row), code.buffer(1)
        end, before = code.take(self.settled, 0), code.take(self.now, 0)
        with code.loop() as leave_if:
            t = self._take("due")
            due = b.and_(reached, b.fcmp_ordered("<=", t, end))
            leave_if(b.not_(lanes.some(due)))
            inside = b.and_(due, b.fcmp_ordered("<", t, end))
            with b.if_then(lanes.some(inside)):
                with b.if_then(b.icmp_signed("==", b.load(known), INTEGER(0))):
                    b.store(INTEGER(1), known)
                    self._dense(h, coefficients)
                t = b.select(inside, t, before)
                found = code.join((self.now, method.size), h, (coefficients, len(method.dense.outputs)), t)
                code.call(method.sample, found, row)
            for k in range(self.written.start, self.written.stop):
                code.put(b.select(inside, code.take(row, k), code.take(self.settled, k)), chosen, k)
            code.put(lanes.number(due), flags, 0)
            with self.code.each(self.code.width) as lane, b.if_then(self._is_set(flags, lane)):
                self._write_row(lane, chosen)

    def _dense(self, h, coefficients):
        size = self.method.size
        kept = (self.code.at(self.tried, size + TRIED), len(self.method.trial.outputs) - size - TRIED)
        given = self.code.join((self.now, size), (self.tried, size), h, kept)
        self.code.call(self.method.dense, given, coefficients)

    def _write_row(self, lane, chosen):
        """Write the row of a lane, and look up when the next one is due."""
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
