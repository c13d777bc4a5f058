"""Figures of rotor networks: speeds, slips, link torques and losses over time; the network itself."""

from collections import Counter
from itertools import product

import numpy as np
from matplotlib.figure import Figure

from gauss.errors import FileError
from gauss.rotors import Clutch, FrictionDrive, Gear, Network, OneWayClutch, RotorMotion, TorqueLimiter, TorsionSpring
from gauss.view.style import COLOURS, check_format, legend, looks, saved

STYLES = {  # kind of link → colour, line, name in the legend
    Gear: ("black", "-", "gear, belt"),
    FrictionDrive: (COLOURS[1], "-", "friction drive"),
    TorsionSpring: (COLOURS[2], "--", "spring"),
    Clutch: (COLOURS[0], "-.", "clutch"),
    TorqueLimiter: (COLOURS[3], "-.", "torque limiter"),
    OneWayClutch: (COLOURS[5], ":", "freewheel"),
}
WIDEST = 1.05  # a slip beyond 1 shows that the driver stands or a shaft turns back; the axis ends there, and says so
NARROWEST = 0.01  # range of the axis of slips: a constant slip is a straight line, without its rounding
MARKED = 40  # more events than this are not marked one by one
DRAWN = 60  # more shafts than this make no drawing that fits a page


