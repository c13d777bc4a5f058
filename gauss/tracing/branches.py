"""Tracing of functions with control flow: every path is executed symbolically, and selections join the outputs.

The truth values of the comparisons of expressions determine a path. The function is called once for each path, depth first:
at first every comparison is true, then the last one not yet negated is false (King, Symbolic execution and program testing,
Comm. ACM 19, 1976).
"""

import numpy as np

from gauss.tracing import expression
from gauss.tracing.expression import Expression

MOST_PATHS, LONGEST_PATH = 64, 64  # paths of a function, and comparisons on one: a loop may be unbounded


class TooManyBranches(TypeError):
    """A function has too many paths to be traced."""


class _Path:
    """Truth values of the comparisons of one call: those given, then true."""

    def __init__(self, answers: list[bool]):
        self.given, self.conditions, self.known = answers, [], {}

    def decide(self, condition: Expression) -> bool:
        if condition.is_constant:
            return bool(condition.value)
        if condition.index not in self.known:
            place = len(self.conditions)
            if place >= LONGEST_PATH:
                raise TooManyBranches(f"it makes more than {LONGEST_PATH} comparisons in one call")
            self.known[condition.index] = self.given[place] if place < len(self.given) else True
            self.conditions.append(condition)
        return self.known[condition.index]


def branches(function):
    """Outputs of a function without arguments, with selections over the comparisons of expressions that it branches on.

    Parameters
    ----------
    function : callable
        () → numbers or expressions, of one shape on every path.

    Raises
    ------
    TooManyBranches
        If it has more than 64 paths, or more than 64 comparisons on one.
    TypeError
        If two paths return arrays of different shape.
    """
    calls = 0

    def along(answers: list[bool]) -> np.ndarray:
        nonlocal calls
        calls += 1
        if calls > MOST_PATHS:
            raise TooManyBranches(f"it has more than {MOST_PATHS} paths")
        path = _Path(answers)
        expression._paths.append(path)
        try:
            found = np.asarray(function(), dtype=object)
        finally:
            expression._paths.pop()
        for place in reversed(range(len(answers), len(path.conditions))):
            other = along([*answers, *[True] * (place - len(answers)), False])
            found = _joined(path.conditions[place], found, other)
        return found

    return along([])[()]


def _joined(condition: Expression, yes: np.ndarray, no: np.ndarray) -> np.ndarray:
    if yes.shape != no.shape:
        raise TypeError(f"it returns an array of shape {yes.shape} on one path and of shape {no.shape} on another")
    joined = np.empty(yes.shape, dtype=object)
    for place in np.ndindex(yes.shape):
        joined[place] = condition.graph.select(condition, yes[place], no[place])
    return joined
