"""Where in a step rows of the constraints fade, and how long a step is to be so that this falls far from its stages.

Rows fade where branches of a motion meet, as in a parallelogram that is flat. The motion passes such a place like any other,
but accelerations lose digits near it: rounding of the size ε on the constraints makes v² ε / s³ of them, where s is what is
left of a row. What the stages nearest to it find spoils the step; how near they come is a matter of chance, unless the place
is foreseen. What is left of a row changes in proportion to the time, so two stages tell where it will be nothing.
"""

import numpy as np

from gauss import math
from gauss.codegen import Scalar

NEAR = 0.65  # of half the widest gap: so far from its middle a place is left where it is
EARLY = 0.05  # of a step: a place so near to its begin is no better off in a shorter step
TINY = 1e-300


class StageNodes:
    """Times of the stages of a step, as shares of it.

    Parameters
    ----------
    c : ndarray, shape (s,)
        Times of the stages that tell what is left of the rows, begin and end of the step among them.
    others : ndarray
        Times of further stages.

    Attributes
    ----------
    middle, half : float
        Middle of the widest gap between stages, and half of its width.
    """

    def __init__(self, c: np.ndarray, others: np.ndarray):
        times = np.unique(np.concatenate([c, others]))
        widest = int(np.argmax(np.diff(times)))
        self.middle, self.half = times[widest : widest + 2].mean(), np.diff(times)[widest] / 2
        self.times, first = np.unique(c[::-1], return_index=True)
        self.stages = len(c) - 1 - first  # of stages at one time the last: they come nearest to the motion

    def place(self, left: np.ndarray) -> Scalar:
        """Where rows fade, as a share of the step, next to the stage where least is left of them.

        Parameters
        ----------
        left : ndarray, shape (s,)
            What is left of the rows in each stage.
        """
        c, d = self.times, left[self.stages]
        last = 1.0 + math.where(c[-2] + d[-2] / self._rate(d[:-1]) > 1.0, 1.0, -1.0) * d[-1] / self._rate(d[:-1])
        inner = [(c[i - 1] * d[i + 1] + c[i + 1] * d[i - 1]) / (d[i - 1] + d[i + 1]) for i in range(1, len(c) - 1)]
        found, least = 0.0, d[0]
        for place, own in zip([*inner, last], d[1:], strict=True):
            found, least = math.where(own < least, place, found), math.minimum(own, least)
        return found

    def ahead(self, left: np.ndarray) -> Scalar:
        """Time from the end to where rows will fade, as a share of the step."""
        d = left[self.stages]
        return d[-1] / self._rate(d)

    def shift(self, place: Scalar) -> Scalar:
        """Factor of a step by which a place comes to lie in the widest gap, of this step or of the one after it."""
        before = math.where(place < EARLY, 1.0, place / self.middle)
        after = math.where(place < 1.0 + self.middle, place - self.middle, 1.0)
        moved = math.where(place < self.middle, before, after)
        return math.where(np.abs(place - self.middle) <= NEAR * self.half, 1.0, moved)

    def _rate(self, left: np.ndarray) -> Scalar:
        """How fast rows fade between the last two of the times."""
        c = self.times[: len(left)]
        return math.maximum((left[-2] - left[-1]) / (c[-1] - c[-2]), TINY)
