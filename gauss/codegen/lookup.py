"""Tables of numbers as data: two operations read them, so that code does not grow with the rows of a table.

``row`` counts the breaks of a table below a number, ``entry`` reads a column in a row. Both are locally constant, as the
floor of a number is: a piece of a table is a polynomial of x whose coefficients are entries. What is not a number has a
row of its own behind the others, and NaN is the entry there.
"""

import hashlib
from functools import cached_property

import numpy as np

from gauss.codegen.expression import Expression

NAME_LENGTH = 16  # hexadecimal digits of the digest of a column in its name in code
SPACING_TOLERANCE = 0.25  # of a distance: breaks that lie closer to equally spaced ones are found by a division


class Column:
    """One column of a table; equal columns are one.

    Parameters
    ----------
    numbers : array_like, shape (n,)
        Its numbers; ascending if they are breaks.
    jumps : bool
        Of breaks: whether values may jump where a number passes one of them; else only slopes do.
    """

    def __init__(self, numbers, jumps: bool = False):
        self.numbers, self.jumps = np.array(numbers, dtype=float), jumps
        self.numbers.setflags(write=False)
        self.digest = hashlib.sha256(self.numbers.tobytes() + bytes([jumps])).hexdigest()

    def __repr__(self):
        return f"{type(self).__name__}({self.digest})"

    @property
    def name(self) -> str:
        """Name of its array in code."""
        return f"column_{self.digest[:NAME_LENGTH]}"

    def __eq__(self, other):
        return isinstance(other, Column) and self.digest == other.digest

    def __hash__(self):
        return hash(self.digest)

    @cached_property
    def spacing(self) -> float | None:
        """Distance of breaks that are spaced equally, but for :data:`SPACING_TOLERANCE`; None of others."""
        breaks = self.numbers
        if breaks.size < 2 or not 0.0 < (distance := float(breaks[-1] - breaks[0]) / (breaks.size - 1)) < np.inf:
            return None
        off = np.abs(breaks[0] + distance * np.arange(breaks.size) - breaks)
        return distance if off.max() <= SPACING_TOLERANCE * distance else None

    @cached_property
    def _runs(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Least and largest of each 1, 2, 4, … numbers in a row."""
        runs, length = [(self.numbers, self.numbers)], 1
        while 2 * length <= self.numbers.size:
            least, largest = runs[-1]
            runs.append((np.minimum(least[:-length], least[length:]), np.maximum(largest[:-length], largest[length:])))
            length *= 2
        return runs

    def extent(self, first, last) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest number from one row to another, arrays of one shape."""
        first, last = np.broadcast_arrays(self._places(first), self._places(last))
        least, largest = np.empty(first.shape), np.empty(first.shape)
        level = np.frexp(last - first + 1)[1] - 1  # whole powers of 2
        for k in np.unique(level):
            asked, (low, high) = level == k, self._runs[k]
            ends = first[asked], last[asked] + 1 - 2**k
            least[asked] = np.minimum(low[ends[0]], low[ends[1]])
            largest[asked] = np.maximum(high[ends[0]], high[ends[1]])
        return least, largest

    def row(self, x):
        """Breaks below x, entry by entry; one more than there are, of NaN."""
        return (np.searchsorted(self.numbers, x) + np.isnan(x)).astype(float)[()]

    def entry(self, row):
        """Numbers in a row, entry by entry; NaN behind the last one."""
        return np.where(np.asarray(row) < self.numbers.size, self.numbers[self._places(row)], np.nan)[()]

    def _places(self, row) -> np.ndarray:
        return np.clip(np.asarray(row, dtype=float), 0, self.numbers.size - 1).astype(int)


LOOKUPS = {"row": Column.row, "entry": Column.entry}


def looked_up(op: str, column: Column, x):
    """Operation of a column, entry by entry: over numbers or expressions."""
    if isinstance(x, Expression):
        return x.graph.lookup(op, column, x)
    if getattr(x, "dtype", None) is np.dtype(object):
        return np.frompyfunc(lambda one: looked_up(op, column, one), 1, 1)(x)
    return LOOKUPS[op](column, x)
