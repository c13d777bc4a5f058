"""Convex relaxation of a contact problem: the minimum of ½ fᵀ W f + bᵀ f over the friction cones (Anitescu 2006).

It always exists, and is found by accelerated projected gradients (Nesterov 1983; O'Donoghue, Candès 2015). Where bodies are
many, W stays a product of sparse matrices, so that the cost of a step is in proportion to the contacts, and steps are few
enough to be waited for.
"""

from collections.abc import Callable

import numpy as np

CONVEX_STEPS, CONVEX_ERROR = 20_000, 1e-6  # its error as ACCEPTED_LAW_ERROR of the contact step
SPARSE_STEPS = 1_000  # of sparse products: in about 0.7 s for 3500 contacts
SIZE_STEPS, SIZE_MARGIN = 40, 1.1  # steps of von Mises's iteration to the largest eigenvalue of W, which it meets from below
LEAST_SIZE = 1e-300  # friction force: away from 0/0


def on_cones(normal: np.ndarray, across: np.ndarray, friction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projection of normal (m,) and friction forces (m, 2) on the cones of m coefficients of friction."""
    size = np.hypot(*across.T)
    outside = (size > friction * normal) | (normal < 0.0)  # its projection is on the surface of the cone, or at its tip
    height = np.maximum(0.0, (normal + friction * size) / (1.0 + friction * friction))
    share = friction * height / np.maximum(size, LEAST_SIZE)
    return np.where(outside, height, normal), np.where(outside[:, None], share[:, None] * across, across)


def least_over_cones(
    rates: Callable[[np.ndarray], np.ndarray],
    allowed: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    size: float,
    goal: float,
    steps: int,
) -> tuple[np.ndarray, float]:
    """Forces (n,) of the relaxation, and their error as a velocity.

    Parameters
    ----------
    rates, allowed : callable
        Forces → W f + b, forces → their projection on the cones.
    start : ndarray, shape (n,)
        Forces to begin with.
    size : float
        Largest eigenvalue of W.
    goal : float
        Error at which it ends.
    steps : int
        Most steps; the forces of the least error are returned.
    """
    f = ahead = best = allowed(start)
    momentum, least = 1.0, np.inf
    for _ in range(steps):
        new = allowed(ahead - rates(ahead) / size)
        error = float(np.abs(allowed(new - rates(new) / size) - new).max() * size)
        if error < least:
            best, least = new, error
        if error <= goal:
            break
        if (ahead - new) @ (new - f) > 0.0:
            momentum = 1.0
        after = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum * momentum))
        ahead = new + (momentum - 1.0) / after * (new - f)
        f, momentum = new, after
    return best, least


def relaxed_impulses(J, mass, bodies, b, friction, start) -> tuple[np.ndarray, np.ndarray, float]:
    """Impulses (m, 3) of the relaxation for many bodies, the velocities (n, 6) that they add, and their error.

    Parameters
    ----------
    J : ndarray, shape (m, 2, 3, 8)
        Rows of normal and tangents for the twist of each body.
    mass : ndarray, shape (n, 20)
        Inertia, its inverse, mass, its inverse.
    bodies : ndarray of int, shape (m, 2)
        Bodies of each contact; −1 for those that stand still.
    b, friction, start : ndarray, shape (m, 3), (m,), (m, 3)
        Relative velocities without forces, friction coefficients, initial impulses.
    """
    from scipy.sparse import bsr_array, coo_array  # a slow import, for few steps

    m, n = len(bodies), len(mass)
    c, side = np.nonzero(bodies >= 0)
    row = np.broadcast_to(3 * c[:, None, None] + np.arange(3)[:, None], (c.size, 3, 6))
    column = np.broadcast_to(6 * bodies[c, side][:, None, None] + np.arange(6), (c.size, 3, 6))
    entries = J[c, side, :, :6].ravel()
    rows = coo_array((entries, (row.ravel(), column.ravel())), shape=(3 * m, 6 * n)).tocsr()
    inverse = np.zeros((n, 6, 6))
    inverse[:, :3, :3] = mass[:, 9:18].reshape(n, 3, 3)
    inverse[:, 3:, 3:] = mass[:, 19, None, None] * np.eye(3)
    response = (bsr_array((inverse, np.arange(n), np.arange(n + 1)), shape=(6 * n, 6 * n)).tocsr() @ rows.T).tocsr()

    def rates(f: np.ndarray) -> np.ndarray:
        return rows @ (response @ f) + b.ravel()

    def allowed(f: np.ndarray) -> np.ndarray:
        normal, across = on_cones(f[::3], f.reshape(m, 3)[:, 1:], friction)
        return np.column_stack([normal, across]).ravel()

    x, size = np.random.default_rng(0).standard_normal(3 * m), 0.0
    for _ in range(SIZE_STEPS):
        x = rows @ (response @ (x / np.linalg.norm(x)))
        size = float(np.linalg.norm(x))
    goal = CONVEX_ERROR * (1.0 + np.abs(b).max())
    first = np.where(np.isfinite(start), start, 0.0).ravel()
    f, error = least_over_cones(rates, allowed, first, SIZE_MARGIN * size, goal, SPARSE_STEPS)
    return f.reshape(m, 3), (response @ f).reshape(n, 6), error
