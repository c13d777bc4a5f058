"""Steps with contacts in machine code, one after the other: (t, q, v, work) at the ends of all of them.

    w₁ = w₀ + h P,   with the mean power P of a step

A step whose bodies reach an impact after a share of it begins anew without one. The loop stops after a step that is not
finished, or whose sliding contacts are to be examined, and where there is no room for further changes of the contact mode.
"""

import ctypes
from contextlib import suppress

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, machine
from gauss.codegen.kernels.arrays import Routine, Value
from gauss.codegen.kernels.near_pairs import INTEGERS
from gauss.codegen.kernels.step_memory import (
    CHANGES_ROOM,
    FINISHED,
    IMPACT,
    LOOP_SETTINGS,
    MECHANISM,
    RESULTS,
    STEP_SETTINGS,
    MemoryLayout,
    StepMemory,
)
from gauss.codegen.python_callback import HOLDING
from gauss.errors import GaussError

ARGUMENTS = *[ctypes.c_void_p] * 3, ctypes.c_int64, *[ctypes.c_void_p] * 2
ADVANCE, HOLDING_ADVANCE = ctypes.CFUNCTYPE(None, *ARGUMENTS), HOLDING(None, *ARGUMENTS)


class _LoopWriter:
    def __init__(self, step: ir.Function, module: ir.Module, layout: MemoryLayout):
        kinds = [INTEGERS, INTEGERS, POINTER, INTEGER, POINTER, POINTER]
        r = self.r = Routine(ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), "advance"))
        self.step, self.given = step, r.arrays[:3]
        (self.count,), (self.ends, self.out) = r.integers, r.arrays[3:]
        self.at = StepMemory(r, self.given, layout)
        self.status, self.counts = self.at.table("status"), self.at.table("counts")
        self.now, self.loop = self.at["settings"], self.at["loop"]

    def _setting(self, name: str) -> int:
        return STEP_SETTINGS.index(name)

    def write(self) -> ir.Function:
        r, done, stop = self.r, self.counts.after(3), self.r.variable(0, INTEGER)
        done[0], self.counts[2] = 0, 0
        with r.loop() as leave_if:
            leave_if((done[0] >= self.count) | (stop[0] > 0) | (self.counts[2] >= CHANGES_ROOM))
            self._bounds(done[0])
            self.now[self._setting("share")] = self.loop[LOOP_SETTINGS.index("shares")]
            r.call(self.step, *self.given)
            again = self.status[0]
            with r.when((again >= IMPACT) & (again <= IMPACT)):
                self.now[self._setting("share")] = 0.0
                r.call(self.step, *self.given)
            stop[0] = 1
            ended = self.status[0]
            with r.when((ended >= FINISHED) & (ended <= FINISHED)):
                self._end(done[0])
                done[0] = done[0] + 1
                with r.when(~(self.at["results"][RESULTS.index("doubtful")] > 0.0)):
                    stop[0] = 0
        return r.done()

    def _bounds(self, k: Value):
        """Length of a step, and the rates below which gaps and contacts rest."""
        r, fastest = self.r, self.r.variable(0.0)
        pace, resting, sliding = (self.loop[LOOP_SETTINGS.index(name)] for name in ("pace", "resting", "sliding"))
        with r.each(self.at.n["n_v"]) as i:
            fastest[0] = r.maximum(r.absolute(self.at["v"][i] * self.at["own"][i]), fastest[0])
        self.now[self._setting("h")] = self.ends[k] - self.now[self._setting("t")]
        self.now[self._setting("rest")] = resting * (pace + fastest[0])
        self.now[self._setting("slow")] = sliding * (pace + fastest[0])

    def _end(self, k: Value):
        """State and work at the end of a step."""
        r, n, results, work = self.r, self.at.n, self.at["results"], self.at["work"]
        n_q, n_v, largest = n["n_q"], n["n_v"], self.loop.after(LOOP_SETTINGS.index("largest"))
        for i in range(3):
            work[i] = work[i] + self.now[self._setting("h")] * results[i]
        largest[0] = r.maximum(results[RESULTS.index("error")], largest[0])
        self.now[self._setting("t")] = self.ends[k]
        self.at.copy(self.at["q"], self.at["end_q"], n_q)
        self.at.copy(self.at["v"], self.at["end_v"], n_v)
        row = self.out.after(k * (n_q + n_v + 4))
        row[0] = self.ends[k]
        self.at.copy(row.after(1), self.at["q"], n_q)
        self.at.copy(row.after(n_q + 1), self.at["v"], n_v)
        self.at.copy(row.after(n_q + n_v + 1), work, 3)


class CompiledSteps(machine.CodeCaller):
    """Python interface of the steps of a module.

    Parameters
    ----------
    step : llvmlite.ir.Function
        One step.
    layout : MemoryLayout
        What it works on.
    """

    signature = ADVANCE

    def __init__(self, step: ir.Function, layout: MemoryLayout = MECHANISM):
        _LoopWriter(step, step.module, layout).write()
        self.code = machine.load(str(step.module))
        self._bind()

    def _bind(self):
        self._advance = self.code.entry("advance", self.signature)

    def advance(self, ints: int, addresses: int, work: int, count: int, ends: int, rows: int):
        """Take steps to some times; the arrays of times and of rows are given by their addresses, too."""
        self._advance.call(ints, addresses, work, count, ends, rows)


class CallingSteps(CompiledSteps):
    """Steps whose kernels call Python, see :mod:`gauss.codegen.python_callback`.

    Parameters
    ----------
    steps : CompiledSteps
        Machine code of the steps.
    """

    signature = HOLDING_ADVANCE

    def __init__(self, steps: CompiledSteps):
        self.__setstate__(steps.__getstate__())

    def advance(self, ints: int, addresses: int, work: int, count: int, ends: int, rows: int):
        """Take steps to some times, up to one in which Python raises; repeating that step raises the same error."""
        with suppress(GaussError):
            super().advance(ints, addresses, work, count, ends, rows)
