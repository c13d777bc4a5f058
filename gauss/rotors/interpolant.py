"""Smooth curves through points, over scalars that may be numbers or symbols."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from gauss import math
from gauss.errors import SceneError
from gauss.scene import values


@dataclass(frozen=True)
class Interpolant:
    """Curve through points, constant beyond the ends.

    ``smooth`` takes cubics that keep monotone data monotone (Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980) 238),
    else straight lines. Written as a sum of increments over the intervals, each of them a polynomial of the clipped
    argument: no branch, so that the curve can be traced.

    Parameters
    ----------
    x : sequence of float
        Increasing arguments, two at least.
    y : sequence of float
        Values there.
    smooth : bool
        Cubics or straight lines.
    """

    x: tuple
    y: tuple
    smooth: bool = True

    @cached_property
    def _pieces(self) -> list[tuple]:
        """For each interval its start, its length, and the coefficients of s, s² and s³."""
        x, y = np.array(self.x), np.array(self.y)
        if self.smooth:
            cubic, square, linear, _ = PchipInterpolator(x, y).c
        else:
            linear = np.diff(y) / np.diff(x)
            cubic = square = np.zeros_like(linear)
        return [tuple(map(float, piece)) for piece in zip(x[:-1], np.diff(x), linear, square, cubic, strict=True)]

    def __call__(self, x):
        """Value at x."""
        total = self.y[0]
        for start, length, linear, square, cubic in self._pieces:
            s = math.clip(x - start, 0.0, length)
            total = total + s * (linear + s * (square + s * cubic))
        return total


def points(x, y, what: str, x_key: str, x_unit: str, y_key: str, y_unit: str) -> tuple[tuple, tuple]:
    """Two checked tuples of one length, the first increasing; SceneError if they are not."""
    if not all(isinstance(column, (tuple, list, np.ndarray)) for column in (x, y)):
        raise SceneError(f"{what}: {x_key} and {y_key} are lists of numbers in [{x_unit}] and [{y_unit}].")
    x, y = (
        tuple(values.number(value, f"{what}: {key}", unit) for value in column)
        for column, key, unit in ((x, x_key, x_unit), (y, y_key, y_unit))
    )
    if len(x) != len(y) or len(x) < 2:
        raise SceneError(
            f"{what}: {x_key} has {len(x)} and {y_key} has {len(y)} numbers; equally many, two or more, are needed."
        )
    if not all(a < b for a, b in zip(x, x[1:], strict=False)):
        raise SceneError(f"{what}: {x_key} must increase, got {list(x)}.")
    return x, y
