"""Implicit equations: iterated in Python over numbers, by a loop in machine code over expressions."""

from collections.abc import Callable

import numpy as np

from gauss.kernels import Repeat
from gauss.tracing import enclosed, fresh

MOST = 60  # repetitions; a step that needs more is too long
SOLVED = 1e-9  # relative change of the last one with which equations count as solved


def fixed_point(iterate: Callable, start: np.ndarray) -> tuple[np.ndarray, object, object]:
    """Repeat x → (x, relative change) until x no longer changes; x, repetitions, and above 0 if it goes on changing.

    What ``iterate`` uses but does not change is computed once, before the first repetition.

    Parameters
    ----------
    iterate : callable
        Called once, with symbols.
    start : ndarray of Expression
        Where to begin.
    """
    graph = next(entry.graph for entry in start if hasattr(entry, "graph"))
    symbols = fresh(graph, "x", start.size)
    x, change = iterate(symbols)
    function, given = enclosed([*x, change], symbols, "iterate")
    *x, count, change = graph.call(Repeat(function, start.size, MOST), [*start, *given])
    unsolved = 1.0 - graph.binary("less_equal", change, graph.constant(SOLVED))
    return np.array([*x, None], dtype=object)[:-1], count, unsolved
