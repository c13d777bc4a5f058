"""Phase portraits: rate over coordinate, joint by joint."""

import numpy as np
from matplotlib.figure import Figure

from gauss.errors import StateError
from gauss.simulation import Trajectory
from gauss.system import coordinate_units
from gauss.view.style import COLOURS, check_format, saved

COLUMNS = 3


def plot_phase(trajectory: Trajectory, joints=None, path=None) -> Figure:
    """Figure of the rate of each joint over its coordinate; a dot is the start.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    joints : iterable of str, optional
        Joints, or single coordinates such as "U.angle1"; every coordinate that is not part of a quaternion if not given.
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
        If there is no such joint, or none whose rate belongs to a coordinate.
    """
    check_format(path)
    units = coordinate_units(trajectory.system)
    known = list(trajectory.system.coordinates)
    chosen = _plain(trajectory.system) if joints is None else [name for joint in joints for name in _of(trajectory, joint)]
    if not chosen:
        raise StateError("no coordinate has a phase portrait: all are parts of quaternions.")
    rows, columns = -(-len(chosen) // COLUMNS), min(COLUMNS, len(chosen))
    figure = Figure(figsize=(1 + 3.6 * columns, 0.6 + 3.2 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    names = list(units)
    for axes, name in zip(grid, chosen, strict=False):
        q, v = trajectory.q[:, names.index(name)], trajectory.v[:, known.index(name)]
        axes.plot(q, v, color=COLOURS[0], linewidth=1.1)
        axes.plot(q[0], v[0], "o", color=COLOURS[1], markersize=5)
        axes.set(xlabel=f"{name} [{units[name]}]", ylabel=f"rate [{units[name]}/s]")
        axes.grid(alpha=0.3)
    for axes in grid[len(chosen) :]:
        axes.set_visible(False)
    figure.suptitle(trajectory.system.scene.name)
    return saved(figure, path)


def _plain(system) -> list[str]:
    """Names of the coordinates whose derivatives are rates."""
    return [name for name in coordinate_units(system) if name in system.coordinates]


def _of(trajectory: Trajectory, joint: str) -> list[str]:
    """Coordinates of a joint, or the one that is named."""
    if joint in trajectory.system.coordinates and joint in _plain(trajectory.system):
        return [joint]
    placed = trajectory.system.joint(joint)
    found = np.array(trajectory.system.coordinates)[placed.v].tolist()
    return [name for name in found if name in _plain(trajectory.system)]
