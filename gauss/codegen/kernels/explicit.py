"""Explicit Runge–Kutta steps: kᵢ = f(t + cᵢ h, y + h Σⱼ aᵢⱼ kⱼ) by calls, sums over stages as loops over the entries of y.

Unrolled sums would grow with the square of the number of stages. A row y of one motion is padded with zeros to ``stride``, a
multiple of the SIMD width; in a batch every entry is a SIMD vector already, and rows are not padded.
"""

from dataclasses import dataclass, field

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, LINE, POINTER, Function, Lanes, Writer, copy, machine
from gauss.codegen.kernels.adaptive import TRIAL_RESULTS, TRIAL_SETTINGS

BODY = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])


def stride(n_y: int) -> int:
    """Padded length of a row of n_y numbers."""
    return -(-n_y // machine.width()) * machine.width()


@dataclass(frozen=True, eq=False)
class ExplicitTrial:
    """Trial step: (point, *TRIAL_SETTINGS) → (point after, error, factor of the next step, cost, slopes).

    Parameters
    ----------
    A, b, c : ndarray, shape (s, s), (s,), (s,)
        Butcher tableau.
    errors : ndarray, shape (k, s + 1)
        Weights of the slopes, including that at the end, in the error estimates.
    size, row : int
        Numbers of a point, and of a row of y.
    indicator : int
        Entry of each slope that is passed to the step-size controller: the indicator of a singular configuration.
    start : Function
        Point → (y, y').
    slope : Function
        (point, t, y) → y'.
    finish : Function
        (point, h, change of y) → (point, y').
    control : Function
        Step-size controller: (point, *TRIAL_SETTINGS, point after, indicators, error estimates) → (error, factor,
        evaluations, factorisations).
    """

    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    errors: np.ndarray
    size: int
    row: int
    indicator: int
    start: Function
    slope: Function
    finish: Function
    control: Function
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "inputs", range(self.size + len(TRIAL_SETTINGS)))
        object.__setattr__(self, "outputs", range(self.size + TRIAL_RESULTS + (len(self.b) + 1) * self.row))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code for one motion, or for one per SIMD lane."""
        rows, size, row, s = _RowWriter(writer, "trial", self.row, width), self.size, self.row, len(self.b)
        x, out = rows.given, rows.found
        h, K = rows.number(x, size), rows.at(out, size + TRIAL_RESULTS)
        y0 = rows.begin(self.start, x, K)
        rows.stages(self.slope, x, size, h, y0, K, (self.A, self.c), 1)
        changed, found = rows.room(size + 1 + row), rows.room(size + row)
        rows.copy(changed, x, size)
        rows.put(changed, size, h)
        rows.combine(rows.at(changed, size + 1), None, h, self.b, K)
        rows.call(self.finish, changed, found)
        rows.copy(out, found, size)
        rows.copy(rows.at(K, s * row), rows.at(found, size), row)
        given = size + len(TRIAL_SETTINGS)
        judged = rows.room(given + size + s + 1 + len(self.errors) * row)
        rows.copy(judged, x, given)
        rows.copy(rows.at(judged, given), out, size)
        for k in range(s + 1):
            rows.put(judged, given + size + k, rows.number(K, k * row + self.indicator))
        for k, weights in enumerate(self.errors):
            rows.combine(rows.at(judged, given + size + s + 1 + k * row), None, None, weights, K)
        rows.call(self.control, judged, rows.at(out, size))
        return rows.done()


@dataclass(frozen=True, eq=False)
class Interpolation:
    """Dense output: (point, point after, h, slopes) → coefficients, by additional stages and sums of all slopes.

    Parameters
    ----------
    A, c : ndarray, shape (m, s + 1 + m), (m,)
        Additional stages.
    weights : ndarray, shape (k, s + 1 + m)
        Weights of the slopes in the coefficients, each times h.
    size, row : int
        Numbers of a point, and of a row of y.
    start, slope : Function
        As in :class:`ExplicitTrial`.
    """

    A: np.ndarray
    c: np.ndarray
    weights: np.ndarray
    size: int
    row: int
    start: Function
    slope: Function
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        known = self.A.shape[1] - len(self.c)
        object.__setattr__(self, "inputs", range(2 * self.size + 1 + known * self.row))
        object.__setattr__(self, "outputs", range(len(self.weights) * self.row))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code for one motion, or for one per SIMD lane."""
        rows, size, row = _RowWriter(writer, "interpolation", self.row, width), self.size, self.row
        x, known = rows.given, self.A.shape[1] - len(self.c)
        h, K = rows.number(x, 2 * size), rows.room(self.A.shape[1] * row)
        y0 = rows.begin(self.start, x, K)
        rows.copy(K, rows.at(x, 2 * size + 1), known * row)
        rows.stages(self.slope, x, size, h, y0, K, (self.A, self.c), known)
        for k, weights in enumerate(self.weights):
            rows.combine(rows.at(rows.found, k * row), None, h, weights, K)
        return rows.done()


