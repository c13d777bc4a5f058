"""Conditions of many levels: the floor of a number changes at whole numbers, the row of a table at its breaks."""

from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Column, Expression, looked_up

LEVELED = ("floor", "row")


class Levels(NamedTuple):
    """Levels of a number."""

    breaks: Column | None = None  # numbers at which the level changes; whole numbers if None

    def at(self, x):
        """Level of a number or an expression."""
        return math.floor(x) if self.breaks is None else looked_up("row", self.breaks, x)

    def borders(self, level: float) -> tuple[float, float]:
        """Numbers between which a level lies."""
        if self.breaks is None:
            return level, level + 1.0
        numbers = self.breaks.numbers
        k = min(int(level), numbers.size)  # that of NaN is one more
        return float(numbers[k - 1]) if k else -np.inf, float(numbers[k]) if k < numbers.size else np.inf

    def nearest(self, x: float) -> float:
        """Number at which the level changes that is nearest to a number."""
        if self.breaks is None:
            return float(round(x))
        return min(self.borders(self.at(x)), key=lambda border: abs(border - x))


def levels_of(node: Expression) -> Levels:
    """Levels of a floor or of a row."""
    return Levels(node.value if node.op == "row" else None)


def leveled(nodes: list[Expression]) -> tuple[list[Expression], list[Levels]]:
    """Arguments of the floors and rows among nodes, and their levels."""
    found = [node for node in nodes if node.op in LEVELED]
    return [node.operands[0] for node in found], list(map(levels_of, found))
