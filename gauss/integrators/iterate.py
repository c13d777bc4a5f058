"""Implicit equations: solved in Python over numbers, by a loop in machine code over expressions."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Expression, Scalar, fresh_symbols, outlined
from gauss.codegen.kernels import FixedPoint, Newton
from gauss.codegen.kernels.fixed_point import CONVERGED_RELATIVE
from gauss.system import System, sizes

MOST = 60  # repetitions; a step that needs more is too long
ROUNDED = 1e-14  # of a coordinate: smaller changes of it are rounding, and rates over a step h are no finer than that over h
SHARE = 1.5e-8  # of an unknown, and of the size of changes, by which it is moved for a difference: √ε


class Solved(NamedTuple):
    """Solution, calls of what was solved, matrices factored, and above 0 if it is no solution."""

    x: np.ndarray
    calls: Scalar
    factorisations: Scalar
    unsolved: Scalar


def fixed_point(iterate: Callable, start: np.ndarray) -> Solved:
    """Repeat x → (x, relative change) until x no longer changes.

    What ``iterate`` uses but does not change is computed once, before the first repetition.

    Parameters
    ----------
    iterate : callable
        Called once, with symbols.
    start : ndarray of Expression
        Where to begin.
    """
    graph = _graph(start)
    symbols = fresh_symbols(graph, "x", start.size)
    x, change = iterate(symbols)
    function, given = outlined([*x, change], symbols, "iterate")
    *x, calls, change = graph.call(FixedPoint(function, start.size, MOST), [*start, *given])
    return Solved(_vector(x), calls, 0, _unsolved(change))


def newton(
    residual: Callable, start: np.ndarray, size: Scalar, units: np.ndarray, softness: np.ndarray | None = None
) -> Solved:
    """Solve r(x) = 0 by Newton's method with a matrix of differences.

    Parameters
    ----------
    residual : callable
        Function of numbers, or called once, with symbols.
    start : ndarray
        Where to begin.
    size : float
        What changes are compared with beside the sum of the unknowns, both over their units; more than zero.
    units : ndarray
        Units of the unknowns, which make them comparable.
    softness : ndarray, optional
        See :class:`gauss.codegen.kernels.Newton`.
    """
    softness, start = np.zeros(start.size) if softness is None else softness * units, start / units
    lacking = lambda x: residual(units * x)  # noqa: E731
    if start.dtype != object:
        found = _newton_of_numbers(lacking, start, size, softness)
        return found._replace(x=units * found.x)
    graph = _graph(start)
    symbols = fresh_symbols(graph, "x", start.size)
    function, given = outlined(list(lacking(symbols)), symbols, "residual")
    *x, calls, factorisations, change = graph.call(Newton(function, softness, MOST), [*start, *given, size])
    return Solved(units * _vector(x), calls, factorisations, _unsolved(change))


@np.errstate(over="ignore", invalid="ignore")  # what diverges is reported as unsolved
def _newton_of_numbers(residual: Callable, x: np.ndarray, size: float, softness: np.ndarray) -> Solved:
    r, calls, before, firm = residual(x), 1 + x.size, np.inf, softness == 0.0
    steps = SHARE * (size + np.abs(x))
    columns = [(residual(x + step * axis) - r) / step for step, axis in zip(steps, np.eye(x.size), strict=True)]
    matrix = np.stack(columns, axis=1) + np.diag(softness)
    inverse = np.linalg.inv(matrix) if np.isfinite(matrix).all() else np.full_like(matrix, np.nan)
    for _ in range(MOST):
        delta = inverse @ r
        x, r, calls = x - delta, residual(x - delta), calls + 1
        change = np.abs(delta[firm]).sum() / (np.abs(x[firm]).sum() + size)
        if not change > 0.0 or (change < CONVERGED_RELATIVE and change >= before):
            break
        before = change
    return Solved(x, calls, 1, _unsolved(change))


def finest(system: System, q: np.ndarray, span: Scalar, extent: float = 0.0) -> Scalar:
    """Size of rates whose relative change within SOLVED is no more than rounding of the coordinates over a time span.

    Coordinates and rates are those over the units of the scene. Closing rows round as places do, which are far from zero
    where coordinates are not: their extent is added to these.
    """
    return ROUNDED / CONVERGED_RELATIVE * (np.sum(sizes(system, q) / system.scale.coordinates) + extent) / span


def _unsolved(change: Scalar) -> Scalar:
    return math.where(change <= CONVERGED_RELATIVE, 0.0, 1.0)


def _graph(start: np.ndarray):
    return next(entry.graph for entry in start if isinstance(entry, Expression))


def _vector(entries) -> np.ndarray:
    return np.array([*entries, None], dtype=object)[:-1]
