"""Error against wall time on logarithmic scales: what a digit costs, with the Pareto front, and failures at the border."""

from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart by colour-blind readers; marks and lines tell them apart in grey
COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7F7F7F", "#5D3A9B", "#994F00")
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
LEAST, MOST = 1e-16, 10.0  # m: errors below are drawn at the least
WIDE = 3  # panels in a row
LETTERS = 44  # of a reason in a line


def plot_precision(panels, path=None, title: str = "", note: str = "") -> Figure:
    """Draw work–precision charts.

    Parameters
    ----------
    panels : dict
        {name of the scene: attempts}, see :class:`gauss.bench.precision.Attempt`; attempts have ``engine``, ``method``,
        ``error`` [m], ``seconds``, ``reason``.
    path : str or Path, or several, optional
        Where to save it: .png, .svg or .pdf.
    title, note : str
        Above and below the panels.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    columns = min(WIDE, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(6.6 * columns + (1.4 if columns == 1 else 0), 3.9 * rows + 1.3), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    names = sorted({(one.engine != "gauss", one.engine, one.method) for found in panels.values() for one in found})
    looks = _looks(names)
    for place, (name, found) in zip(axes.flat, panels.items(), strict=False):
        _panel(place, name, found, looks)
    for place in list(axes.flat)[len(panels) :]:
        place.set_axis_off()
    handles = {}
    for place in axes.flat:
        for handle, label in zip(*place.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=min(6, 2 + columns), fontsize=8, frameon=False
    )
    figure.suptitle("\n".join(filter(None, (title, note))), fontsize=10)
    for one in [] if path is None else [path] if isinstance(path, str | Path) else path:
        with rc_context({"svg.fonttype": "none"}):  # letters as letters, not as thousands of outlines
            figure.savefig(one, dpi=100)
    return figure


def _looks(names) -> dict:
    """Colour, mark, and line of each method: gauss filled and solid, others hollow and dashed."""
    found, ours, theirs = {}, 0, 0
    for foreign, engine, method in names:
        k = theirs if foreign else ours
        colour = COLOURS[k % len(COLOURS)]
        look = {"color": colour, "marker": MARKS[k % len(MARKS)], "markersize": 5, "linewidth": 1.0}
        found[engine, method] = look | (
            {"markerfacecolor": "white", "linestyle": "--"} if foreign else {"markerfacecolor": colour, "linestyle": "-"}
        )
        ours, theirs = (ours, theirs + 1) if foreign else (ours + 1, theirs)
    return found


def _panel(axes, name: str, found, looks):
    done = [one for one in found if not one.reason]
    best, front = np.inf, []
    for one in sorted(done, key=lambda one: (one.seconds, one.error)):
        if one.error < best:
            best = one.error
            front.append((one.seconds, max(one.error, LEAST)))
    if front:
        axes.plot(
            *zip(*front, strict=True), color="0.8", linewidth=7, zorder=0, label="Pareto front", solid_joinstyle="round"
        )
    failures = {}
    for (engine, method), look in looks.items():
        own = sorted((one for one in done if (one.engine, one.method) == (engine, method)), key=lambda one: -one.setting)
        label = method if engine == "gauss" else f"{engine} {method}".strip()
        if own:
            axes.plot([one.seconds for one in own], [max(one.error, LEAST) for one in own], **look, label=label)
        failed = [one for one in found if one.reason and (one.engine, one.method) == (engine, method)]
        if failed:
            part = "" if not own else f" ({len(failed)} of {len(failed) + len(own)})"
            failures[label + part] = (look, failed[0].reason)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(LEAST / 3, MOST * 3)
    for k, (label, (look, reason)) in enumerate(failures.items()):
        height, style = 0.97 - 0.075 * k, {key: look.get(key) for key in ("color", "marker", "markerfacecolor")}
        axes.plot(1.0, height, transform=axes.transAxes, clip_on=False, linestyle="", markersize=5, zorder=5, **style)
        words = "\n".join(wrap(f"{label}: {reason}", LETTERS)[:2])
        axes.text(1.025, height, words, transform=axes.transAxes, ha="left", va="center", fontsize=5.5, linespacing=0.9)
    axes.set_title(name, fontsize=10)
    axes.set_xlabel("wall time of a run, compiled [s]", fontsize=8)
    axes.set_ylabel("error of the centres of mass at the end [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.25)
