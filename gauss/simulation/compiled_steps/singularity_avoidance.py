"""Predicts where within a step the constraint Jacobian loses rank, and chooses the step so that no stage lies near there.

The Jacobian loses rank where branches of a motion meet, as in a flat parallelogram. The motion passes such a configuration
smoothly, but accelerations lose digits near it: rounding ε of the constraints becomes v² ε / σ³ of them, σ being the
smallest singular value of the Jacobian K M^(−1/2), over its length on free bodies; it is estimated by (Σ 1/pivot)^(−1/2). A
stage very near the configuration spoils the step. Since σ is proportional to the time left, two stages predict its zero.
"""

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.laws.switching_times import distinct

NEAR_MIDDLE = 0.65  # of half the widest interval between stages: a zero this near to its middle needs no other step
EARLY = 0.05  # relative to the step: a zero this near to its start is not avoided by a shorter step
SMALLEST_RATE = 1e-300  # of σ, over the step


class StageNodes:
    """Nodes of the stages of a step, relative to it.

    Parameters
    ----------
    c : ndarray, shape (s,)
        Nodes of the stages with known σ, among them start and end of the step.
    others : ndarray
        Nodes of further stages.

    Attributes
    ----------
    middle, half : float
        Middle of the widest interval between nodes, and half of its width.
    """

    def __init__(self, c: np.ndarray, others: np.ndarray):
        times = distinct(np.concatenate([c, others]))
        widest = int(np.argmax(np.diff(times)))
        self.middle, self.half = times[widest : widest + 2].mean(), np.diff(times)[widest] / 2
        self.times = distinct(c)
        self.stages = np.array([np.flatnonzero(c == t)[-1] for t in self.times])  # at one node the last, most accurate one

    def place(self, sigma: np.ndarray) -> Scalar:
        """Time of the zero of σ next to the stage with the smallest one, relative to the step.

        Parameters
        ----------
        sigma : ndarray, shape (s,)
            Smallest singular value of the constraint Jacobian in each stage.
        """
        c, d = self.times, sigma[self.stages]
        last = 1.0 + math.where(c[-2] + d[-2] / self._rate(d[:-1]) > 1.0, 1.0, -1.0) * d[-1] / self._rate(d[:-1])
        inner = [(c[i - 1] * d[i + 1] + c[i + 1] * d[i - 1]) / (d[i - 1] + d[i + 1]) for i in range(1, len(c) - 1)]
        found, least = 0.0, d[0]
        for place, own in zip([*inner, last], d[1:], strict=True):
            found, least = math.where(own < least, place, found), math.where(own < least, own, least)
        return found

    def ahead(self, sigma: np.ndarray) -> Scalar:
        """Time from the end of the step to the zero of σ, relative to the step."""
        d = sigma[self.stages]
        return d[-1] / self._rate(d)

    def shift(self, place: Scalar) -> Scalar:
        """Step-size factor that moves a time into the widest interval between nodes, of this step or of the next one."""
        before = math.where(place < EARLY, 1.0, place / self.middle)
        after = math.where(place < 1.0 + self.middle, place - self.middle, 1.0)
        moved = math.where(place < self.middle, before, after)
        return math.where(np.abs(place - self.middle) <= NEAR_MIDDLE * self.half, 1.0, moved)

    def _rate(self, sigma: np.ndarray) -> Scalar:
        """Rate of decrease of σ between the last two nodes."""
        c = self.times[: len(sigma)]
        return math.maximum((sigma[-2] - sigma[-1]) / (c[-1] - c[-2]), SMALLEST_RATE)
