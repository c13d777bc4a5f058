"""Efforts from what they must achieve: S u = b, by the least weighted norm where efforts are left over."""

import numpy as np

from gauss.errors import SimulationError

TAUT = 1e-9  # of the largest effort: so much may a tension lie below its bound by rounding
DEPENDENT = 1e-10  # singular value, relative to the largest, that counts as zero when a null space is taken


class SlackError(SimulationError):
    """No choice of efforts holds the relations with every cable taut."""


def allocate(S, b, weight, reference, least, names) -> np.ndarray:
    """Efforts u (j,) with S u = b, least Σ weight (u − reference)², and u ≥ least.

    Parameters
    ----------
    S : ndarray, shape (r, j)
        Matrix of rank r.
    b : ndarray, shape (r,)
        What the efforts must achieve.
    weight, reference, least : ndarray, shape (j,)
        Weights, preloads and lower bounds (−∞ for none).
    names : sequence of str
        Names of the efforts.

    Raises
    ------
    SlackError
        If a bound cannot be kept; the message names the efforts.
    """
    root = np.sqrt(weight)
    u = reference + np.linalg.lstsq(S / root, b - S @ reference, rcond=None)[0] / root
    bounded = np.isfinite(least)
    room = TAUT * np.abs(u).max(initial=0.0)
    if (u[bounded] >= least[bounded] - room).all():
        return u
    from scipy.linalg import null_space  # few need it, and it takes long to import

    Z = null_space(S / root, rcond=DEPENDENT)
    z = _least_distance((Z / root[:, None])[bounded], (least - u)[bounded])
    if z is None:
        short = ", ".join(f"{name!r} ({value:.4g})" for name, value, low in zip(names, u, least, strict=True) if value < low)
        raise SlackError(
            f"cables can only pull, but holding the relations needs a tension below the least one: {short}. "
            "Change the motion, add a cable that pulls the other way, or give another preload."
        )
    return u + (Z @ z) / root


def _least_distance(K, k):
    """Shortest z with K z ≥ k, or None (Lawson and Hanson, Solving Least Squares Problems, ch. 23, algorithm LDP)."""
    if not K.shape[1]:
        return None
    from scipy.optimize import nnls

    target = np.zeros(K.shape[1] + 1)
    target[-1] = 1.0
    scale = np.abs(k).max()
    E = np.concatenate([K.T, k[None] / scale])
    y, _ = nnls(E, target)
    residual = E @ y - target
    if residual[-1] >= 0.0:
        return None
    z = -scale * residual[:-1] / residual[-1]
    return z if (K @ z >= k - TAUT * scale).all() else None
