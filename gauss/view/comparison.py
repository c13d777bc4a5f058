"""Figure of several motions: every coordinate that they share, and its difference from the first motion."""

import numpy as np
from matplotlib.figure import Figure

from gauss.errors import ArgumentError, require
from gauss.simulation import Trajectory
from gauss.system import coordinate_rates, coordinate_units
from gauss.view.plots import FLOOR, scalar_coordinates
from gauss.view.style import check_format, legend, looks, saved

MOST_COORDINATES = 6  # coordinates of a figure when none are named


def plot_comparison(motions, coordinates=None, path=None, labels=None) -> Figure:
    """Figure of several motions: each coordinate against time, and the sizes of its differences from the first motion.

    Motions may have samples at different times: differences are taken at those of the motion with fewer, where both last;
    the other is interpolated by cubics of its coordinates and rates, with an error of the order h⁴ of its steps. Motions at
    the same times (``simulate(…, times=…)``) are compared exactly.

    Parameters
    ----------
    motions : sequence of Trajectory
        Two motions or more.
    coordinates : iterable of str, optional
        Coordinates; the first ones that all motions have when not given.
    path : str or Path, optional
        Where to save it: .png, .svg or .pdf.
    labels : sequence of str, optional
        Names of the motions; those of their scenes when not given.

    Returns
    -------
    Figure
        The figure; matplotlib's, not shown.

    Raises
    ------
    ArgumentError
        If there are fewer than two motions, or a coordinate or label is missing.
    FileError
        If the format is none of these.

    Examples
    --------
    >>> import gauss
    >>> from gauss.view import plot_comparison
    >>> fine, coarse = (gauss.simulate(gauss.load("pendulum"), 0.1, rtol=rtol) for rtol in (1e-12, 1e-4))
    >>> figure = plot_comparison([fine, coarse], labels=["1e-12", "1e-4"])
    >>> len(figure.axes)
    2
    """
    check_format(path)
    motions = list(motions)
    for motion in motions:
        require(motion, (Trajectory,), "plot_comparison")
    if len(motions) < 2:
        raise ArgumentError(f"plot_comparison: expected two motions or more, got {len(motions)}.")
    given = [f"{k}: {motion.system.scene.name}" for k, motion in enumerate(motions, 1)] if labels is None else list(labels)
    if len(given) != len(motions):
        raise ArgumentError(f"plot_comparison: expected {len(motions)} labels, got {len(given)}.")
    columns = [scalar_coordinates(motion) for motion in motions]
    names = _names(columns, coordinates)
    units = coordinate_units(motions[0].system)
    figure = Figure(figsize=(11, 1.0 + 2.2 * len(names)), layout="constrained")
    rows = figure.subplots(len(names), 2, sharex=True, squeeze=False)
    for (axes, apart), name in zip(rows, names, strict=True):
        for k, (motion, own) in enumerate(zip(motions, columns, strict=True)):
            axes.plot(motion.t, own[name], label=given[k], **looks(k))
            if k:
                t, size = _difference(motions[0], motion, name)
                apart.semilogy(t, size + FLOOR, label=f"{given[k]} − {given[0]}", **looks(k))
        axes.set_ylabel(f"{name} [{units[name]}]")
        apart.set_ylabel(f"difference [{units[name]}]")
        for each in (axes, apart):
            each.grid(alpha=0.3)
    legend(rows[0, 0], beside=False)
    legend(rows[0, 1], beside=False)
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    return saved(figure, path)


def _names(columns: list[dict], wanted) -> list[str]:
    """Coordinates that all motions have."""
    shared = [name for name in columns[0] if all(name in own for own in columns)]
    names = shared[:MOST_COORDINATES] if wanted is None else list(wanted)
    missing = [name for name in names if name not in shared]
    if missing or not names:
        raise ArgumentError(f"plot_comparison: not a coordinate of all motions: {', '.join(missing) or 'any'}.")
    return names


def _difference(first: Trajectory, second: Trajectory, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times of the motion with fewer samples, as long as both last, and the size of the difference there."""
    fewer, more = sorted((first, second), key=len)
    t = fewer.t
    both = (t >= more.t[0]) & (t <= more.t[-1])
    return t[both], abs(_between(more, name, t[both]) - scalar_coordinates(fewer)[name][both])


def _between(motion: Trajectory, name: str, t: np.ndarray) -> np.ndarray:
    """Coordinate at times between samples; where two samples share a time, at an impact, a cubic ends at either side."""
    k = np.clip(np.searchsorted(motion.t, t, side="right") - 1, 0, max(len(motion) - 2, 0))
    ends = np.minimum(np.stack([k, k + 1]), len(motion) - 1)
    h = motion.t[ends[1]] - motion.t[ends[0]]
    s = np.divide(t - motion.t[ends[0]], h, out=np.zeros_like(t), where=h > 0.0)
    column = list(coordinate_units(motion.system)).index(name)
    start, end = motion.q[ends, column]
    kept, place = np.unique(ends, return_inverse=True)
    slopes = np.array([coordinate_rates(motion.system, motion.q[i], motion.v[i])[column] for i in kept])
    rate, later = h * slopes[place.reshape(ends.shape)]
    return start + s * rate + s**2 * (3 * (end - start) - 2 * rate - later) + s**3 * (2 * (start - end) + rate + later)
