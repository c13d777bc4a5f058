"""Explicit Runge–Kutta steps: kᵢ = f(t + cᵢ h, y + h Σⱼ aᵢⱼ kⱼ) by calls, sums over stages as loops over the entries of y.

Unrolled, the code would grow with the square of the number of stages. A row y of one motion is padded with zeros to
``stride``, a multiple of the SIMD width; in a batch every entry is a SIMD vector already, and rows are not padded.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from llvmlite import ir

from gauss.codegen import (
    INTEGER,
    POINTER,
    Function,
    Lanes,
    NativeFunction,
    Writer,
    constant_array,
    counted_loop,
    processor,
    vector_width,
)
from gauss.codegen.kernels.adaptive import TRIAL_RESULTS, TRIAL_SETTINGS
from gauss.codegen.kernels.row_code import RowCode, reduced
from gauss.codegen.text_builder import TextBuilder


def stride(n_y: int) -> int:
    """Padded length of a row of n_y numbers."""
    return -(-n_y // processor.width()) * processor.width()


@dataclass(frozen=True, eq=False)
class ExplicitTrial(NativeFunction):
    """Trial step: ``(point, *TRIAL_SETTINGS)`` → (point after, error, factor of the next step, cost, slopes).

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
        Step-size controller: ``(point, *TRIAL_SETTINGS, point after, indicators, error estimates)`` → (error, factor,
        evaluations, factorisations).
    """

    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    errors: np.ndarray
    size: int
    row: int
    indicator: int
    start: Function | NativeFunction
    slope: Function | NativeFunction
    finish: Function | NativeFunction
    control: Function | NativeFunction
    name = "trial"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return self.size + len(TRIAL_SETTINGS), self.size + TRIAL_RESULTS + (len(self.b) + 1) * self.row

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code for one motion, or for one per SIMD lane."""
        rows, size, row, s = RowCode(writer, self.begin(writer.module), width), self.size, self.row, len(self.b)
        sums = SlopeSums(rows, [*self.A[1:], self.b, *self.errors], row)
        x, out = rows.given, rows.found
        h, K = rows.at(x, size), rows.at(out, size + TRIAL_RESULTS)
        y0 = _begin(rows, self.start, x, K, row)
        _stages(rows, self.slope, x, size, h, y0, K, self.c[1:], 1, sums)
        changed, found = rows.room(size + 1 + row), rows.room(size + row)
        rows.copy(changed, x, size + 1)
        sums.write(rows.at(changed, size + 1), sums.zeros(), h, INTEGER(s - 1), K)
        rows.call(self.finish, changed, found)
        rows.copy(out, found, size)
        rows.copy(rows.at(K, s * row), rows.at(found, size), row)
        given = size + len(TRIAL_SETTINGS)
        inputs = rows.room(given + size + s + 1 + len(self.errors) * row)
        rows.copy(inputs, x, given)
        rows.copy(rows.at(inputs, given), out, size)
        for k in range(s + 1):
            rows.put(inputs, given + size + k, rows.number(K, k * row + self.indicator))
        one = rows.room(1)
        rows.put(one, 0, rows.motions.constant(1.0))
        for k in range(len(self.errors)):
            sums.write(rows.at(inputs, given + size + s + 1 + k * row), sums.zeros(), one, INTEGER(s + k), K)
        rows.call(self.control, inputs, rows.at(out, size))
        return rows.done()


