"""Condition numbers of the groups of a linkage, and the digits that are lost near singular positions."""

import numpy as np

from gauss.linkages import triad as triads
from gauss.linkages.chain import Dyad
from gauss.linkages.motion import LinkageKinematics
from gauss.linkages.plane import rounded


def conditions(motion: LinkageKinematics) -> np.ndarray:
    """Condition numbers (n, k) of the matrices of all groups, lengths made free of units; infinite or nan where singular."""
    size = np.shape(rounded(motion.crank_angle))
    pairs = zip(motion.chain.groups, motion.freedoms, strict=True)
    return np.array([np.broadcast_to(condition(*pair), size) for pair in pairs]).reshape(-1, *size)


def condition(group, freedoms) -> np.ndarray:
    """Condition number (k,) of the matrix of a group at its inner joints."""
    if isinstance(group, Dyad):  # of two unit rows at this angle: cot(angle / 2)
        quality = rounded(freedoms.quality)
        return (abs(quality) + quality.real) / quality.imag
    matrix = triads.matrix(freedoms)
    return np.where(np.isfinite(matrix).all((1, 2)), np.linalg.cond(np.nan_to_num(matrix)), np.inf)


def loss(kappa: np.ndarray, rounding: float) -> np.ndarray:
    """Bound (k,) of the relative error that rounding leaves in second derivatives of groups with condition numbers (n, k).

    A position is a root, and each derivative of it loses the digits of the condition number once more; what is lost in one
    group is magnified by the others.
    """
    return rounding * (1.0 + (kappa**2).sum(axis=0) * kappa.prod(axis=0))
