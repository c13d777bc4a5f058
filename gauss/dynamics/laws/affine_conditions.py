"""Conditions that compare piecewise affine functions of time, as in tables, ramps and gates: they change at known roots.

All of them take a time that grows with their number; bisection (:mod:`gauss.dynamics.laws.switching_times`) examines every
condition in every cell.
"""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from gauss.codegen import Expression, numbers_of, reachable
from gauss.codegen.graph import COMPARISONS
from gauss.dynamics.laws.intervals import Interval, enclose

MOST_PIECES = 4  # of a function: a clipped one has three
SAME_SLOPE = 1e-9  # relative difference of slopes below which rounding tells where lines meet

Pieces = tuple[tuple[float, float], ...]  # of a function: value at the begin, and slope


def affine_changes(
    conditions: Sequence, clock: Expression, begin: float, end: float, apart: float
) -> tuple[np.ndarray, list[Expression]]:
    """Times (k,) at which conditions change, in no order [s], and the conditions that are not piecewise affine.

    ``apart``: distance of two times at which a condition is compared [s].
    """
    asked = [condition for condition in conditions if isinstance(condition, Expression)]
    pieces, times, others = _pieces(asked, clock, begin), list[np.ndarray](), list[Expression]()
    for condition in asked:
        roots = _roots(condition, pieces)
        if roots is None:
            others.append(condition)
            continue
        inside = begin + roots[(roots >= 0.0) & (roots <= end - begin)]
        certain = all(len(pieces[x.index]) == 1 for x in condition.operands)
        times.append(inside if certain else inside[_differs(condition, clock, inside, apart)])
    return np.concatenate([np.zeros(0), *times]), others


def _roots(condition: Expression, pieces: dict[int, Pieces]) -> np.ndarray | None:
    """Times since the begin at which a condition may change [s]; None where they are not known."""
    sides = [pieces.get(x.index) for x in condition.operands]
    if not all(sides):
        return None
    if condition.op == "row":
        return _crossings(condition.value.numbers, sides[0])  # type: ignore[arg-type]  # it is not None
    found = _intersections(sides) if condition.op in COMPARISONS else None
    return None if found is None else np.array(found)


def _crossings(breaks: np.ndarray, x: Pieces) -> np.ndarray:
    """Times since the begin at which a piece meets a break [s]."""
    return np.concatenate([np.zeros(0), *((breaks - value) / slope for value, slope in x if slope)])


def _intersections(sides: list) -> list[float] | None:
    """Times since the begin at which a piece of one side meets one of the other [s]; None where they are not known."""
    found = []
    for (x, x_slope), (y, y_slope) in product(*sides):
        slope, size = x_slope - y_slope, max(abs(x_slope), abs(y_slope))
        if abs(slope) > SAME_SLOPE * size:
            found.append((y - x) / slope)
        elif slope:
            return None
    return found


def _differs(condition: Expression, clock: Expression, times: np.ndarray, apart: float) -> np.ndarray:
    """Whether a condition differs just before and just after each of some times (k,) [s]."""
    if condition.op == "row":
        before, after = (enclose([condition], {clock.index: Interval.point(times + x)})[0].low for x in (-apart, apart))
        return np.broadcast_to(before != after, times.shape)
    return np.array([_differs_at(condition, clock, float(t), apart) for t in times], dtype=bool)


def _differs_at(condition: Expression, clock: Expression, t: float, apart: float) -> bool:
    """Whether a condition differs just before and just after a time [s]."""
    try:
        value = numbers_of([condition], [clock])
        return value([t - apart])[0] != value([t + apart])[0]
    except (ArithmeticError, TypeError, ValueError):  # calls, and operations that have no value there
        return bool(np.ptp(enclose([condition], {clock.index: Interval.point(np.array([t - apart, t + apart]))})[0].low))


def _pieces(conditions: Sequence[Expression], clock: Expression, begin: float) -> dict[int, Pieces]:
    """Pieces of every expression that is piecewise affine, with few of them."""
    found: dict[int, Pieces] = {}
    for node in reachable(conditions):
        operands = [found.get(x.index, ()) for x in node.operands]
        pieces = ((begin, 1.0),) if node is clock else _combined(node, operands)
        if 0 < len(pieces) <= MOST_PIECES:
            found[node.index] = pieces
    return found


def _combined(node: Expression, x: list[Pieces]) -> Pieces:
    """Pieces of the result of an operation; none where they are not affine."""
    if node.op == "constant":
        return ((float(node.value), 0.0),)
    x = x[1:] if node.op == "select" else x  # its condition is one of those asked for
    return OPERATIONS[node.op](*x) if node.op in OPERATIONS and all(x) else ()


def _sum(x: Pieces, y: Pieces) -> Pieces:
    return tuple(dict.fromkeys((a + b, da + db) for (a, da), (b, db) in product(x, y)))


def _product(x: Pieces, y: Pieces) -> Pieces:
    """Pieces of one that is constant in all pieces, times the other."""
    if any(da for _, da in x):
        x, y = y, x
    factors = [a for a, da in x if not da]
    return tuple(dict.fromkeys((a * b, a * db) for a in factors for b, db in y)) if len(factors) == len(x) else ()


def _inverse(x: Pieces) -> Pieces:
    return tuple((1.0 / a, 0.0) for a, _ in x) if all(a and not da for a, da in x) else ()


def _either(x: Pieces, y: Pieces) -> Pieces:
    return tuple(dict.fromkeys((*x, *y)))


MINUS = ((-1.0, 0.0),)
OPERATIONS: dict[str, Callable[..., Pieces]] = {
    "neg": lambda x: _product(MINUS, x),
    "add": _sum,
    "sub": lambda x, y: _sum(x, _product(MINUS, y)),
    "mul": _product,
    "div": lambda x, y: _product(_inverse(y), x),
    "min": _either,
    "max": _either,
    "select": _either,
}
