"""Sums in machine code, several at a time: each in its own order, none of which waits for the additions of another.

The result of an addition is ready after four cycles, and two can begin in each: one sum after the other takes four times
as long. Terms that are structurally zero are left out by bounds, which changes no result.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER
from gauss.codegen.kernels.arrays import INTEGERS, Array, Routine, Value, subroutine

LANES = 4  # sums at a time
PRODUCTS = "row_products"  # function of a module

Bounds = Callable[[Sequence[Value]], tuple[Value, Value]]


def each_sum(
    r: Routine,
    count: Value,
    bounds: Bounds,
    add: Callable[[Value, Value, Value], Value],
    done: Callable[[Value, Value], None],
    first: Value | int = 0,
    initial: Callable[[Value], Value | float] = lambda i: 0.0,
):
    """Emit sums i from ``first`` to ``count`` − 1.

    Parameters
    ----------
    r : Routine
        Where code is emitted.
    bounds : callable
        Numbers of some sums → first place and end of their terms.
    add : callable
        (total, i, p) → total with the term p of the sum i.
    done : callable
        (i, total): what is done with a sum.
    initial : callable
        i → where the sum begins.
    """
    place = r.variable(first, INTEGER)
    for size in (LANES, 1):
        with r.loop() as leave_if:
            i = place[0]
            leave_if(i + size > count)
            lanes = [i + k for k in range(size)]
            totals = [r.variable(initial(one)) for one in lanes]
            begin, end = bounds(lanes)
            with r.each(end, begin) as p:
                for one, total in zip(lanes, totals, strict=True):
                    total[0] = add(total[0], one, p)
            for one, total in zip(lanes, totals, strict=True):
                done(one, total[0])
            place[0] = i + size


def lower(x: Value, y: Value) -> Value:
    """Lower of two integers."""
    return Value(x.b, x.b.select((x < y).value, x.value, y.value))


def higher(x: Value, y: Value) -> Value:
    """Higher of two integers."""
    return Value(x.b, x.b.select((x > y).value, x.value, y.value))


class RowBounds(NamedTuple):
    """First place and end of what differs from zero in each row of a matrix."""

    begin: Array
    end: Array

    def around(self, rows: Sequence[Value]) -> tuple[Value, Value]:
        """Bounds of some rows together."""
        found = self.begin[rows[0]], self.end[rows[0]]
        for row in rows[1:]:
            found = lower(found[0], self.begin[row]), higher(found[1], self.end[row])
        return found


def row_products(r: Routine, matrix: Array, columns: Value, count: Value, vector: Array, bounds: RowBounds, target: Array):
    """Call the product of the first rows of a matrix and a vector; terms outside the bounds of the rows are left out.

    Parameters
    ----------
    r : Routine
        Where code is emitted; its module holds the product once.
    columns : Value
        Columns of the matrix.
    count : Value
        Number of rows.
    bounds : RowBounds
        Bounds of all rows.
    """
    function = r.module.globals.get(PRODUCTS) or _write_products(r.module)
    r.call(function, columns, count, matrix, vector, bounds.begin, bounds.end, target)


def _write_products(module: ir.Module) -> ir.Function:
    r = subroutine(module, PRODUCTS, [INTEGER, INTEGER, POINTER, POINTER, INTEGERS, INTEGERS, POINTER])
    (columns, count), (matrix, vector, begin, end, target) = r.integers, r.arrays

    def add(total: Value, i: Value, p: Value) -> Value:
        return total + matrix[i * columns + p] * vector[p]

    each_sum(r, count, RowBounds(begin, end).around, add, target.__setitem__)
    return r.done()
