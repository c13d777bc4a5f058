"""Figure of a motion under servos: efforts, work, residuals, and the distance from singular configurations."""

import numpy as np
from matplotlib.figure import Figure

from gauss.servo import Tracking, energy
from gauss.view.plots import scalar_coordinates
from gauss.view.style import NAMED, check_format, curves, saved

FLOOR = 1e-17  # a residual of exactly zero has no place on a logarithmic axis


def plot_tracking(tracking: Tracking, path=None):
    """Figure of coordinates, efforts and their work, residuals, and the smallest singular value of S, against time.

    Parameters
    ----------
    tracking : Tracking
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
    check_format(path)
    motion, servo = tracking.motion, tracking.servo
    figure = Figure(figsize=(11, 9), layout="constrained")
    (coordinates, forces), (rates, work), (gaps, hold) = figure.subplots(3, 2, sharex=True)
    curves(coordinates, motion.t, scalar_coordinates(motion), "coordinate [rad, m]")
    curves(rates, motion.t, dict(zip(motion.system.coordinates, motion.v.T, strict=True)), "rate [rad/s, m/s]")
    efforts = dict(zip(servo.efforts, tracking.efforts.T, strict=True))
    curves(forces, motion.t, efforts, f"servo effort [{', '.join(dict.fromkeys(tracking.servo.effort_units))}]")
    done = energy(tracking)
    stored = {"kinetic and potential energy": done.kinetic + done.potential - done.kinetic[0] - done.potential[0]}
    curves(work, motion.t, {f"work of {name}": part for name, part in efforts_of(tracking).items()} | stored, "energy [J]")
    errors = {n: np.abs(r) + FLOOR for n, r in zip(servo.held, tracking.residuals.T, strict=True)}
    curves(gaps, motion.t, errors, _left(tracking))
    gaps.set_yscale("log")
    curves(hold, motion.t, {"S": tracking.smallest}, "smallest singular value of S [1]")
    hold.set_ylim(0.0, 1.1 * tracking.smallest.max())
    for axes in (coordinates, forces, work, gaps):
        if 0 < len(axes.lines) <= NAMED:
            axes.legend(fontsize="small", frameon=False)
    for axes in (gaps, hold):
        axes.set_xlabel("time [s]")
    figure.suptitle(motion.system.scene.name)
    return saved(figure, path)


def efforts_of(tracking: Tracking) -> dict[str, np.ndarray]:
    """Work of each effort since the start [J]."""
    return dict(zip(tracking.servo.efforts, tracking.work.T, strict=True))


def _left(tracking: Tracking) -> str:
    units = dict.fromkeys(relation.unit for relation in tracking.servo.relations if not relation.ideal)
    return f"relation, what is left [{', '.join(units)}]"
