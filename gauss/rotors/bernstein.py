"""Enclosures of the dense output of a step by the hull of its Bernstein coefficients.

The dense output is a polynomial of degree 8 at most, determined by its values at nine nodes of the step. De Casteljau's
algorithm gives the coefficients on each subinterval (Farouki, Computer Aided Geometric Design 29 (2012) 379).
"""

from functools import cache
from math import comb

import numpy as np

DEGREE = 8
PARTS = 8  # subintervals of a step
NODES = np.arange(DEGREE + 1) / DEGREE  # of a step: the ends of its subintervals


@cache
def _matrices() -> np.ndarray:
    """Matrices from values at nodes to Bernstein coefficients on the subintervals, (PARTS, DEGREE + 1, DEGREE + 1)."""
    basis = [[comb(DEGREE, i) * x**i * (1.0 - x) ** (DEGREE - i) for i in range(DEGREE + 1)] for x in NODES]
    rest, found = np.linalg.inv(basis), []
    for part in range(PARTS):
        first, rest = _divided(rest, 1.0 / (PARTS - part))
        found.append(first)
    return np.array(found)


def _divided(coefficients: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (DEGREE + 1, …) on the first share of an interval and on the rest of it, by de Casteljau's algorithm."""
    left, right = [coefficients[0]], [coefficients[-1]]
    while len(coefficients) > 1:
        coefficients = (1.0 - share) * coefficients[:-1] + share * coefficients[1:]
        left.append(coefficients[0])
        right.append(coefficients[-1])
    return np.array(left), np.array(right[::-1])


def hulls(values: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Enclosures of polynomials and of their derivatives on each subinterval of a step.

    Parameters
    ----------
    values : ndarray, shape (n, DEGREE + 1)
        Values at the nodes.
    length : float
        Step size [s].

    Returns
    -------
    tuple of ndarray, shape (n, PARTS)
        Least and largest values, least and largest derivatives.
    """
    coefficients = np.einsum("pij,nj->npi", _matrices(), values)
    slopes = np.diff(coefficients, axis=2) * (DEGREE * PARTS / length)
    return coefficients.min(axis=2), coefficients.max(axis=2), slopes.min(axis=2), slopes.max(axis=2)
