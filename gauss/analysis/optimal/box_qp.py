"""Least of a quadratic function in a box, by projected Newton steps (Tassa, Mansard and Todorov, ICRA 2014, sec. III)."""

import numpy as np

STEPS = 100
STATIONARY = 1e-12  # relative to the gradient at zero
ARMIJO = 0.1
SHORTEST = 1e-10  # step of the line search


def box_minimum(H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Minimum of xᵀ H x / 2 + gᵀ x with low ≤ x ≤ high, and which entries are free.

    Parameters
    ----------
    H : ndarray, shape (n, n)
        Positive definite.
    g, low, high : ndarray, shape (n,)
        Slope and bounds.
    """
    x = np.clip(np.zeros_like(g), low, high)
    value = lambda at: 0.5 * at @ H @ at + g @ at  # noqa: E731
    for _ in range(STEPS):
        slope = g + H @ x
        free = ~(((x <= low) & (slope > 0.0)) | ((x >= high) & (slope < 0.0)))
        if not free.any() or np.abs(slope[free]).max() <= STATIONARY * np.abs(g).max():
            return x, free
        step = np.zeros_like(x)
        step[free] = -np.linalg.solve(H[np.ix_(free, free)], slope[free])
        length = 1.0
        moved = np.clip(x + step, low, high)
        while value(x) - value(moved) < -ARMIJO * slope @ (moved - x) and length > SHORTEST:
            length *= 0.5
            moved = np.clip(x + length * step, low, high)
        x = moved
    return x, free
