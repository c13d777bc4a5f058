"""Figures and animations of linkages, as a designer would put them in a report."""

from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from gauss.errors import FileError
from gauss.linkages import Cycle
from gauss.scene import GROUND
from gauss.view.linkage_drawing import INK, Drawing
from gauss.view.style import check_format, saved

POSITIONS = 4  # of the mechanism in the figure
FRAMES = 90  # pictures of an animation, at most
MOVIES: dict[str, type[PillowWriter] | type[FFMpegWriter]] = {".gif": PillowWriter, ".mp4": FFMpegWriter}
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 2)), (0, (8, 2)))  # curves differ in grey, too


def plot_linkage(found: Cycle, path=None, points=()):
    """Figure of a cycle: mechanism, torque, reactions, bearing forces on the frame, transmission angles, coupler curves.

    Parameters
    ----------
    found : Cycle
        Crank angles in order, both ends of a turn among them.
    path : str or Path, optional
        Where to save it: .png, .svg or .pdf.
    points : iterable of (str, array_like (2,))
        Links and points of them, in their frames [m], whose curves are drawn; the middles of the joints of each coupler when
        none are given.

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
    figure = Figure(figsize=(15, 8.5), layout="constrained")
    grid = figure.add_gridspec(2, 3)
    _positions(figure.add_subplot(grid[0, 0]), found)
    _torque(figure.add_subplot(grid[0, 1]), found)
    _reactions(figure.add_subplot(grid[1, 0]), found)
    _bearings(figure.add_subplot(grid[1, 1], projection="polar"), found)
    _transmission(figure.add_subplot(grid[0, 2]), found)
    _coupler_curves(figure.add_subplot(grid[1, 2]), found, tuple(points))
    figure.suptitle(f"{found.chain.name}, crank at {found.motion.crank_speed[0]:.4g} rad/s")
    return saved(figure, path)


def _positions(axes, found: Cycle):
    drawing = Drawing(axes, found)
    drawing.ground()
    _paths(drawing)
    indices = np.linspace(0, len(found), POSITIONS, endpoint=False).astype(int)
    for index in indices[:0:-1]:
        drawing.links(index, alpha=0.25)
    drawing.links(indices[0])
    drawing.names(indices[0])
    angles = ", ".join(f"{np.degrees(found.crank_angle[i]) % 360:.0f}°" for i in indices)
    axes.set_title(f"at crank angles {angles}", fontsize="medium")


def _paths(drawing: Drawing):
    """Curves of the pins between moving links."""
    for joint in drawing.found.chain.joints:
        if joint.kind == "revolute" and GROUND not in (joint.parent, joint.child):
            drawing.path(joint.child, joint.point(joint.child))


def _angle_axis(axes, found: Cycle):
    axes.set_xlabel("crank angle [°]")
    axes.set_xlim(*np.degrees([found.crank_angle.min(), found.crank_angle.max()]))
    if np.ptp(found.crank_angle) > np.pi:
        axes.xaxis.set_major_locator(MultipleLocator(60))
    axes.grid(alpha=0.3)


def _torque(axes, found: Cycle):
    angle = np.degrees(found.crank_angle)
    axes.plot(angle, found.torque, color=INK, linewidth=1.5)
    axes.fill_between(angle, 0.0, found.torque, color="#0072B2", alpha=0.2, linewidth=0)
    axes.axhline(0.0, color=INK, linewidth=0.6)
    _angle_axis(axes, found)
    axes.set_ylabel("driving torque [N m]")
    axes.set_title("torque of the motor on the crank", fontsize="medium")


def _transmission(axes, found: Cycle):
    for k, (group, angle) in enumerate(found.transmission().items()):
        axes.plot(
            np.degrees(found.crank_angle),
            np.degrees(angle),
            color=f"C{k % 10}",
            linestyle=DASHES[k % len(DASHES)],
            label=group,
        )
    _angle_axis(axes, found)
    axes.set_ylim(0.0, 90.0)
    axes.set_ylabel("transmission angle [°]")
    axes.set_title("transmission angles (0°: singular)", fontsize="medium")
    if axes.lines:
        axes.legend(fontsize="small", frameon=False)


def _coupler_curves(axes, found: Cycle, points: tuple):
    for k, (link, point) in enumerate(points or coupler_points(found)):
        x, y = found.link(link).point(complex(*point)).view(float).reshape(-1, 2).T
        axes.plot(x, y, color=f"C{k % 10}", label=f"{link} ({point[0]:.4g}, {point[1]:.4g}) m")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.set_title("coupler curves", fontsize="medium")
    if axes.lines:
        axes.legend(fontsize="small", frameon=False)


def coupler_points(found: Cycle) -> list[tuple[str, tuple[float, float]]]:
    """Couplers, which no joint holds on the ground, and the middle of the joints of each in its frame [m]."""
    held = {j.child for j in found.chain.joints if j.parent == GROUND} | {
        j.parent for j in found.chain.joints if j.child == GROUND
    }
    couplers = [link.name for link in found.chain.links if link.name not in held]
    middles = [np.mean(Drawing.corners_of(found.chain, name)) for name in couplers]
    return [(name, (float(z.real), float(z.imag))) for name, z in zip(couplers, middles, strict=True)]


def _reactions(axes, found: Cycle):
    for k, joint in enumerate(found.chain.joints):
        force = np.hypot(*found.reaction(joint.name).force.T)
        colour, style = f"C{k % 10}", DASHES[k % len(DASHES)]
        axes.plot(np.degrees(found.crank_angle), force, color=colour, linestyle=style, linewidth=1.4, label=joint.name)
    _angle_axis(axes, found)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("reaction [N]")
    axes.set_title("forces in the joints", fontsize="medium")
    axes.legend(fontsize="small", frameon=False, ncols=2)


def _bearings(axes, found: Cycle):
    for k, joint in enumerate(found.chain.joints):
        if joint.kind == "revolute" and GROUND in (joint.parent, joint.child):
            force = found.reaction(joint.name).force @ [1, 1j]
            force = -force if joint.parent == GROUND else force  # on the frame
            colour, style = f"C{k % 10}", DASHES[k % len(DASHES)]
            axes.plot(np.angle(force), np.abs(force), color=colour, linestyle=style, linewidth=1.4, label=joint.name)
    axes.set_title("force on the bearings of the frame [N]", fontsize="medium")
    axes.legend(fontsize="small", frameon=False, loc="lower left", bbox_to_anchor=(1.0, 0.0))
    axes.tick_params(labelsize="small")
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set_rlabel_position(100)
    axes.grid(alpha=0.4)


def animate_linkage(found: Cycle, path, fps: int = 30) -> Path:
    """Animation of a cycle: the mechanism, and the driving torque beside it.

    Parameters
    ----------
    found : Cycle
        Crank angles in order; every so many of them become pictures.
    path : str or Path
        Where to save it: .gif, or .mp4 where ffmpeg is installed.
    fps : int
        Pictures per second.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FileError
        If the format is neither, or its encoder is not there.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> import tempfile
    >>> from gauss.view import animate_linkage
    >>> folder = tempfile.mkdtemp()
    >>> animate_linkage(bar.cycle([0.0, 0.5]), f"{folder}/turn.gif").name
    'turn.gif'
    """
    path = Path(path)
    writer = MOVIES.get(path.suffix.lower())
    if writer is None:
        raise FileError(f"{path}: an animation is saved as one of {', '.join(MOVIES)}.")
    if not writer.isAvailable():
        raise FileError(f"{path}: needs the program ffmpeg, which is not installed; save it as .gif instead.")
    figure = Figure(figsize=(9, 4.2), layout="constrained", dpi=100)
    left, right = figure.subplots(1, 2)
    drawing = Drawing(left, found)
    drawing.ground()
    _paths(drawing)
    _torque(right, found)
    figure.suptitle(found.chain.name)
    (dot,) = right.plot([], [], "o", color="#D55E00", markersize=8)
    movie = writer(fps=fps)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the panels stay where they are
    with movie.saving(figure, path, dpi=100):
        for index in range(0, len(found) - 1, max(1, -(-len(found) // FRAMES))):
            artists = drawing.links(index)
            dot.set_data([np.degrees(found.crank_angle[index])], [found.torque[index]])
            movie.grab_frame()
            for artist in artists:
                artist.remove()
    return path
