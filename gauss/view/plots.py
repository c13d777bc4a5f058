"""Figures of a motion against time, with units on the axes: coordinates, speeds, energies and drift, reactions."""

import numpy as np
from matplotlib.figure import Figure

from gauss.analysis import energy, unique_reactions
from gauss.dynamics.assemble import position_residual
from gauss.simulation import Trajectory
from gauss.system import coordinate_units, rate_units
from gauss.view.style import FLAT_CHANGE, INK, check_format, curves, keep_flat, legend, looks, saved, unit_sizes

FLOOR = 1e-18  # a balance of exactly zero has no place on a logarithmic axis
MOST_NAMES_IN_TITLE = 8  # names that fit into a title
BELOW_ZERO = 0.04  # of the height of an axis: a line at zero does not lie on its edge
TURN = 2 * np.pi  # [rad]
LEAST_ARM = 1e-6  # m: moments that a force has about this arm are drawn as none
ANGLES, LENGTHS, QUATERNIONS = "coordinate [rad]", "coordinate [m]", "part of a unit quaternion [1]"


def plot_motion(trajectory: Trajectory, path=None) -> Figure:
    """Figure of coordinates, rates, energies and energy balance against time.

    Turns of free bodies are drawn as rotation vectors [rad], which go on over whole turns; :func:`plot_coordinates` draws
    their quaternions. Of many coordinates, those of a joint have one colour.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
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
    """
    check_format(path)
    figure = Figure(figsize=(10, 7), layout="constrained")
    (left, right), (below, balance) = figure.subplots(2, 2, sharex=True)
    curves(left, trajectory.t, _displacements(trajectory), "coordinate [rad, m]")
    curves(right, trajectory.t, _rates(trajectory), "rate [rad/s, m/s]")
    _energies(below, balance, trajectory)
    sizes = unit_sizes(trajectory.system)
    keep_flat(left, min(sizes["rad"], sizes["m"]))
    keep_flat(right, min(sizes["rad/s"], sizes["m/s"]))
    legend(right)
    return _finished(figure, trajectory, (below, balance), path)


def plot_coordinates(trajectory: Trajectory, path=None) -> Figure:
    """Figure of all coordinates against time, those of one unit on one pair of axes.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
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
    """
    names = {"rad": ANGLES, "m": LENGTHS, "1": QUATERNIONS}
    return _by_unit(trajectory, scalar_coordinates(trajectory), coordinate_units(trajectory.system), names, path)


def plot_speeds(trajectory: Trajectory, path=None) -> Figure:
    """Figure of all rates against time, those of one unit on one pair of axes.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
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
    """
    names = {"rad/s": "rate [rad/s]", "m/s": "rate [m/s]"}
    return _by_unit(trajectory, _rates(trajectory), rate_units(trajectory.system), names, path)


def plot_energy(trajectory: Trajectory, path=None) -> Figure:
    """Figure of energies, their balance, and how far constraints are from being met.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
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
    """
    check_format(path)
    figure = Figure(figsize=(8, 8), layout="constrained")
    energies, balance, gaps = figure.subplots(3, 1, sharex=True)
    _energies(energies, balance, trajectory)
    drift = np.array([abs(position_residual(motion)).max(initial=0.0) for motion in trajectory.motions])
    gaps.set_ylabel("constraint error [rad, m]")
    if drift.any():
        gaps.semilogy(trajectory.t, drift + FLOOR, color=INK, linewidth=1.0)
    else:
        _remark(gaps, "exact: no constraint closes a loop" if not trajectory.system.has_closures else "exactly zero")
    gaps.grid(alpha=0.3)
    return _finished(figure, trajectory, [gaps], path)


