"""Functions with `if` over expressions: every path is traced, and the outputs of all paths are joined by selections.

A path is the sequence of truth values of the comparisons met. The function is called once for each path, first with all
true, then with the last free one set to false (depth first; King, Symbolic execution and program testing, Comm. ACM 19,
1976).
"""

import numpy as np

from gauss.codegen.expression import Expression, decided_by
from gauss.codegen.graph import COMPARISONS

MOST_PATHS, LONGEST_PATH = 64, 64  # calls of a function, and comparisons in one call: a loop over time has no end


class TooManyBranches(TypeError):
    """A function has more paths than the limits of symbolic execution allow."""


class _Path:
    """Truth values of the comparisons of one call: those that are given, then true."""

    def __init__(self, answers: list[bool]):
        self.given = answers
        self.conditions: list[Expression] = []
        self.known: dict[tuple | int, bool] = {}

    def decide(self, condition: Expression) -> bool:
        if condition.is_constant:
            return bool(condition.value)
        key = _condition_key(condition)
        if key not in self.known:
            place = len(self.conditions)
            if place >= LONGEST_PATH:
                raise TooManyBranches(f"it makes more than {LONGEST_PATH} decisions in one call")
            answer = self.given[place] if place < len(self.given) else True
            self.known |= {key: answer} | _implied(condition, answer)
            self.conditions.append(condition)
        return self.known[key]


def _condition_key(condition: Expression) -> tuple | int:
    """Key of a condition: of a comparison its kind and its sides, so that implied comparisons are found."""
    return (condition.op, *[x.index for x in condition.operands]) if condition.op in COMPARISONS else condition.index


def _implied(condition: Expression, answer: bool) -> dict[tuple | int, bool]:
    """Implied truth values of other comparisons of the same two sides: contradictory paths are not traced."""
    if condition.op not in COMPARISONS:
        return {}
    strict, (x, y) = condition.op == "less", [operand.index for operand in condition.operands]
    found: dict[tuple | int, bool] = {(COMPARISONS[strict], y, x): not answer}  # x < y or y ≤ x, and not both
    if answer == strict:  # x < y is x ≤ y, too, and not y < x; not x ≤ y is not x < y, and y ≤ x
        found |= {(COMPARISONS[strict], x, y): answer, (condition.op, y, x): not answer}
    return found


def branches(function):
    """Result of a function without arguments that decides by comparisons of expressions; of the shape of its result.

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
        with decided_by(path):
            found = np.asarray(function(), dtype=object)
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
