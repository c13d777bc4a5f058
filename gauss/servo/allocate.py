"""Allocation of efforts: S u = b with least Σ weight (u − preload)², and no cable in compression.

Bounds by least distance programming (Lawson and Hanson, Solving Least Squares Problems, ch. 23).
"""

import numpy as np

from gauss.errors import SimulationError
from gauss.servo.instant import DEPENDENT, ServoInstant
from gauss.servo.servo import Servo

TENSION_ROUNDING = 1e-9  # relative to the largest effort or its terms: a tension below its bound by less is at the bound


class SlackError(SimulationError):
    """No efforts hold the relations with every cable in tension."""


def allocate(instant: ServoInstant, servo: Servo, t: float) -> np.ndarray:
    """Efforts u (j,) with S u = b, S of full row rank, least Σ weight (u − reference)², and u ≥ least.

    SlackError if a bound is violated; the message names the time [s] and efforts.
    """
    u, rounding = _least_norm(instant, servo)
    if (u >= servo.least - rounding).all():
        return u
    from scipy.linalg import null_space  # few need it, and it takes long to import

    root, bounded = np.sqrt(servo.weight), np.isfinite(servo.least)
    Z = null_space(instant.unit_rows[0] / root, rcond=DEPENDENT)
    z = _least_distance((Z / root[:, None])[bounded], (servo.least - u)[bounded])
    if z is None:
        raise _slack(servo, u, u < servo.least - rounding, t)
    return u + (Z @ z) / root


def require_tension(instant: ServoInstant, servo: Servo, t: float):
    """Check that no cable goes slack where S loses rank; SlackError if one does."""
    u = allocate(instant, servo, t)
    at_bound = u <= servo.least + _least_norm(instant, servo)[1]
    if at_bound.any() and instant.S.shape[0] == u.size:
        raise _slack(servo, u, at_bound, t)


def _least_norm(instant: ServoInstant, servo: Servo) -> tuple[np.ndarray, np.ndarray]:
    """Efforts (j,) of least weighted norm without bounds, and their rounding (j,)."""
    (S, b, sizes), root, reference = instant.unit_rows, np.sqrt(servo.weight), servo.reference
    u = reference + np.linalg.lstsq(S / root, b - S @ reference, rcond=None)[0] / root
    if not np.isfinite(servo.least).any():
        return u, np.zeros(u.size)
    terms = np.abs(np.linalg.pinv(S / root)) @ sizes / root
    return u, TENSION_ROUNDING * np.maximum(np.abs(u).max(initial=0.0), terms)


def _slack(servo: Servo, u, short, t: float) -> SlackError:
    named = ", ".join(f"{name!r} ({value:.4g})" for name, value, off in zip(servo.efforts, u, short, strict=True) if off)
    return SlackError(
        f"t = {t:.9g} s: cables can only pull, but holding the relations needs a tension below the least one: {named}. "
        "Change the motion, add a cable that pulls the other way, or give another preload."
    )


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
    return z if (K @ z >= k - TENSION_ROUNDING * scale).all() else None
