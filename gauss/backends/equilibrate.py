"""Symmetric equilibration: rows and columns of a matrix scaled to one size (Ruiz, RAL-TR-2001-034)."""

import numpy as np


def equilibrate(K: np.ndarray, sweeps: int = 3) -> np.ndarray:
    """Symmetric scaling that brings the largest entry of each row near 1 (Ruiz 2001)."""
    scale = np.ones(len(K))
    for _ in range(sweeps):
        largest = np.abs(scale[:, None] * K * scale).max(axis=1)
        scale /= np.sqrt(np.where(largest > 0, largest, 1.0))
    return scale
