"""Taylor's method: order from the tolerance, step from the last coefficients.

Jorba and Zou, "A software package for the numerical integration of ODEs by means of high-order Taylor methods", Experimental
Mathematics 14, 2005, sections 3.2 and 3.3.
"""

from dataclasses import dataclass, field
from math import ceil, log
from typing import cast

import numpy as np

from gauss import math
from gauss.codegen import HIGHEST_ORDER, Scalar
from gauss.errors import SimulationError
from gauss.integrators.control import LARGEST_ERROR, SMALLEST_DIVISOR, Tolerance
from gauss.rotations import multiply
from gauss.shapes import Shaped
from gauss.system import State, System

LOWEST_ORDER = 2  # the step follows from the last two coefficients
SAFETY_EXPONENT = 0.7  # steps are shortened by exp(−0.7 / (p − 1))
HIGHEST_DEFAULT_ORDER = 18  # above it, fewer steps do not pay for their cost
WATCHED = 6  # number of last orders that give the step: in so many successive ones, symmetry as a rule leaves one non-zero
# Orders beyond −½ ln ε + 1, the optimum if the cost of a step grows with the square of the order (Jorba and Zou, eq. 3.7).
# Here it grows more slowly, by vector registers and a constant cost per step. Measured on pendulums, linkages and tops with
# all orders, for tolerances from 1e-3 to 1e-14.
EXTRA_ORDERS = 7
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])  # factors of (w, x, y, z) that invert a unit quaternion


@dataclass(frozen=True)
class Taylor:
    """Taylor's method.

    Parameters
    ----------
    terms : int, optional
        Order, from 2 to 24; by default it follows from the tolerance ε: 8 − ½ ln ε, at most 18.
    """

    terms: int | None = None
    name: str = field(default="taylor", init=False)
    title: str = field(default="Taylor series", init=False)
    reference: str = field(default="Jorba and Zou, Experimental Mathematics 14, 2005", init=False)
    evaluations: int = field(default=HIGHEST_DEFAULT_ORDER, init=False)
    mechanical: bool = field(default=True, init=False)

    def __post_init__(self):
        if self.terms is not None and self.terms not in range(LOWEST_ORDER, HIGHEST_ORDER + 1):
            allowed = f"from {LOWEST_ORDER} to {HIGHEST_ORDER}"
            raise SimulationError(f"Taylor: terms: expected a whole number {allowed}, got {self.terms!r}.")

    @property
    def order(self) -> int:
        """Order of convergence; the highest one where it follows from the tolerance."""
        return HIGHEST_DEFAULT_ORDER if self.terms is None else self.terms

    def state_size(self, system: System) -> int:
        """Size of its method state: compensation of (q, v, work) and t."""
        return system.n_q + system.n_v + 3 + 1

    def order_for(self, tolerance: Tolerance) -> int:
        """Order of the least cost per time for a tolerance."""
        if self.terms is not None:
            return self.terms
        finest = cast(float, max(tolerance.rtol, min(tolerance.atol, tolerance.atol_rates) * tolerance.least))
        return max(LOWEST_ORDER, min(HIGHEST_DEFAULT_ORDER, ceil(EXTRA_ORDERS + 1.0 - 0.5 * log(finest))))


def reach(
    system: System,
    state: State,
    tolerance: Tolerance,
    order: Scalar,
    orders: Shaped[np.ndarray, " k"],
    coefficients: Shaped[np.ndarray, "k y"],
) -> Scalar:
    """Longest step [s] in which the last terms of a Taylor series stay within the tolerance; NaN if a coefficient is NaN.

    The last two terms give the step. Symmetries of a motion make them zero: from rest every other term, of a pendulum
    released from the horizontal three of four. Earlier terms are therefore extrapolated as those of a geometric series.

    Parameters
    ----------
    system : System
        The system.
    state : State
        Expansion point.
    tolerance : Tolerance
        Local error.
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
        largest, whole = SMALLEST_DIVISOR, whole + np.sum(off)
        for entry in off:
            largest = math.maximum(largest, entry)
        further = share * math.minimum(1.0 / (order - 1.0) - 1.0 / k, 0.0)
        longest = math.minimum(longest, further - np.log(largest) / k)
    return math.where(whole <= LARGEST_ERROR, np.exp(longest - SAFETY_EXPONENT / (order - 1.0)), np.nan)


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
        found += [part[:k], 2.0 * multiply(here[k:] * CONJUGATE, part[k:])[1:]]
    return np.concatenate(found)


TAYLOR = (Taylor(),)