def plot_rotors(motion: RotorMotion, path=None) -> Figure:
    """Figure of speeds, slips, link torques and lost energies against time; events are grey lines.

    Parameters
    ----------
    motion : RotorMotion
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
    links = {link.name: looks(b) for b, link in enumerate(motion.reduced.links)}  # the same in all axes
    slipping = {link.name: links[link.name] for link in motion.reduced.links if _slips_ever(link)}
    shafts = {name: looks(j) for j, name in enumerate(motion.reduced.names)}
    figure = Figure(figsize=(12, 7.5), layout="constrained")
    (speeds, slips), (torques, losses) = figure.subplots(2, 2, sharex=True)
    _curves(speeds, motion.t, {name: motion.speed(name) for name in shafts}, shafts, "speed [rad/s]")
    _slips(slips, motion, slipping)
    _curves(torques, motion.t, {name: motion.torque(name) for name in links}, links, "link torque on the driven shaft [N m]")
    _losses(losses, motion, links)
    times = [event.time for event in motion.events]
    for axes, time in product((speeds, slips, torques, losses), times if len(times) <= MARKED else ()):
        axes.axvline(time, color="0.75", linewidth=0.7, zorder=0)
    for axes in (torques, losses):
        axes.set_xlabel("time [s]")
    marks = "; grey lines: events" if 0 < len(times) <= MARKED else ""
    figure.suptitle(f"{motion.reduced.network.name}{marks}")
    return saved(figure, path)


def _slips_ever(link) -> bool:
    """Whether a link can slip, or slips always."""
    return link.dry or isinstance(link, FrictionDrive) or (isinstance(link, Gear) and link.slip > 0)


def _curves(axes, t, columns: dict, lines: dict, label: str):
    for name, column in columns.items():
        axes.plot(t, column, label=name, **lines[name])
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    legend(axes)


def _slips(axes, motion: RotorMotion, lines):
    columns = {name: motion.slip(name) for name in lines}
    values = np.concatenate([column[np.isfinite(column)] for column in columns.values()] or [np.zeros(0)])
    least, most = values.min(initial=0.0), values.max(initial=0.0)
    cut = max(most, -least) > WIDEST
    _curves(axes, motion.t, columns, lines, f"slip [1]{', cut where a driver stands or turns back' if cut else ''}")
    low, high = max(least, -WIDEST), min(max(most, least + NARROWEST), WIDEST)
    axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
    if not lines:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no link slips", transform=axes.transAxes, ha="center", color="0.5")


def _losses(axes, motion: RotorMotion, lines):
    scale, unit = (1e-3, "kJ") if motion.energy().scale > 1e4 else (1.0, "J")
    columns = {name: scale * motion.loss(name) for name in lines if np.abs(motion.loss(name)).max() > 0}
    _curves(axes, motion.t, columns, lines, f"energy lost in links [{unit}]")
    if not columns:
        axes.text(0.5, 0.5, "no link loses energy", transform=axes.transAxes, ha="center", color="0.5")


def draw_network(network: Network, path=None) -> Figure:
    """Drawing of a network: shafts as discs that grow with inertia, links as arrows from driver to driven.

    Parameters
    ----------
    network : Network
        The network.
    path : str or Path, optional
        Where to save it: .png, .svg or .pdf.

    Returns
    -------
    Figure
        The figure; matplotlib's, not shown.

    Raises
    ------
    FileError
        If the format is none of these, or there are too many shafts to be drawn.
    """
    check_format(path)
    if len(network.shafts) > DRAWN:
        raise FileError(
            f"{network.name!r} has {len(network.shafts)} shafts; at most {DRAWN} fit a drawing: draw a part of it."
        )
    places = layout(network)
    columns, rows = (len({place[k] for place in places.values()}) for k in (0, 1))
    figure = Figure(figsize=(max(6.0, 2.1 * columns + 1.5), max(3.2, 1.5 * rows + 1.6)), layout="constrained")
    axes = figure.add_subplot()
    sizes = {name: _size(network, name) for name in places}
    _draw_links(axes, network, places, sizes)
    _draw_shafts(axes, network, places, sizes)
    _legend(axes, network)
    x, y = zip(*places.values(), strict=True)
    axes.set_xlim(min(x) - 0.6, max(x) + 0.6)
    axes.set_ylim(min(y) - 0.75, max(y) + 0.5)
    axes.set_axis_off()
    axes.set_title(network.name)
    return saved(figure, path)


def _draw_links(axes, network: Network, places: dict, sizes: dict):
    """Arrows from driver to driven; those between the same shafts are bent apart."""
    seen: Counter = Counter()
    for link in network.links.values():
        colour, line, kind = STYLES[type(link)]
        (x0, y0), (x1, y1) = places[link.driver], places[link.driven]
        bend = 0.25 * seen[frozenset((link.driver, link.driven))]
        seen[frozenset((link.driver, link.driven))] += 1
        arrow = {"arrowstyle": "-|>", "color": colour, "linestyle": line, "linewidth": 1.6}
        arrow |= {
            "shrinkA": sizes[link.driver] / 2,
            "shrinkB": sizes[link.driven] / 2,
            "connectionstyle": f"arc3,rad={bend}",
        }
        axes.annotate("", (x1, y1), (x0, y0), arrowprops=arrow)
        middle = 0.5 * (x0 + x1), 0.5 * (y0 + y1) - 0.35 * bend
        text = link.name if link.ratio == 1 else f"{link.name}\ni = {link.ratio:g}"
        axes.text(*middle, text, color=colour, fontsize=8, ha="center", va="center", bbox=_PATCH, zorder=4)


def _draw_shafts(axes, network: Network, places: dict, sizes: dict):
    """Discs in the colours of their torques."""
    for name, (x, y) in places.items():
        roles = {torque.role for torque in network.torques.values() if torque.shaft == name}
        face = "#cfe8cf" if "motor" in roles else "#f6d5c5" if "load" in roles else "#eeeeee"
        axes.plot(x, y, "o", markersize=sizes[name], markerfacecolor=face, markeredgecolor="black", zorder=5)
        below = f"{name}\n{network.shafts[name].inertia:g} kg m²"
        axes.annotate(
            below, (x, y), (0, -sizes[name] / 2 - 3), textcoords="offset points", ha="center", va="top", fontsize=9
        )


_PATCH = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}


def layout(network: Network) -> dict[str, tuple[float, float]]:
    """Place of each shaft: to the right of what drives it, branches below each other."""
    driven: dict[str, list] = {name: [] for name in network.shafts}
    for link in network.links.values():
        driven[link.driver].append(link.driven)
    everything_driven = {link.driven for link in network.links.values()}
    depth, order = {}, [name for name in network.shafts if name not in everything_driven] or list(network.shafts)[:1]
    order += [name for name in network.shafts if name not in order]
    places: dict[str, tuple[float, float]] = {}
    row = 0.0

    def place(name: str, column: int) -> float:
        """Place a shaft and what it drives; returns its row."""
        nonlocal row
        depth[name] = column
        rows = []
        for child in driven[name]:
            if child not in depth:
                rows.append(place(child, column + 1))
        if not rows:
            rows, row = [row], row - 1.0
        places[name] = (float(column), sum(rows) / len(rows))
        return places[name][1]

    for name in order:
        if name not in depth:
            place(name, 0)
    return places


def _size(network: Network, name: str) -> float:
    """Diameter of the disc [points]: J grows with the fourth power of a radius, half of that shows it."""
    largest = max(shaft.inertia for shaft in network.shafts.values())
    return 12.0 + 22.0 * (network.shafts[name].inertia / largest) ** 0.25


def _legend(axes, network: Network):
    for kind in dict.fromkeys(type(link) for link in network.links.values()):
        colour, line, name = STYLES[kind]
        axes.plot([], [], color=colour, linestyle=line, label=name)
    for face, name in (("#cfe8cf", "driven by a motor"), ("#f6d5c5", "loaded")):
        axes.plot([], [], "o", markerfacecolor=face, markeredgecolor="black", linestyle="none", label=name)
    axes.legend(fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=4)
