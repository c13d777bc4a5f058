"""Machine code of one evaluation of a call graph: a solution for accelerations and multipliers, and norms of vectors.

Multipliers by proximal iterations λ ← λ + (S + μ)⁻¹ (K q̈(λ) − target), with q̈(λ) by the articulated-body recursion
(Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained dynamic equations, RSS 2021).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, NativeFunction, Writer, endless_loop, intrinsic
from gauss.codegen.kernels import RecordedSections, RowCode, SectionCode
from gauss.codegen.kernels.arrays import Array, Value
from gauss.dynamics.call_graph import DAMPED
from gauss.system import System

MOST_ITERATIONS = 6  # of the proximal method
LEAST_ITERATIONS = 3  # of it, as many as straight-line code takes
CONTRACTION = 0.1  # of an iteration: above, further ones only amplify a near-null constraint direction
CONVERGED = 1e-15  # change of accelerations relative to the largest, the round-off
WORK = "effort", "target", "rates", "multipliers", "left"  # vectors that a solution reads and writes


@dataclass(frozen=True, eq=False)
class RecordedSystem:
    """A system with loops whose recursions are recorded."""

    system: System
    sections: RecordedSections  # its recursions, recorded
    sizes: np.ndarray  # (m,) scales of the residuals of its rows
    floor: float  # acceleration below which errors are no longer relative to it, in coordinates of the scene [1/s²]
    gains: tuple[float, float] | None = None  # gains α and β [1/s] of the Baumgarte feedback −2α φ̇ − β² φ

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
    def solvers(self) -> dict[str, "ProximalIteration"]:
        """Solutions under gravity and velocities, and under forces alone."""
        return {section: ProximalIteration(self, section) for section in ("motion", "response")}


class ProximalIteration(NativeFunction):
    """(memory, iterations, vectors WORK in a row, 0): accelerations and multipliers under forces, with targets of rows.

    Results are joint accelerations, multipliers, and the residual of the scaled rows.
    """

    def __init__(self, owner: RecordedSystem, section: str):
        self.owner, self.section, self.name = owner, section, f"solve_{section}"

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state at a time."""
        code = RowCode(writer, self.begin_scalar(writer.module, width), width)
        one, most, b = (
            CallGraphEvaluation(self.owner, code, code.given, code.found),
            Value(code.b, code.function.args[1]),
            code.b,
        )
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
            change, roundoff = one.largest(n, lambda k: rates[k] - before[k]), one.largest(n, lambda k: rates[k]) * CONVERGED
            done = Value(b, b.add(b.load(count), INTEGER(1)))
            b.store(done.value, count)
            next_is_roundoff = change * change <= roundoff * last[0]  # at the same rate of convergence
            stalls = (done >= LEAST_ITERATIONS) & (next_is_roundoff | (change > last[0] * CONTRACTION))
            last[0] = change
            leave_if((~(change > roundoff) | stalls | (done >= most)).value)
        one.fill(rows.pointer, m, lambda k: rows[k] - work["target"][k])
        return code.done()

    def _run(self, one: "CallGraphEvaluation"):
        one.section.write("multipliers", one.work["multipliers"].pointer)
        for kept, found, count in zip(("rates", "left"), one.ask(self.section), (self.owner.n_v, self.owner.m), strict=True):
            one.code.copy(one.work[kept].pointer, found.pointer, count)


class CallGraphEvaluation:
    """Emitter of one evaluation: its memory, and arrays WORK of one solution."""

    def __init__(self, owner: RecordedSystem, code: RowCode, memory=None, work=None):
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

    def damped(self, rows: Array) -> Array:
        """Residual of the rows less its part along rows whose pivots are small, twice."""
        for _ in range(2):
            solved, before = self.multipliers("damped", rows.pointer), rows
            term = lambda k, solved=solved, before=before: before[k] - solved[k] * DAMPED  # noqa: E731
            rows = Array(self.code.b, self.filled(self.owner.m, term))
        return rows

    def set_target(self, term: Callable[[Value], Value] | None):
        """Set the target of the rows; zero without a term."""
        self.fill(self.work["target"].pointer, self.owner.m, term or (lambda k: self.constant(0.0)))

    def solve(self, section: str, effort, iterations: int = MOST_ITERATIONS):
        """Accelerations, multipliers and residual under forces, with the target of the rows that is set."""
        self.code.copy(self.work["effort"].pointer, effort, self.owner.n_v)
        solver = self.code.writer.body(self.owner.solvers[section])
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
