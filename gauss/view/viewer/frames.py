"""Pictures of a motion at equal distances in time, whatever steps it was computed with."""

from dataclasses import replace

import numpy as np

from gauss.simulation import Trajectory
from gauss.system import coordinate_rates


def resampled(trajectory: Trajectory, count: int) -> Trajectory:
    """Motion at ``count`` equally spaced times, by cubic interpolation; for the eye, not for numbers.

    Where two samples share a time, at an impact, the later one counts.
    """
    t, last = _distinct(trajectory.t)
    q, v, work = trajectory.q[last], trajectory.v[last], trajectory.work[last]
    times = np.linspace(t[0], t[-1], count)
    if len(t) == 1:
        kept = np.zeros(count, dtype=int)
        return replace(trajectory, t=times, q=q[kept], v=v[kept], work=work[kept])
    from scipy.interpolate import CubicHermiteSpline  # takes long to import

    system = trajectory.system
    slopes = np.array([coordinate_rates(system, *pair) for pair in zip(q, v, strict=True)])
    between = CubicHermiteSpline(t, q, slopes)(times)
    for places in system.quaternions.values():
        between[:, places] /= np.linalg.norm(between[:, places], axis=1, keepdims=True)
    linear = (np.stack([np.interp(times, t, column) for column in part.T], axis=1) for part in (v, work))
    v, work = (part.reshape(count, width) for part, width in zip(linear, (v.shape[1], work.shape[1]), strict=True))
    return replace(trajectory, t=times, q=between, v=v, work=work)


def _distinct(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times, each once, and the last sample at each."""
    distinct, first = np.unique(t[::-1], return_index=True)
    return distinct, len(t) - 1 - first