def plot_reactions(trajectory: Trajectory, joints=None, path=None) -> Figure:
    """Figure of force and moment in joints against time: their sizes.

    Components that redundant constraints leave open, as those out of the plane of a planar loop, are not drawn; the title
    says so. :func:`gauss.reactions` gives their least values.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    joints : iterable of str, optional
        Joints; all when not given.
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
        If there is no such joint.

    Examples
    --------
    >>> import gauss
    >>> from gauss.view import plot_reactions
    >>> figure = plot_reactions(gauss.simulate(gauss.load("pendulum"), 0.1), ["A"])
    >>> [axis.get_ylabel() for axis in figure.axes]
    ['size of the force [N]', 'size of the moment [N m]']
    """
    check_format(path)
    joints = [joint.name for joint in trajectory.system.joints] if joints is None else list(joints)
    both = {name: unique_reactions(trajectory, name) for name in joints}
    found = {name: reaction for name, (reaction, _) in both.items()}
    figure = Figure(figsize=(8, 7), layout="constrained")
    force, moment = figure.subplots(2, 1, sharex=True)
    forces = {name: np.linalg.norm(reaction.force, axis=1) for name, reaction in found.items()}
    moments = {name: np.linalg.norm(reaction.moment, axis=1) for name, reaction in found.items()}
    curves(force, trajectory.t, forces, "size of the force [N]")
    curves(moment, trajectory.t, moments, "size of the moment [N m]")
    visible = LEAST_ARM * max(column.max(initial=0.0) for column in forces.values())
    top = max(moment.get_ylim()[1], visible)
    moment.set_ylim(-BELOW_ZERO * top, top)
    legend(force)
    undrawn = [name for name, (_, loose) in both.items() if loose]
    if undrawn:
        more = " …" if len(undrawn) > MOST_NAMES_IN_TITLE else ""
        force.set_title(f"unique components only, in {', '.join(undrawn[:MOST_NAMES_IN_TITLE])}{more}")
    return _finished(figure, trajectory, [moment], path)


def scalar_coordinates(trajectory: Trajectory) -> dict:
    """Every coordinate by name; the parts of a quaternion are named w, x, y, z."""
    return dict(zip(coordinate_units(trajectory.system), trajectory.q.T, strict=True))


def _displacements(trajectory: Trajectory) -> dict:
    """Every coordinate by the name of its rate; of a quaternion the rotation vector, continued over whole turns."""
    found = []
    for joint in trajectory.system.joints:
        k, q = joint.pair.quaternion, trajectory.q[:, joint.q]
        found.append(q if k is None else np.concatenate([q[:, :k], _turns(q[:, k:])], axis=1))
    return dict(zip(trajectory.system.coordinates, np.concatenate(found, axis=1).T, strict=True))


def _turns(Q: np.ndarray) -> np.ndarray:
    """Rotation vectors (k, 3) of unit quaternions (k, 4); each is the one that is nearest to the vector before it."""
    half = np.linalg.norm(Q[:, 1:], axis=1)
    axes = np.divide(Q[:, 1:], half[:, None], out=np.zeros((len(Q), 3)), where=half[:, None] > 0)
    angles = 2.0 * np.arctan2(half, Q[:, 0])
    found = angles[:, None] * axes
    for k in range(1, len(Q)):
        before = found[k - 1] @ axes[k]
        found[k] = (angles[k] + TURN * np.round((before - angles[k]) / TURN)) * axes[k]
    return found


def _rates(trajectory: Trajectory) -> dict:
    return dict(zip(trajectory.system.coordinates, trajectory.v.T, strict=True))


def _by_unit(trajectory: Trajectory, columns: dict, units: dict[str, str], labels: dict[str, str], path) -> Figure:
    check_format(path)
    present = [unit for unit in labels if unit in units.values()]
    figure = Figure(figsize=(8, 1.5 + 3 * len(present)), layout="constrained")
    grid = figure.subplots(len(present), 1, sharex=True, squeeze=False)[:, 0]
    for axes, unit in zip(grid, present, strict=True):
        curves(axes, trajectory.t, {name: column for name, column in columns.items() if units[name] == unit}, labels[unit])
        keep_flat(axes, unit_sizes(trajectory.system)[unit])
        legend(axes)
    return _finished(figure, trajectory, grid[-1:], path)


def _finished(figure: Figure, trajectory: Trajectory, lowest, path) -> Figure:
    for axes in lowest:
        axes.set_xlabel("time [s]")
    figure.suptitle(trajectory.system.scene.name)
    return saved(figure, path)


def _energies(axes, below, trajectory: Trajectory):
    """Energies, and their balance; of a scene at rest, whose energies are rounding, in the scale of the scene."""
    found, own = energy(trajectory), unit_sizes(trajectory.system)["J"]
    rows = {"kinetic": found.kinetic, "potential": found.potential - found.potential[0]}
    rows |= {"drives": found.drives, "loads": found.loads, "dissipated": found.dissipated}
    for k, (name, row) in enumerate(rows.items()):
        if row.any():
            axes.plot(trajectory.t, row, label=name, **looks(k))
    keep_flat(axes, own)
    axes.set_ylabel("energy since the start [J]")
    legend(axes, beside=False)
    axes.grid(alpha=0.3)
    scale = found.scale if found.scale > FLAT_CHANGE * own else own
    below.semilogy(trajectory.t[1:], abs(found.balance[1:]) / scale + FLOOR, color=INK, linewidth=1.0)
    below.set_ylabel("energy balance, relative [1]")
    below.grid(alpha=0.3)


def _remark(axes, text: str):
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", color="0.5")
    axes.set_yticks([])
