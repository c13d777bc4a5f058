"""Closed forms: a pendulum that swings, and one that turns over, which is what a ladder of four-bars does."""

import mpmath as mp
import numpy as np
from scipy.special import ellipj, ellipk

G = 9.81


def swinging(side: float, t: np.ndarray) -> np.ndarray:
    """(x, y) of a point mass on a bar of 1 m that is let go at x = ±1 m (Whittaker, Analytical Dynamics, §44)."""
    k = np.sqrt(0.5)
    sn, _, dn, _ = ellipj(_phases(ellipk(0.5), mp.sqrt(G), t, 4 * mp.ellipk(0.5))[0], 0.5)
    return np.column_stack([side * 2.0 * k * sn * dn, 2.0 * (k * sn) ** 2 - 1.0])


def turning(n: int, t: np.ndarray) -> np.ndarray:
    """Position and velocity (x, y, ẋ, ẏ) of the tip B0 of the first crank of a ladder of n four-bars.

    Its cranks turn alike, and its couplers do not turn: ((n + 1)/3 + n) θ̈ = g ((n + 1)/2 + n) sin θ from θ = 0, θ̇ = 1, so
    that θ = π − 2 am(K − ½ √(1 + 4 a) t) with θ̈ = a sin θ and k² = 4 a/(1 + 4 a).
    """
    with mp.workdps(30):
        a = mp.mpf(G) * (mp.mpf(n + 1) / 2 + n) / (mp.mpf(n + 1) / 3 + n)
        m, rate = 4 * a / (1 + 4 * a), mp.sqrt(1 + 4 * a)
        u, turns = _phases(mp.ellipk(m), rate / 2, t, 2 * mp.ellipk(m))
    _, _, dn, amplitude = ellipj(u, float(m))
    theta, speed = np.pi - 2.0 * amplitude - 2.0 * np.pi * turns, float(rate) * dn
    return np.column_stack([np.sin(theta), np.cos(theta), speed * np.cos(theta), -speed * np.sin(theta)])


def _phases(first, rate, t: np.ndarray, period) -> tuple[np.ndarray, np.ndarray]:
    """Arguments first − rate · t within half a period of zero, and the whole periods taken off, in 30 digits until then."""
    with mp.workdps(30):
        u = [first - rate * mp.mpf(float(time)) for time in t]
        turns = [mp.nint(x / period) for x in u]
        return np.array([x - k * period for x, k in zip(u, turns, strict=True)], float), np.array(turns, float)
