"""Solution of implicit equations by fixed-point or Newton iteration: in Python over numbers, compiled over expressions."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Expression, Scalar, fresh_symbols, outlined
from gauss.codegen.kernels import FixedPoint, Newton
from gauss.codegen.kernels.fixed_point import CONVERGED_RELATIVE
from gauss.system import System, sizes

MOST_ITERATIONS = 60  # more of them mean that the step is too long
COORDINATE_ROUNDING = 1e-14  # relative rounding of a coordinate; that of rates over a step h is this over h
DIFFERENCE = 1.5e-8  # increment of finite differences, relative to an unknown and to the size of changes: √ε


class NonlinearSolution(NamedTuple):
    """Solution, evaluations of the residual, factorisations, and a number above 0 where the iteration did not converge."""

    x: np.ndarray
    calls: Scalar
    factorisations: Scalar
    unsolved: Scalar


def fixed_point(iterate: Callable, start: np.ndarray) -> NonlinearSolution:
    """Fixed point of x → (x, relative change), iterated until x no longer changes.

    The map is called once, with symbols; expressions that do not depend on x are computed once, before the first iteration.
    """
    graph = _graph(start)
    symbols = fresh_symbols(graph, "x", start.size)
    x, change = iterate(symbols)
    function, given = outlined([*x, change], symbols, "iterate")
    *x, calls, change = graph.call(FixedPoint(function, start.size, MOST_ITERATIONS), [*start, *given])
    return NonlinearSolution(_vector(x), calls, 0, _unsolved(change))


def newton(
    residual: Callable, start: np.ndarray, size: Scalar, units: np.ndarray, softness: np.ndarray | None = None
) -> NonlinearSolution:
    """Solution of r(x) = 0 by a simplified Newton iteration, its matrix by finite differences at the start.

    The residual is called with numbers, or once, with symbols. Changes are relative to the sum of the unknowns over their
    units plus a positive ``size``. Softness: see :class:`gauss.codegen.kernels.Newton`.
    """
    softness, start = np.zeros(start.size) if softness is None else softness * units, start / units
    scaled = lambda x: residual(units * x)  # noqa: E731
    if start.dtype != object:
        found = _newton_of_numbers(scaled, start, size, softness)
        return found._replace(x=units * found.x)
    graph = _graph(start)
    symbols = fresh_symbols(graph, "x", start.size)
    function, given = outlined(list(scaled(symbols)), symbols, "residual")
    *x, calls, factorisations, change = graph.call(Newton(function, softness, MOST_ITERATIONS), [*start, *given, size])
    return NonlinearSolution(units * _vector(x), calls, factorisations, _unsolved(change))


@np.errstate(over="ignore", invalid="ignore")  # divergence is reported as unsolved
def _newton_of_numbers(residual: Callable, x: np.ndarray, size: Scalar, softness: np.ndarray) -> NonlinearSolution:
    r, calls, before, firm = residual(x), 1 + x.size, np.inf, softness == 0.0
    steps = DIFFERENCE * (size + np.abs(x))
    columns = [(residual(x + step * axis) - r) / step for step, axis in zip(steps, np.eye(x.size), strict=True)]
    matrix = np.stack(columns, axis=1) + np.diag(softness)
    inverse = np.linalg.inv(matrix) if np.isfinite(matrix).all() else np.full_like(matrix, np.nan)
    for _ in range(MOST_ITERATIONS):
        delta = inverse @ r
        x, r, calls = x - delta, residual(x - delta), calls + 1
        change = np.abs(delta[firm]).sum() / (np.abs(x[firm]).sum() + size)
        if not change > 0.0 or (change < CONVERGED_RELATIVE and change >= before):
            break
        before = change
    return NonlinearSolution(x, calls, 1, _unsolved(change))


def finest(system: System, q: np.ndarray, span: Scalar, extent: float = 0.0) -> Scalar:
    """Size of rates whose relative change SOLVED is the rounding of the coordinates over a time span [1/s].

    Coordinates and rates are over the units of the scene. Residuals of loop constraints round as positions of links do, even
    where coordinates are near zero: the extent of the mechanism is added to these.
    """
    return COORDINATE_ROUNDING / CONVERGED_RELATIVE * (np.sum(sizes(system, q) / system.scale.coordinates) + extent) / span


def _unsolved(change: Scalar) -> Scalar:
    return math.where(change <= CONVERGED_RELATIVE, 0.0, 1.0)


def _graph(start: np.ndarray):
    return next(entry.graph for entry in start if isinstance(entry, Expression))


def _vector(entries) -> np.ndarray:
    return np.array([*entries, None], dtype=object)[:-1]
