"""Weighted sums of slopes, base + h Σⱼ wⱼ kⱼ: one loop over entries and nonzero weights serves all sums of a method.

The weights are a table in compressed sparse rows. The entries of one motion are added a vector register at a time, so that a
row of slopes has a multiple of its length; entries of a batch of motions are vectors already.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Lanes, constant_array, counted_loop, vector_width
from gauss.codegen.kernels.row_code import RowCode, reduced
from gauss.codegen.text_builder import TextBuilder


class SlopeSums:
    """Emitter of the sums in one function.

    Parameters
    ----------
    size : int
        Numbers of a slope.
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
        terms, h = (
            [(i, lanes.constant(float(weight))) for i, weight in enumerate(weights) if weight],
            lanes.load(h, INTEGER(0)),
        )
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
