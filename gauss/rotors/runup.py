"""Run-up time of a shaft."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from gauss.errors import StateError
from gauss.rotors.motion import RotorMotion

FRACTION = 0.95  # of the last speed: default end of a run-up


def run_up_time(motion: RotorMotion, shaft, speed: float | None = None) -> float:
    """Time [s] at which a shaft first reaches a speed, by cubics through speeds and accelerations of the samples.

    Parameters
    ----------
    motion : RotorMotion
        The motion.
    shaft : str or Shaft
        The shaft.
    speed : float, optional
        [rad/s]; 95 % of the last speed when not given.

    Returns
    -------
    float
        Time [s].

    Raises
    ------
    StateError
        If the shaft never reaches it.
    """
    values, t = motion.speed(shaft), motion.t
    speed = FRACTION * values[-1] if speed is None else float(speed)
    reached = values >= speed if speed >= values[0] else values <= speed
    if not reached.any():
        raise StateError(
            f"the shaft never reaches {speed:g} rad/s: it moves between {values.min():.6g} and {values.max():.6g} rad/s "
            f"within {t[-1]:g} s. Simulate longer, or ask for another speed."
        )
    k = int(np.argmax(reached))
    if k == 0:
        return float(t[0])
    curve = CubicHermiteSpline(t[k - 1 : k + 1], values[k - 1 : k + 1], motion.acceleration(shaft)[k - 1 : k + 1])
    left, right = (float(curve(time)) - speed for time in t[k - 1 : k + 1])
    return float(t[k]) if left * right > 0 or right == 0 else float(brentq(lambda s: curve(s) - speed, t[k - 1], t[k]))
