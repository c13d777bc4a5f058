"""Sums in machine code, several at a time: each in its own order, none of which waits for the additions of another.

The result of an addition is ready after four cycles, and two can begin in each: one sum after the other takes four times
as long. Terms that are structurally zero are left out by bounds, which changes no result.
"""

from collections.abc import Callable, Sequence

from gauss.codegen import INTEGER
from gauss.codegen.kernels.arrays import Routine, Value

LANES = 4  # sums at a time

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


def lowest(r: Routine, values: Sequence[Value]) -> Value:
    """Least of some integers."""
    found = values[0]
    for other in values[1:]:
        found = r.choose(other < found, other, found)
    return found


def highest(r: Routine, values: Sequence[Value]) -> Value:
    """Largest of some integers."""
    found = values[0]
    for other in values[1:]:
        found = r.choose(other > found, other, found)
    return found
