"""Richardson extrapolation of the results of steps of one length, x(h) = x₀ + c₁ h + c₂ h² + …, to h = 0.

Time stepping is of order 1 where sliding begins or ends within a step, and the error then depends on where in the step
this is: halved steps may meet the same place again and again, agree to all digits, and be off together. So numbers of steps
are taken that have little in common, the polynomial is fitted to all of them, and what they scatter is the uncertainty.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

COUNT, SPAN = 16, 4.0  # runs, and the ratio of their longest step to the shortest
DEGREES = (1, 2)  # of polynomials in h: one scatters less where x(h) jumps about, the other follows where it is smooth
QUANTILE = 5.0  # of Student's t: 99.9 % with the eleven degrees of freedom left, and what a choice of two takes from it


class Extrapolated(NamedTuple):
    """Values at h = 0 (n,), and a bound of their errors."""

    values: np.ndarray
    uncertainty: float


def divisions(finest: int) -> list[int]:
    """Numbers of steps from coarse to fine, odd, in a geometric sequence: they share few factors."""
    return [int(finest * SPAN ** (-k / (COUNT - 1))) | 1 for k in reversed(range(COUNT))]


def extrapolated(values: Callable[[float], np.ndarray], duration: float, finest: int) -> Extrapolated:
    """Extrapolate results of steps to h = 0.

    Parameters
    ----------
    values : callable
        ``values(step)``, of any one shape of n numbers.
    duration : float
        What the steps divide [s].
    finest : int
        Number of the shortest steps, much larger than ``COUNT``.

    Returns
    -------
    Extrapolated
        Of the polynomials the one whose value scatters least; residuals are weighted by 1/h, as what x(h) jumps by is of
        the size of the step.
    """
    steps = duration / np.array(divisions(finest))
    found = np.array([np.ravel(values(step)) for step in steps])
    at_zero, scatter = min((_fitted(steps, found, degree) for degree in DEGREES), key=lambda fit: fit[1])
    return Extrapolated(at_zero, QUANTILE * scatter)


def _fitted(steps: np.ndarray, found: np.ndarray, degree: int) -> tuple[np.ndarray, float]:
    """Values at h = 0 of polynomials fitted to all columns, and their largest standard deviation."""
    relative = steps / steps.max()
    powers = relative[:, None] ** np.arange(degree + 1) / relative[:, None]
    weighted = (found - found[-1]) / relative[:, None]
    coefficients, *_ = np.linalg.lstsq(powers, weighted)
    residuals = weighted - powers @ coefficients
    variance = (residuals**2).sum(axis=0) / (len(steps) - degree - 1)
    spread = np.sqrt(np.linalg.inv(powers.T @ powers)[0, 0] * variance)
    return found[-1] + coefficients[0], float(spread.max(initial=0.0))
