"""Four-bars as vectors of dimensions, traced for exact derivatives: coupler points and rocker angles of crank angles.

The dyad of coupler and rocker is placed by the same closed form as in every linkage (:mod:`gauss.linkages.dyad`); here
lengths and pivots are symbols, too.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from gauss.arguments import real_numbers
from gauss.codegen import Kernel, forward, write
from gauss.errors import ArgumentError
from gauss.linkages.chain import Dyad, Leg
from gauss.linkages.dyad import place
from gauss.linkages.elements import PlanarLink
from gauss.linkages.linkage import Linkage
from gauss.linkages.placed import Pose
from gauss.linkages.plane import Cartesian, unit
from gauss.scene import GROUND

DIMENSIONS = ("A_x", "A_y", "D_x", "D_y", "crank", "coupler", "rocker", "along", "across")


@dataclass(frozen=True)
class FourBarDesign:
    """Dimensions of a four-bar that synthesis found.

    Parameters
    ----------
    dimensions : dict of str to float
        Fixed pivots "A_x", "A_y" of the crank and "D_x", "D_y" of the rocker, lengths "crank", "coupler" and "rocker", and
        the coupler point "along" and "across" the line from its crank pin to its rocker pin [m].
    mode : int
        Assembly mode, +1 or −1, of coupler and rocker; see :class:`gauss.linkages.Dyad`.
    crank_angles : ndarray, shape (k,)
        Angles of the crank at the prescribed points, pairs or poses [rad].
    errors : ndarray, shape (k,)
        Distance from the prescribed points [m], errors of the prescribed angles [rad], or of the poses [m].
    turned : float
        Angle from the coupler to the frame whose poses are prescribed, or from the rocker to the output [rad].

    Examples
    --------
    >>> from gauss import linkages
    >>> design = linkages.function_generation([0.7, 1.2, 1.7], [1.6, 2.0, 2.4])
    >>> design.linkage().name
    'four-bar'
    """

    dimensions: dict[str, float]
    mode: int
    crank_angles: np.ndarray
    errors: np.ndarray
    turned: float = 0.0

    def linkage(self, name: str = "four-bar") -> Linkage:
        """Linkage of these dimensions: links "crank", "coupler", "rocker", pins "A", "B", "C", "D", driven at A."""
        given, bar = self.dimensions, Linkage(name)
        for link in ("crank", "coupler", "rocker"):
            bar.link(link)
        bar.revolute("A", GROUND, "crank", at=(given["A_x"], given["A_y"]))
        bar.revolute("B", "crank", "coupler", at=(given["crank"], 0.0))
        bar.revolute("C", "rocker", "coupler", at=(given["rocker"], 0.0), child_at=(given["coupler"], 0.0))
        bar.revolute("D", GROUND, "rocker", at=(given["D_x"], given["D_y"]))
        bar.drive("A", start=float(self.crank_angles[0]))
        bar.mode("C", self.mode)
        return bar

    @property
    def point(self) -> tuple[float, float]:
        """Coupler point in the frame of the coupler [m]."""
        return self.dimensions["along"], self.dimensions["across"]


class _Pin(NamedTuple):
    """Pin with its points in the frames of its two links, numbers or symbols."""

    points: dict[str, Any]

    def point(self, link: str):
        return self.points[link]

    def other(self, link: str) -> str:
        return next(name for name in self.points if name != link)


def placed_four_bar(dimensions, angle, mode: int) -> tuple[Cartesian, Pose]:
    """Coupler point, and pose of the rocker.

    Parameters
    ----------
    dimensions : sequence of 9 expressions
        In the order of ``DIMENSIONS``.
    angle : Expression
        Angle of the crank [rad].
    mode : int
        Assembly mode.
    """
    A_x, A_y, D_x, D_y, crank, coupler, rocker, along, across = dimensions
    nought = 0.0 * crank
    origin, at = Cartesian(nought, nought), lambda length: Cartesian(length, nought)
    B = _Pin({"crank": at(crank), "coupler": origin})
    C = _Pin({"coupler": at(coupler), "rocker": at(rocker)})
    D = _Pin({GROUND: Cartesian(D_x, D_y), "rocker": origin})
    pins: Any = B, C, D  # of symbols
    i, j = Leg(PlanarLink("coupler"), pins[0]), Leg(PlanarLink("rocker"), pins[2])
    coupler_point: Any = Cartesian(along, across)
    poses = {GROUND: Pose(origin, Cartesian(1.0 + nought, nought)), "crank": Pose(Cartesian(A_x, A_y), unit(angle))}
    found = place(Dyad("RRR", i, j, pins[1], mode), poses)
    return found.i.point(coupler_point), found.j


@cache
def four_bar_kernel(mode: int) -> Kernel:
    """(dimensions, crank angle) → coupler point and direction of the rocker (4,), and derivatives (4, 10) by rows."""

    def values(dimensions, angle):
        point, rocker = placed_four_bar(dimensions, angle[0], mode)
        found = np.array([point.real, point.imag, rocker.e.real, rocker.e.imag], dtype=object)
        inputs = np.concatenate([dimensions, angle])
        slopes = np.array([forward(found, inputs, one) for one in np.eye(inputs.size)]).T
        return np.concatenate([found, slopes.ravel()])

    return Kernel(write(values, len(DIMENSIONS), 1, name="four-bar"))


def of_angles(dimensions: np.ndarray, angles: np.ndarray, mode: int) -> tuple[np.ndarray, np.ndarray]:
    """Coupler points and directions of the rocker (k, 4) of crank angles (k,), and derivatives (k, 4, 10)."""
    count = len(DIMENSIONS) + 1
    with np.errstate(invalid="ignore", divide="ignore"):
        columns = np.concatenate([np.tile(dimensions[:, None], len(angles)), angles[None]])
        found = four_bar_kernel(mode)(np.ascontiguousarray(columns)).T
    return found[:, :4], found[:, 4:].reshape(-1, 4, count)


def numbers(given, shape: tuple, what: str, least: int) -> np.ndarray:
    """Array of finite numbers of a shape, whose first size is free.

    Raises
    ------
    ArgumentError
        If it is something else, or has fewer rows than ``least``.
    """
    numbers = real_numbers(given)
    found = np.empty(0) if numbers is None else numbers
    if found.shape[1:] != shape or found.ndim != len(shape) + 1 or len(found) < least or not np.isfinite(found).all():
        sizes = ", ".join(["k", *map(str, shape)])
        raise ArgumentError(f"{what}: expected {least} or more finite rows of shape ({sizes}), got {given!r}.")
    return found