class _RowWriter:
    """Emitter of a function on rows y of ``size`` numbers, for ``width`` motions."""

    def __init__(self, writer: Writer, name: str, size: int, width: int):
        self.writer, self.size, self.width = writer, size, width
        self.function = ir.Function(writer.module, BODY, name=writer.module.get_unique_name(name))
        self.function.linkage = "internal"
        self.given, _, self.found, _ = self.function.args
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        self.motions = Lanes(writer.module, width, self.b)
        self.block = Lanes(writer.module, machine.width(), self.b) if width == 1 else self.motions

    def room(self, size: int):
        """Buffer of ``size`` numbers."""
        with self.b.goto_entry_block():
            room = self.b.alloca(DOUBLE, max(size * self.width, 1))
        room.align = LINE
        return room

    def at(self, pointer, offset: int):
        """Pointer to an entry."""
        return self.b.gep(pointer, [INTEGER(offset * self.width)])

    def number(self, pointer, offset: int):
        """Read a number."""
        return self.motions.load(pointer, INTEGER(offset * self.width))

    def put(self, pointer, offset: int, value):
        """Write a number."""
        self.motions.store(value, pointer, INTEGER(offset * self.width))

    def copy(self, target, source, size: int):
        """Copy numbers; the two do not overlap."""
        copy(self.b, target, source, size * self.width)

    def call(self, function: Function, given, found):
        """Call a traced function."""
        apart = INTEGER(self.width)
        self.b.call(self.writer.body(function, self.width), [given, apart, found, apart])

    def begin(self, start: Function, x, K):
        """Row y of a point; its slope becomes the first of K."""
        both = self.room(2 * self.size)
        self.call(start, x, both)
        self.copy(K, self.at(both, self.size), self.size)
        return both

    def stages(self, slope: Function, x, size: int, h, y0, K, method, first: int):
        """Compute the slopes from stage ``first`` on; earlier ones are known."""
        A, c = method
        given = self.room(size + 1 + self.size)
        self.copy(given, x, size)
        known = A.shape[1] - len(c)
        for i in range(first - known, len(c)):
            self.put(given, size, self.motions.fused("fma", self.motions.constant(float(c[i])), h, self.number(x, 0)))
            self.combine(self.at(given, size + 1), y0, h, A[i, : known + i], K)
            self.call(slope, given, self.at(K, (known + i) * self.size))

    def combine(self, target, base, h, weights, K):
        """Write ``target = base + h · weights @ K``; without base or h where they are None."""
        terms = [(i, float(weight)) for i, weight in enumerate(weights) if weight]
        lanes, b = self.block, self.b
        h = h if h is None or self.width > 1 else lanes.broadcast(h)

        def block(k):
            total = None
            for i, weight in terms:
                slope = lanes.load(K, b.add(k, INTEGER(i * self.size * self.width)))
                weight = lanes.constant(weight)
                total = b.fmul(slope, weight) if total is None else lanes.fused("fma", slope, weight, total)
            if base is not None:
                total = lanes.fused("fma", total, h, lanes.load(base, k))
            elif h is not None:
                total = b.fmul(total, h)
            lanes.store(total, target, k)

        self._each_block(block)

    def done(self) -> ir.Function:
        """End the function."""
        self.b.ret_void()
        return self.function

    def _each_block(self, body):
        """Write a loop over the entries of a row, a vector register at a time."""
        before = self.b.block
        inside, after = (self.function.append_basic_block(name) for name in ("inside", "after"))
        self.b.branch(inside)
        self.b.position_at_end(inside)
        k = self.b.phi(INTEGER)
        k.add_incoming(INTEGER(0), before)
        body(k)
        following = self.b.add(k, INTEGER(self.block.width))
        k.add_incoming(following, inside)
        self.b.cbranch(self.b.icmp_signed("<", following, INTEGER(self.size * self.width)), inside, after)
        self.b.position_at_end(after)