@dataclass(frozen=True, eq=False)
class Interpolation(NativeFunction):
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
    start: Function | NativeFunction
    slope: Function | NativeFunction
    name = "interpolation"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        known = self.A.shape[1] - len(self.c)
        return 2 * self.size + 1 + known * self.row, len(self.weights) * self.row

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code for one motion, or for one per SIMD lane."""
        rows, size, row = RowCode(writer, self.begin(writer.module), width), self.size, self.row
        x, known, m = rows.given, self.A.shape[1] - len(self.c), len(self.c)
        sums = SlopeSums(rows, [*self.A, *self.weights], row)
        h, K = rows.at(x, 2 * size), rows.room(self.A.shape[1] * row)
        y0 = _begin(rows, self.start, x, K, row)
        rows.copy(K, rows.at(x, 2 * size + 1), known * row)
        _stages(rows, self.slope, x, size, h, y0, K, self.c, known, sums)
        for k in rows.each(len(self.weights)):
            target = rows.at(rows.found, rows.b.mul(k, INTEGER(row)))
            sums.write(target, sums.zeros(), h, rows.shifted(k, m), K)
        return rows.done()


def _begin(rows: RowCode, start: Function | NativeFunction, x, K, size: int):
    """Row y of a point; its slope becomes the first of K."""
    both = rows.room(2 * size)
    rows.call(start, x, both)
    rows.copy(K, rows.at(both, size), size)
    return both


def _stages(rows: RowCode, slope: Function | NativeFunction, x, size: int, h, y0, K, nodes: np.ndarray, known: int, sums):
    """Compute the slopes of stages at t + c h, by a loop over their nodes c; ``known`` slopes precede them."""
    b, row = rows.b, sums.size
    given = rows.room(size + 1 + row)
    rows.copy(given, x, size)
    for i in rows.each(len(nodes)):
        node = rows.motions.broadcast(rows.constant(f"{rows.function.name}_nodes", nodes, i))
        rows.put(given, size, rows.motions.fused("fma", node, rows.number(h, 0), rows.number(x, 0)))
        sums.write(rows.at(given, size + 1), y0, h, i, K)
        rows.call(slope, given, rows.at(K, b.mul(b.add(i, INTEGER(known)), INTEGER(row))))


class SlopeSums:
    """Emitter of weighted sums of slopes of ``size`` numbers, base + h Σⱼ wⱼ kⱼ, in one function.

    One loop over entries and nonzero weights, a table in compressed sparse rows, serves all sums of a method. The entries of
    one motion are added a vector register at a time, so that a row of slopes has a multiple of its length; entries of a
    batch of motions are vectors already.
    """

    def __init__(self, rows: RowCode, weights: Sequence[np.ndarray], size: int):
        self.rows, self.size, self.weights = rows, size, weights
        entries = [(i, weight) for sum_of in weights for i, weight in enumerate(sum_of) if weight]
        counts = [np.count_nonzero(sum_of) for sum_of in weights]
        table = {
            "first": np.cumsum([0, *counts]),
            "place": np.array([i * size * rows.width for i, _ in entries], dtype=int),
            "weight": np.array([weight for _, weight in entries], dtype=float),
        }
        module, name = rows.writer.module, rows.function.name
        self.first, place, weight = (constant_array(module, f"{name}_{key}", values) for key, values in table.items())
        self.table = [rows.b.bitcast(weight, POINTER), rows.b.bitcast(place, INTEGER.as_pointer())]

    def write(self, target, base, h, k, K):
        """Write sum k to an array: ``target = base + h · weights[k] @ K``."""
        if self.rows.is_batch:
            self._unrolled(target, base, h, self.weights[k.constant], K)
            return
        b, name = self.rows.b, f"slope_sum_{self.size}_{self.rows.width}"
        code = self.rows.writer.module.globals.get(name) or self._code(name)
        first = b.bitcast(self.first, INTEGER.as_pointer())
        bounds = [b.load(b.gep(first, [b.add(k, INTEGER(j))])) for j in (0, 1)]
        b.call(code, [target, base, h, *self.table, *bounds, K])

    def _unrolled(self, target, base, h, weights: np.ndarray, K):
        """Write a sum for a batch, its terms unrolled: that runs for long."""
        b, lanes, width = self.rows.b, self.rows.motions, self.rows.width
        terms = [(i, lanes.constant(float(weight))) for i, weight in enumerate(weights) if weight]
        h = lanes.load(h, INTEGER(0))
        with counted_loop(b, INTEGER(0), INTEGER(self.size * width), width) as k:
            slopes = [(lanes.load(K, b.add(k, INTEGER(i * self.size * width))), weight) for i, weight in terms]
            total = b.fmul(*slopes[0])
            for slope, weight in slopes[1:]:
                total = lanes.fused("fma", slope, weight, total)
            lanes.store(lanes.fused("fma", total, h, lanes.load(base, k)), target, k)

    def zeros(self) -> ir.Constant:
        """Row of zeros."""
        length = self.size * self.rows.width
        return self.rows.b.bitcast(constant_array(self.rows.writer.module, f"zeros_{length}", np.zeros(length)), POINTER)

    def _code(self, name: str) -> ir.Function:
        """Function (target, base, h, weights, places, first and last weight, slopes)."""
        width, module, integers = self.rows.width, self.rows.writer.module, INTEGER.as_pointer()
        kinds = [POINTER, POINTER, POINTER, POINTER, integers, INTEGER, INTEGER, POINTER]
        code = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name)
        code.linkage = "internal"
        target, base, h, weights, places, first, last, K = code.args
        target.add_attribute("noalias")
        b = TextBuilder(code.append_basic_block("entry"))
        lanes = Lanes(module, vector_width(module) if width == 1 else width, b)
        h = lanes.broadcast(b.load(h)) if width == 1 else lanes.load(h, INTEGER(0))

        def term(j, k):
            """Weight j, and entry k of its slope."""
            place = b.add(k, b.load(b.gep(places, [j])))
            return lanes.broadcast(b.load(b.gep(weights, [j]))), lanes.load(K, place)

        def added(j, total, k):
            weight, slope = term(j, k)
            return lanes.fused("fma", weight, slope, total)

        with counted_loop(b, INTEGER(0), INTEGER(self.size * width), lanes.width) as k:
            start, second = b.fmul(*term(first, k)), b.add(first, INTEGER(1))
            total = reduced(b, second, last, start, partial(added, k=k))
            lanes.store(lanes.fused("fma", total, h, lanes.load(base, k)), target, k)
        b.ret_void()
        return code
