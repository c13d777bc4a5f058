"""Machine code of a call graph: constrained forward dynamics, their check and projection.

Multipliers by proximal iterations λ ← λ + (S + μ)⁻¹ (K q̈(λ) − target), with q̈(λ) by the articulated-body recursion
(Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained dynamic equations, RSS 2021). Accelerations
are checked by the residual of inverse dynamics, and corrected by it once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, Function, NativeFunction, Writer, endless_loop, intrinsic, write
from gauss.codegen.kernels import RecordedSections, RowCode, RowFunction, SectionCode
from gauss.codegen.kernels.arrays import Array, Value
from gauss.dynamics.call_graph import DAMPED
from gauss.dynamics.projection import RESIDUAL_ROUNDOFF
from gauss.system import System, retract

MOST_ITERATIONS = 6  # of the proximal method
LEAST_ITERATIONS = 3  # of it, as many as straight-line code takes
CONTRACTION = 0.1  # of an iteration: above, further ones only amplify a near-null constraint direction
CONVERGED = 1e-15  # change of accelerations relative to the largest, the round-off
MOST_NEWTON_STEPS = 4  # in position after an integration step, on one factorisation
WORK = "effort", "target", "rates", "multipliers", "left"  # vectors that a solution reads and writes


@dataclass(frozen=True, eq=False)
class CallGraphCode:
    """Functions of a system with loops.

    Parameters
    ----------
    system : System
        The system.
    sections : RecordedSections
        Its recursions, recorded.
    sizes : ndarray, shape (m,)
        Scales of the residuals of its rows.
    floor : float
        Acceleration below which errors are no longer relative to it, in coordinates of the scene [1/s²].
    gains : tuple of float, optional
        Gains α and β [1/s] of the Baumgarte feedback −2α φ̇ − β² φ.
    """

    system: System
    sections: RecordedSections
    sizes: np.ndarray
    floor: float
    gains: tuple[float, float] | None = None

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return self.system.n_q

    @property
    def n_v(self) -> int:
        """Number of rates."""
        return self.system.n_v

    @property
    def m(self) -> int:
        """Number of rows."""
        return self.sizes.size

    @cached_property
    def forward(self) -> RowFunction:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        return RowFunction("forward", 1 + self.n_q + 2 * self.n_v, self.n_v + 3, self._forward)

    @cached_property
    def check(self) -> RowFunction:
        """(point without method state, generalised forces) → error of the accelerations of the point."""
        return RowFunction("error", 1 + self.n_q + 3 * self.n_v + 6, 1, self._check)

    @cached_property
    def project(self) -> RowFunction:
        """(t, q, v) → (q and v on the constraints, position residual), by least changes in the mass metric."""
        n = self.n_q + self.n_v
        return RowFunction("nearest", 1 + n, n + 1, self._project)

    def refined(self, loads: Function) -> RowFunction:
        """(q, v, forces, t) → as :class:`gauss.codegen.kernels.CorrectedRecursion`, with the same ``loads``."""
        n_in = self.n_q + 2 * self.n_v + 1
        return RowFunction("corrected", n_in, self.n_v + 3, lambda code: self._refined(code, loads))

    @cached_property
    def _solvers(self) -> dict[str, "_ProximalIteration"]:
        return {section: _ProximalIteration(self, section) for section in ("motion", "response")}

    @cached_property
    def _retracted(self) -> Function:
        return write(lambda q, step: retract(self.system, q, step), self.n_q, self.n_v, name="retracted")

    def _forward(self, code: RowCode):
        one = _Evaluation(self, code)
        one.at(code.at(code.given, 1), code.at(code.given, 1 + self.n_q))
        along = one.feedback(code.at(code.given, 1 + self.n_q))
        one.solve("motion", code.at(code.given, 1 + self.n_q + self.n_v))
        one.fill(code.found, self.n_v, lambda k: one.work["rates"][k] + along[k] if along else one.work["rates"][k])
        for k in range(3):
            code.put(code.found, self.n_v + k, code.motions.constant(0.0))

    def _check(self, code: RowCode):
        """Along rows with pivots below √μ accelerations are undetermined: their part of the residual is damped."""
        n_q, n_v, x = self.n_q, self.n_v, code.given
        one, found = _Evaluation(self, code), code.at(x, 1 + n_q + n_v + 3)
        one.at(code.at(x, 1), code.at(x, 1 + n_q))
        along = one.feedback(code.at(x, 1 + n_q))
        effort, accelerations = code.at(x, 1 + n_q + 2 * n_v + 6), Array(code.b, found)
        one.solve("motion", effort)
        if along:
            found = one.filled(n_v, lambda k: accelerations[k] - along[k])
        residual, rows = one.residual(found, effort)
        for _ in range(2):
            solved = one.multipliers("damped", rows.pointer)
            one.fill(rows.pointer, self.m, lambda k, rows=rows, solved=solved: rows[k] - solved[k] * DAMPED)
        one.set_target(lambda k: rows[k])
        one.solve("response", residual.pointer)
        change = one.largest_rate(one.work["rates"])
        code.put(code.found, 0, (change / one.maximum(one.largest_rate(accelerations), self.floor)).value)

    def _refined(self, code: RowCode, loads: Function):
        n_q, n_v, x = self.n_q, self.n_v, code.given
        q, v, given, one = code.given, code.at(x, n_q), Array(code.b, x), _Evaluation(self, code)
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
        one, v, given = _Evaluation(self, code), Array(b, code.at(x, 1 + n_q)), code.room(n_q + n_v)
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


class _ProximalIteration(NativeFunction):
    """(memory, iterations, vectors WORK in a row, 0): accelerations and multipliers under forces, with a target of the rows.

    Results are joint accelerations, multipliers, and the residual of the scaled rows.
    """

    def __init__(self, owner: CallGraphCode, section: str):
        self.owner, self.section, self.name = owner, section, f"solve_{section}"

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state at a time."""
        code = RowCode(writer, self.begin_scalar(writer.module, width), width)
        one, most, b = _Evaluation(self.owner, code, code.given, code.found), Value(code.b, code.function.args[1]), code.b
        n, m, section, work = self.owner.n_v, self.owner.m, one.section, one.work
        rates, rows, multipliers = work["rates"], work["left"], work["multipliers"]
        before, last, count = Array(b, code.room(n)), one.number(np.inf), code.buffers.room(INTEGER, 1)
        b.store(INTEGER(0), count)
        section.write("effort", work["effort"].pointer)
        one.fill(multipliers.pointer, m, lambda k: one.constant(0.0))
        self._run(one)
        with endless_loop(b) as leave_if:
            step = one.multipliers("multipliers", one.filled(m, lambda k: rows[k] - work["target"][k]))
            one.fill(multipliers.pointer, m, lambda k: multipliers[k] + step[k])
            code.copy(before.pointer, rates.pointer, n)
            self._run(one)
            change = one.largest(n, lambda k: rates[k] - before[k])
            done = Value(b, b.add(b.load(count), INTEGER(1)))
            b.store(done.value, count)
            converged = ~(change > one.largest(n, lambda k: rates[k]) * CONVERGED)
            stalls = (done >= LEAST_ITERATIONS) & (change > last[0] * CONTRACTION)
            last[0] = change
            leave_if((converged | stalls | (done >= most)).value)
        one.fill(rows.pointer, m, lambda k: rows[k] - work["target"][k])
        return code.done()

    def _run(self, one: "_Evaluation"):
        one.section.write("multipliers", one.work["multipliers"].pointer)
        for kept, found, count in zip(("rates", "left"), one.ask(self.section), (self.owner.n_v, self.owner.m), strict=True):
            one.code.copy(one.work[kept].pointer, found.pointer, count)


