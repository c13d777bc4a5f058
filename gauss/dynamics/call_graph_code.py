"""Machine code of a call graph: constrained forward dynamics, their check and projection.

Accelerations are checked by the residual of inverse dynamics, and corrected by it once
(:mod:`gauss.dynamics.call_graph_evaluation`).
"""

from functools import cached_property

import numpy as np

from gauss.codegen import INTEGER, Function, endless_loop, write
from gauss.codegen.kernels import RowCode, SingleRowFunction
from gauss.codegen.kernels.arrays import Array, Value
from gauss.dynamics.call_graph_evaluation import CallGraphEvaluation, RecordedSystem
from gauss.dynamics.projection import RESIDUAL_ROUNDOFF
from gauss.system import retract

MOST_NEWTON_STEPS = 4  # in position after an integration step, on one factorisation


class CallGraphCode(RecordedSystem):
    """Functions of a system with loops."""

    @cached_property
    def forward(self) -> SingleRowFunction:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        return SingleRowFunction("forward", 1 + self.n_q + 2 * self.n_v, self.n_v + 3, self._forward)

    @cached_property
    def check(self) -> SingleRowFunction:
        """(point without method state, generalised forces) → error of the accelerations of the point."""
        return SingleRowFunction("error", 1 + self.n_q + 3 * self.n_v + 6, 1, self._check)

    @cached_property
    def project(self) -> SingleRowFunction:
        """(t, q, v) → (q and v on the constraints, position residual), by least changes in the mass metric."""
        n = self.n_q + self.n_v
        return SingleRowFunction("nearest", 1 + n, n + 1, self._project)

    def refined(self, loads: Function) -> SingleRowFunction:
        """(q, v, forces, t) → as :class:`gauss.codegen.kernels.CorrectedRecursion`, with the same ``loads``."""
        n_in = self.n_q + 2 * self.n_v + 1
        return SingleRowFunction("corrected", n_in, self.n_v + 3, lambda code: self._refined(code, loads))

    @cached_property
    def _retracted(self) -> Function:
        return write(lambda q, step: retract(self.system, q, step), self.n_q, self.n_v, name="retracted")

    def _forward(self, code: RowCode):
        one = CallGraphEvaluation(self, code)
        one.at(code.at(code.given, 1), code.at(code.given, 1 + self.n_q))
        along = one.feedback(code.at(code.given, 1 + self.n_q))
        one.solve("motion", code.at(code.given, 1 + self.n_q + self.n_v))
        one.fill(code.found, self.n_v, lambda k: one.work["rates"][k] + along[k] if along else one.work["rates"][k])
        for k in range(3):
            code.put(code.found, self.n_v + k, code.motions.constant(0.0))

    def _check(self, code: RowCode):
        """Along rows with pivots below √μ accelerations are undetermined: their part of the residual is damped."""
        n_q, n_v, x = self.n_q, self.n_v, code.given
        one, found = CallGraphEvaluation(self, code), code.at(x, 1 + n_q + n_v + 3)
        one.at(code.at(x, 1), code.at(x, 1 + n_q))
        along = one.feedback(code.at(x, 1 + n_q))
        effort, accelerations = code.at(x, 1 + n_q + 2 * n_v + 6), Array(code.b, found)
        one.solve("motion", effort)
        if along:
            found = one.filled(n_v, lambda k: accelerations[k] - along[k])
        residual, rows = one.residual(found, effort)
        one.section.run("factor damped")
        rows = one.damped(rows)
        one.set_target(lambda k: rows[k])
        one.solve("response", residual.pointer)
        change = one.largest_rate(one.work["rates"])
        code.put(code.found, 0, (change / one.maximum(one.largest_rate(accelerations), self.floor)).value)

    def _refined(self, code: RowCode, loads: Function):
        n_q, n_v, x = self.n_q, self.n_v, code.given
        q, v, given, one = code.given, code.at(x, n_q), Array(code.b, x), CallGraphEvaluation(self, code)
        state, added = code.room(n_q + n_v + 1), code.room(n_v + 1)
        code.copy(state, x, n_q + n_v)
        code.copy(code.at(state, n_q + n_v), code.at(x, n_q + 2 * n_v), 1)
        code.call(loads, state, added)
        one.at(q, v)
        own, force = Array(code.b, added), Array(code.b, code.at(x, n_q + n_v))
        effort = one.filled(n_v, lambda k: force[k] + own[k])
        one.set_target(None)
        one.solve("motion", effort)
        found = Array(code.b, one.filled(n_v, lambda k: one.work["rates"][k]))
        residual, rows = one.residual(found.pointer, effort)
        one.set_target(lambda k: rows[k])
        one.solve("response", residual.pointer)
        change, left, scales = one.work["rates"], one.work["left"], one.scales()
        size = one.largest_rate(change) + one.largest(self.m, lambda k: left[k] / scales[k] / one.size(k))
        relative = size / one.maximum(one.largest_rate(found), self.floor)
        one.fill(code.found, n_v, lambda k: found[k] + change[k])
        off = own[n_v] + one.state_residual(v)
        total = one.sum(n_q + 2 * n_v + 1, lambda k: one.absolute(given[k]))
        for k, value in enumerate((relative, off, total), start=n_v):
            code.put(code.found, k, value.value)

    def _project(self, code: RowCode):
        (n_q, n_v), x, b = (self.n_q, self.n_v), code.given, code.b
        one, v, given = CallGraphEvaluation(self, code), Array(b, code.at(x, 1 + n_q)), code.room(n_q + n_v)
        code.copy(given, code.at(x, 1), n_q)
        one.at(given, v.pointer)
        (slack, phi), scales = one.ask("closure"), one.scales()
        none, last, size, count = one.zeros(n_v), one.number(np.inf), one.number(0.0), code.buffers.room(INTEGER, 1)
        b.store(INTEGER(0), count)
        moved = code.room(n_q)
        with endless_loop(b) as leave_if:
            one.set_target(lambda k: -(scales[k] * phi[k]))
            one.solve("response", none, iterations=1)
            one.fill(code.at(given, n_q), n_v, lambda k: one.work["rates"][k] + slack[k])
            code.call(self._retracted, given, moved)
            code.copy(given, moved, n_q)
            one.section.write("q", given)
            for kept, found in zip((slack, phi), one.ask("closure"), strict=True):
                code.copy(kept.pointer, found.pointer, n_v if kept is slack else self.m)
            size[0] = one.position_size(slack, phi)
            done = b.add(b.load(count), INTEGER(1))
            b.store(done, count)
            contracts = (size[0] > RESIDUAL_ROUNDOFF) & (size[0] < last[0] / 2.0)
            last[0] = size[0]
            leave_if((~contracts | (Value(b, done) >= MOST_NEWTON_STEPS)).value)
        one.at(given, v.pointer)
        dependent, residual = one.ask("slip")
        one.set_target(lambda k: -residual[k])
        one.solve("response", none)
        code.copy(code.found, given, n_q)
        one.fill(code.at(code.found, n_q), n_v, lambda k: dependent[k] + one.work["rates"][k])
        code.put(code.found, n_q + n_v, size[0].value)
