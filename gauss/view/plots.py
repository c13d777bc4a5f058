"""Figures of a motion, with units on the axes."""

from pathlib import Path

from matplotlib.figure import Figure

from gauss.audit import Energy, energy
from gauss.errors import FileError
from gauss.simulation import Trajectory
from gauss.system import coordinate_units

FORMATS = (".png", ".svg", ".pdf")
NAMED = 12  # more curves than this need no legend: nobody can tell them apart
FLOOR = 1e-18  # a balance of exactly zero has no place on a logarithmic axis


def plot_motion(trajectory: Trajectory, path=None):
    """Figure of coordinates, rates, energies and energy balance against time.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    path : str or Path, optional
        Where to save it: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Raises
    ------
    FileError
        If the format is none of these.
    """
    if path is not None and Path(path).suffix.lower() not in FORMATS:
        raise FileError(f"{path}: a figure is saved as one of {', '.join(FORMATS)}.")
    figure = Figure(figsize=(10, 7), layout="constrained")
    (left, right), (below, balance) = figure.subplots(2, 2, sharex=True)
    names = trajectory.system.coordinates
    curves(left, trajectory.t, scalar_coordinates(trajectory), "coordinate [rad, m]")
    curves(right, trajectory.t, dict(zip(names, trajectory.v.T, strict=True)), "rate [rad/s, m/s]")
    _energies(below, trajectory.t, found := energy(trajectory))
    _balance(balance, trajectory.t, found)
    for axes in (below, balance):
        axes.set_xlabel("time [s]")
    if len(names) <= NAMED:
        right.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small", frameon=False)
    figure.suptitle(trajectory.system.scene.name)
    if path is not None:
        figure.savefig(path, dpi=150)
    return figure


def scalar_coordinates(trajectory: Trajectory) -> dict:
    """Every coordinate by name; the parts of a quaternion are named w, x, y, z."""
    return dict(zip(coordinate_units(trajectory.system), trajectory.q.T, strict=True))


def curves(axes, t, columns: dict, label: str):
    """Draw named curves against time, with the label of their axis."""
    for name, column in columns.items():
        axes.plot(t, column, linewidth=1.2, label=name)
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)


def _energies(axes, t, found: Energy):
    rows = {"kinetic": found.kinetic, "potential": found.potential - found.potential[0]}
    rows |= {"drives": found.drives, "loads": found.loads, "dissipated": found.dissipated}
    for (name, row), style in zip(rows.items(), ("-", "--", "-.", ":", (0, (1, 3))), strict=True):
        if row.any():
            axes.plot(t, row, linestyle=style, linewidth=1.2, label=name)
    axes.set_ylabel("energy since the start [J]")
    axes.legend(fontsize="small", frameon=False)
    axes.grid(alpha=0.3)


def _balance(axes, t, found: Energy):
    axes.semilogy(t[1:], abs(found.balance[1:]) / max(found.scale, FLOOR) + FLOOR, color="black", linewidth=1.0)
    axes.set_ylabel("energy balance, relative")
    axes.grid(alpha=0.3)
