"""Error against wall time on logarithmic scales: what a digit costs, with the Pareto front, and failures at the border."""

from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

# Okabe and Ito's colours, told apart by colour-blind readers; marks and lines tell them apart in grey
COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7F7F7F", "#5D3A9B", "#994F00")
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
ZERO = {"marker": "*", "markersize": 10, "markeredgewidth": 0.8, "linestyle": ""}  # of an error of zero
PANELS_IN_ROW = 3  # panels in a row
LETTERS, LINES = 40, 5  # of a reason: in a line, and lines
LINE = 0.042  # height of a line of a reason, of that of the panel


def plot_precision(panels, path=None, title: str = "", note: str = "", uncertainties=None) -> Figure:
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
    uncertainties : dict, optional
        {name of the scene: how far its reference may be off [m]}, drawn as a band.
    """
    columns = min(PANELS_IN_ROW, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(6.6 * columns + (1.4 if columns == 1 else 0), 3.9 * rows + 1.3), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    names = sorted({(one.engine != "gauss", one.engine, one.method) for found in panels.values() for one in found})
    looks = _looks(names)
    for place, (name, found) in zip(axes.flat, panels.items(), strict=False):
        _panel(place, name, found, looks, (uncertainties or {}).get(name, 0.0), _decades(panels))
    for place in list(axes.flat)[len(panels) :]:
        place.set_axis_off()
    handles: dict = {}
    for place in axes.flat:
        for handle, label in zip(*place.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    columns = min(6, 2 + columns)
    figure.legend(
        list(handles.values()), list(handles), loc="outside lower center", ncols=columns, fontsize=8, frameon=False
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


def refusals(found) -> dict[str, list[str]]:
    """Reasons why attempts have no result, each once, with the methods that it stopped and at how many settings."""
    methods: dict[str, dict[str, int]] = {}
    counts: dict[str, int] = {}
    for one in found:
        label = _label(one.engine, one.method)
        counts[label] = counts.get(label, 0) + 1
        if one.reason:
            stopped = methods.setdefault(one.reason, {})
            stopped[label] = stopped.get(label, 0) + 1
    return {
        reason: [label if n == counts[label] else f"{label} ({n} of {counts[label]})" for label, n in stopped.items()]
        for reason, stopped in methods.items()
    }


def _label(engine: str, method: str) -> str:
    return method if engine == "gauss" else f"{engine} {method}".strip()


def _decades(panels) -> tuple[float, float]:
    """Whole decades around all errors that are not zero, and one below them for those that are."""
    errors = [one.error for found in panels.values() for one in found if not one.reason and one.error > 0.0] or [1.0]
    return 10.0 ** (np.floor(np.log10(min(errors))) - 1), 10.0 ** np.ceil(np.log10(max(errors)) + 0.1)


def _panel(axes, name: str, found, looks, uncertainty: float, decades: tuple[float, float]):
    done, (floor, top) = [one for one in found if not one.reason], decades
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(floor, top)
    if uncertainty > floor:
        axes.axhspan(floor, uncertainty, color="0.93", linewidth=0, zorder=-1, label="uncertainty of the reference")
    _pareto_front(axes, done, floor)
    for (engine, method), look in looks.items():
        own = sorted((one for one in done if (one.engine, one.method) == (engine, method)), key=lambda one: -one.setting)
        _curve(axes, own, look, _label(engine, method), floor)
    if done:
        times = np.log10([one.seconds for one in done])
        axes.set_xlim(10.0 ** np.floor(times.min()), 10.0 ** np.ceil(times.max() + 0.01))
    for axis in (axes.xaxis, axes.yaxis):  # whole decades alone have numbers: those between them would collide
        axis.set_major_locator(LogLocator(numticks=9))
        axis.set_minor_formatter(NullFormatter())
    _refusals_beside(axes, found)
    axes.set_title(name, fontsize=10)
    axes.set_xlabel("wall time of a run, compiled [s]", fontsize=8)
    axes.set_ylabel("error of the centres of mass at the end [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.25)


def _pareto_front(axes, done, floor: float):
    best, front = np.inf, []
    for one in sorted(done, key=lambda one: (one.seconds, one.error)):
        if one.error < best:
            best = one.error
            front.append((one.seconds, max(one.error, floor)))
    if front:
        seconds, errors = zip(*front, strict=True)
        axes.plot(seconds, errors, color="0.8", linewidth=7, zorder=0, label="Pareto front", solid_joinstyle="round")


def _curve(axes, own, look: dict, label: str, floor: float):
    """Errors of one method; those that are zero at the floor."""
    if own:
        curve = [one for one in own if one.error > 0.0]
        axes.plot([one.seconds for one in curve], [one.error for one in curve], **look, label=label)
    exact = [one.seconds for one in own if one.error == 0.0]
    if exact:
        axes.plot(exact, [floor] * len(exact), color=look["color"], **ZERO, clip_on=False, zorder=4)
        axes.plot([], [], color="black", **ZERO, label="the reference, to the last bit")


def _refusals_beside(axes, found):
    height = 0.99
    for reason, methods in refusals(found).items():
        lines = wrap(f"{', '.join(methods)}: {reason}", LETTERS)
        lines = lines if len(lines) <= LINES else [*lines[: LINES - 1], f"{lines[LINES - 1]} …"]
        axes.text(1.025, height, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=6.5)
        height -= LINE * (len(lines) + 0.7)
