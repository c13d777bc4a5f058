"""Mechanism stroboscope: the links at equally spaced times in one drawing, and the paths of their joints."""

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gauss.errors import StateError
from gauss.rotations import AXIS_NAMES
from gauss.scene import GROUND
from gauss.simulation import Trajectory
from gauss.view.skeleton import lines, placed
from gauss.view.style import COLOURS, INK, check_format, legend, saved

FAINTEST = 0.15
MARGIN = 0.05


def plot_stroboscope(trajectory: Trajectory, flashes: int = 12, plane: str | None = None, path=None) -> Figure:
    """Figure of the mechanism at equally spaced times, from faint (start) to full (end), and the paths of its joints.

    Links are drawn as lines between their joints.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    flashes : int
        Number of times.
    plane : str, optional
        "xy", "xz", "yz", …: what goes to the right and up; the two axes along which most moves when not given.
    path : str or Path, optional
        Where to save it: .png, .svg or .pdf.

    Returns
    -------
    Figure
        The figure; matplotlib's, not shown.

    Raises
    ------
    FileError
        If the format is none of these.
    StateError
        If the plane is not two axes.
    """
    check_format(path)
    shapes = placed(trajectory)
    right, up = _plane(shapes, plane)
    times = np.linspace(trajectory.t[0], trajectory.t[-1], flashes)
    samples = np.abs(trajectory.t[None] - times[:, None]).argmin(axis=1)
    figure = Figure(figsize=(8, 7), layout="constrained")
    axes = figure.subplots()
    for k, (name, points) in enumerate((name, points) for name, points in shapes.items() if name != GROUND):
        flat, colour = points[:, :, [right, up]], COLOURS[k % len(COLOURS)]
        axes.plot(*flat.transpose(2, 0, 1), color=colour, linewidth=0.6, alpha=0.5, zorder=1)
        for number, sample in enumerate(samples):
            alpha = FAINTEST + (1 - FAINTEST) * (number / max(1, flashes - 1)) ** 2
            drawn = [flat[sample, [a, b]] for a, b in lines(points[0])]
            axes.add_collection(LineCollection(drawn, colors=colour, alpha=alpha, linewidths=2.2, zorder=2))
            axes.plot(*flat[sample].T, "o", color="white", markeredgecolor=colour, alpha=alpha, markersize=4, zorder=3)
        axes.plot([], [], color=colour, label=name)
    ground = shapes[GROUND][0][:, [right, up]]
    axes.plot(*ground.T, "^", color=INK, markersize=8, zorder=4, label=GROUND if len(ground) else None)
    axes.set(xlabel=f"{AXIS_NAMES[right]} [m]", ylabel=f"{AXIS_NAMES[up]} [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(MARGIN)
    axes.grid(alpha=0.3)
    legend(axes)
    figure.suptitle(f"{trajectory.system.scene.name}, {times[0]:.4g} … {times[-1]:.4g} s")
    return saved(figure, path)


def _plane(shapes: dict, plane: str | None) -> tuple[int, int]:
    if plane is not None:
        if len(plane) != 2 or plane[0] == plane[1] or not set(plane) <= set(AXIS_NAMES):
            raise StateError(f"plane: expected two axes such as 'xy' or 'xz', got {plane!r}.")
        return AXIS_NAMES.index(plane[0]), AXIS_NAMES.index(plane[1])
    everything = np.concatenate([points.reshape(-1, 3) for points in shapes.values()])
    first, second = sorted(np.argsort(-np.ptp(everything, axis=0), kind="stable")[:2])
    return int(first), int(second)
