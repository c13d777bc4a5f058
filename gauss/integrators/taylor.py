"""Taylor's method: order from the tolerance, step from the last coefficients.

Jorba and Zou, "A software package for the numerical integration of ODEs by means of high-order Taylor methods", Experimental
Mathematics 14, 2005, sections 3.2 and 3.3.
"""

from dataclasses import dataclass, field
from math import ceil, log

import numpy as np

from gauss import math
from gauss.codegen import HIGHEST_ORDER, Scalar
from gauss.errors import SimulationError
from gauss.integrators.control import HUGE, TINY, Tolerance
from gauss.rotations import multiply
from gauss.shapes import Shaped
from gauss.system import State, System

LOWEST = 2  # order: the step follows from the last two coefficients
CAUTION = 0.7  # shortens the steps of low orders: exp(−0.7 / (p − 1))
USUAL = 18  # order above which fewer steps cost as much more each
WATCHED = 6  # last orders, whose terms tell the step: of so many that follow each other, symmetry as a rule leaves one
# orders beyond −½ ln ε + 1, the best if the cost of a step grows with the square of its order: here it grows more slowly,
# for vector registers hold many orders, and beside the series there is what a step costs anyway. Measured on pendulums,
# linkages and tops with all orders, for tolerances from 1e-3 to 1e-14
FURTHER = 7
BACK = np.array([1.0, -1.0, -1.0, -1.0])  # of a unit quaternion, makes its inverse


@dataclass(frozen=True)
class Taylor:
    """Taylor's method.

    Parameters
    ----------
    terms : int, optional
        Order, from 2 to 24; when not given it follows from the tolerance: 8 − ½ ln ε, but no more than 18.
    """

    terms: int | None = None
    name: str = field(default="taylor", init=False)
    title: str = field(default="Taylor series", init=False)
    reference: str = field(default="Jorba and Zou, Experimental Mathematics 14, 2005", init=False)
    evaluations: int = field(default=USUAL, init=False)
    mechanical: bool = field(default=True, init=False)

    def __post_init__(self):
        if self.terms is not None and self.terms not in range(LOWEST, HIGHEST_ORDER + 1):
            allowed = f"from {LOWEST} to {HIGHEST_ORDER}"
            raise SimulationError(f"Taylor: terms: expected a whole number {allowed}, got {self.terms!r}.")

    @property
    def order(self) -> int:
        """Order of convergence; where it follows from the tolerance, the highest."""
        return USUAL if self.terms is None else self.terms

    def order_for(self, tolerance: Tolerance) -> int:
        """Order with which steps reach furthest for their cost."""
        if self.terms is not None:
            return self.terms
        finest = max(tolerance.rtol, min(tolerance.atol, tolerance.atol_rates) * tolerance.least)
        return max(LOWEST, min(USUAL, ceil(FURTHER + 1.0 - 0.5 * log(finest))))


def reach(
    system: System,
    state: State,
    tolerance: Tolerance,
    order: Scalar,
    orders: Shaped[np.ndarray, " k"],
    coefficients: Shaped[np.ndarray, "k y"],
) -> Scalar:
    """Longest step in which terms of a series stay within the tolerance; not a number if they are none.

    That is asked of the last two terms. Where a motion is symmetric, these are missing: from rest every other one is, of a
    pendulum let go from the horizontal three of four. Terms before them count as much as if the series were geometric: as
    the last but one would, if they shrank further at the rate at which they did so far.

    Parameters
    ----------
    system : System
        What moves.
    state : State
        Where the series begin.
    tolerance : Tolerance
        Local error allowed.
    order : float
        Order p of the series.
    orders : ndarray, shape (k,)
        Orders of terms.
    coefficients : ndarray, shape (k, n_q + n_v)
        Coefficients of these orders of (q, v).
    """
    scale, longest, whole = tolerance.scale(system, state), np.inf, 0.0
    share = np.log(math.maximum(tolerance.rtol, math.minimum(tolerance.atol, tolerance.atol_rates)))
    for k, row in zip(orders, coefficients, strict=True):
        q, v = row[: system.n_q], row[system.n_q :]
        off = np.abs(np.concatenate([turned(system, state.q, q), v])) / scale
        largest, whole = TINY, whole + np.sum(off)
        for entry in off:
            largest = math.maximum(largest, entry)
        further = share * math.minimum(1.0 / (order - 1.0) - 1.0 / k, 0.0)
        longest = math.minimum(longest, further - np.log(largest) / k)
    return math.where(whole <= HUGE, np.exp(longest - CAUTION / (order - 1.0)), np.nan)  # maxima pass over no numbers


def turned(system: System, q: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Small change of coordinates (n_q,) as displacements (n_v,): of a quaternion Q, twice the vector of Q⁻¹ δQ."""
    if system.is_flat:
        return change
    found = []
    for joint in system.joints:
        k, here, part = joint.pair.quaternion, q[joint.q], change[joint.q]
        if k is None:
            found.append(part)
            continue
        found += [part[:k], 2.0 * multiply(here[k:] * BACK, part[k:])[1:]]
    return np.concatenate(found)
