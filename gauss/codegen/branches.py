"""Functions that decide with `if`: every path is traced, and the outputs of all paths are joined by selections.

A path is fixed by the answers that comparisons of expressions give. The function is called once for each path, first with
all answers yes, then with the last undecided one turned to no (depth first; King, Symbolic execution and program testing,
Comm. ACM 19, 1976).
"""

import numpy as np

from gauss.codegen import expression
from gauss.codegen.expression import Expression

MOST_PATHS, LONGEST_PATH = 64, 64  # calls of a function, and comparisons in one call: a loop over time has no end
ORDERS = ("less", "less_equal")


class TooManyBranches(TypeError):
    """A function has more paths than are worth tracing."""


class _Path:
    """Answers of one call: those that are given, then yes."""

    def __init__(self, answers: list[bool]):
        self.given, self.conditions, self.known = answers, [], {}

    def decide(self, condition: Expression) -> bool:
        if condition.is_constant:
            return bool(condition.value)
        asked = _asked(condition)
        if asked not in self.known:
            place = len(self.conditions)
            if place >= LONGEST_PATH:
                raise TooManyBranches(f"it makes more than {LONGEST_PATH} decisions in one call")
            answer = self.given[place] if place < len(self.given) else True
            self.known |= {asked: answer, **_implied(condition, answer)}
            self.conditions.append(condition)
        return self.known[asked]


def _asked(condition: Expression) -> tuple | int:
    """What is asked: of a comparison its kind and sides, so that those that follow from another are found."""
    return (condition.op, *[x.index for x in condition.operands]) if condition.op in ORDERS else condition.index


def _implied(condition: Expression, answer: bool) -> dict[tuple, bool]:
    """Answers to other comparisons of the same two that follow: paths that contradict themselves are not traced."""
    if condition.op not in ORDERS:
        return {}
    strict, (x, y) = condition.op == "less", [operand.index for operand in condition.operands]
    found = {(ORDERS[strict], y, x): not answer}  # x < y or y ≤ x, and not both
    if answer == strict:  # x < y is x ≤ y, too, and not y < x; not x ≤ y is not x < y, and y ≤ x
        found |= {(ORDERS[strict], x, y): answer, (condition.op, y, x): not answer}
    return found


def branches(function):
    """Result of a function without arguments, whatever its comparisons of expressions decide; in the shape that it has.

    Parameters
    ----------
    function : callable
        Returns numbers or expressions, equally many on every path.

    Raises
    ------
    TooManyBranches
        If it has more than 64 paths, or makes more than 64 decisions on one.
    TypeError
        If two paths return arrays of different size.
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