class _Evaluation:
    """Emitter of one evaluation: its memory, and arrays WORK of one solution."""

    def __init__(self, owner: CallGraphCode, code: RowCode, memory=None, work=None):
        self.owner, self.code, self.section = owner, code, SectionCode(code, owner.sections, memory)
        counts = [owner.n_v if name in ("effort", "rates") else owner.m for name in WORK]
        self.room = code.room(sum(counts)) if work is None else work
        places = np.cumsum([0, *counts])
        self.work = {name: Array(code.b, code.at(self.room, int(k))) for name, k in zip(WORK, places, strict=False)}

    def constant(self, value: float) -> Value:
        """Return a constant."""
        return Value(self.code.b, self.code.motions.constant(value))

    def number(self, value: float) -> Array:
        """Return a variable."""
        found = Array(self.code.b, self.code.room(1))
        found[0] = self.constant(value)
        return found

    def fill(self, target, count: int, term: Callable[[Value], Value]):
        """Write ``term(k)`` to each entry."""
        for k in self.code.each(count):
            self.code.put(target, k, term(Value(self.code.b, k)).value)

    def filled(self, count: int, term: Callable[[Value], Value]):
        """Write the same to a new buffer."""
        target = self.code.room(count)
        self.fill(target, count, term)
        return target

    def zeros(self, count: int):
        """Buffer of zeros."""
        return self.filled(count, lambda k: self.constant(0.0))

    def absolute(self, x: Value) -> Value:
        """Absolute value."""
        return Value(x.b, x.b.call(intrinsic(self.code.writer.module, "llvm.fabs", DOUBLE, 1), [x.value]))

    def maximum(self, x: Value, least: float) -> Value:
        """The larger one of a number and a constant."""
        bound = self.constant(least)
        return Value(x.b, x.b.select((x > bound).value, x.value, bound.value))

    def sum(self, count: int, term: Callable[[Value], Value]) -> Value:
        """Sum of ``term(k)``."""
        b = self.code.b
        add = lambda k, total: (Value(b, total) + term(Value(b, k))).value  # noqa: E731
        return Value(b, self.code.reduced(count, self.code.motions.constant(0.0), add))

    def largest(self, count: int, term: Callable[[Value], Value]) -> Value:
        """Largest absolute value of ``term(k)``; NaN if one is NaN."""
        b = self.code.b

        def following(k, most):
            x, most = self.absolute(term(Value(b, k))), Value(b, most)
            return b.select(((x > most) | ~(x <= x)).value, x.value, most.value)  # noqa: PLR0124 (NaN is not itself)

        return Value(b, self.code.reduced(count, self.code.motions.constant(0.0), following))

    def entry(self, name: str, values: np.ndarray, k: Value) -> Value:
        """Entry of a constant array."""
        return Value(self.code.b, self.code.constant(name, values, k.value))

    def unit(self, k: Value) -> Value:
        """Unit of a rate."""
        return self.entry("rate_units", self.owner.system.scale.coordinates, k)

    def size(self, k: Value) -> Value:
        """Scale of the residual of a row."""
        return self.entry("row_sizes", self.owner.sizes, k)

    def largest_rate(self, rates: Array) -> Value:
        """Largest of some rates or accelerations, in their units."""
        return self.largest(self.owner.n_v, lambda k: rates[k] / self.unit(k))

    def at(self, q, v):
        """Set a state, and factor there."""
        self.section.write("q", q)
        self.section.write("v", v)
        self.section.run("factor")

    def ask(self, section: str) -> tuple[Array, Array]:
        """Run a section; its results along rates, and by row."""
        self.section.run(section)
        return self._read(f"{section} rates"), self._read(f"{section} rows")

    def _read(self, name: str) -> Array:
        return Array(self.code.b, self.section.read(name))

    def scales(self) -> Array:
        """Factors of the rows, at the present state."""
        return self._read("scales")

    def multipliers(self, section: str, residual) -> Array:
        """Solve (S + μ) λ = residual."""
        self.section.write("gap", residual)
        self.section.run(section)
        return self._read(f"solved {section}")

    def set_target(self, term: Callable[[Value], Value] | None):
        """Set the target of the rows; zero without a term."""
        self.fill(self.work["target"].pointer, self.owner.m, term or (lambda k: self.constant(0.0)))

    def solve(self, section: str, effort, iterations: int = MOST_ITERATIONS):
        """Accelerations, multipliers and residual under forces, with the target of the rows that is set."""
        self.code.copy(self.work["effort"].pointer, effort, self.owner.n_v)
        solver = self.code.writer.body(self.owner._solvers[section])
        self.code.b.call(solver, [self.section.memory, INTEGER(iterations), self.room, INTEGER(0)])

    def residual(self, found, effort) -> tuple[Array, Array]:
        """Residuals of the equations of motion, by inverse dynamics, and of the rows, of the last solution."""
        given = {"rates": found, "multipliers": self.work["multipliers"].pointer, "effort": effort}
        for name, values in given.items():
            self.section.write(name, values)
        residual, rows = self.ask("residual")
        left = self.filled(self.owner.m, lambda k: self.work["target"][k] - rows[k])
        return residual, Array(self.code.b, left)

    def feedback(self, v) -> Array | None:
        """Set the Baumgarte feedback of the rows as target; that of the accelerations along loop joints, if there is any."""
        if self.owner.gains is None:
            self.set_target(None)
            return None
        (alpha, beta), rates, scales = self.owner.gains, Array(self.code.b, v), self.scales()
        slack, phi = self.ask("closure")
        dependent, residual = self.ask("slip")
        self.set_target(lambda k: residual[k] * (-2.0 * alpha) - scales[k] * phi[k] * beta**2)
        along = self.filled(self.owner.n_v, lambda k: slack[k] * beta**2 + (dependent[k] - rates[k]) * (2.0 * alpha))
        return Array(self.code.b, along)

    def state_residual(self, v) -> Value:
        """Constraint residual of the state, in position and velocity, relative."""
        rates, scales, system = Array(self.code.b, v), self.scales(), self.owner.system
        slack, phi = self.ask("closure")
        dependent, residual = self.ask("slip")
        off = self.largest_rate(Array(self.code.b, self.filled(system.n_v, lambda k: dependent[k] - rates[k])))
        off = self._larger(off, self.largest(self.owner.m, lambda k: residual[k] / scales[k] / self.size(k)))
        fastest = self.largest_rate(rates) + 1.0 / system.scale.time
        return self._larger(self.position_size(slack, phi), off / fastest)

    def position_size(self, slack: Array, phi: Array) -> Value:
        """Largest error of the coordinates of loop joints, and position residual, relative to their scales."""
        return self._larger(self.largest_rate(slack), self.largest(self.owner.m, lambda k: phi[k] / self.size(k)))

    def _larger(self, x: Value, y: Value) -> Value:
        """The larger one of two numbers; NaN if one is NaN."""
        return Value(x.b, x.b.select(((x > y) | ~(x <= x)).value, x.value, y.value))  # noqa: PLR0124 (NaN is not itself)
