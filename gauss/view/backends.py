"""Figures of the comparison of backends: errors, time against error, profiles, and the atlas of stability."""

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gauss.view.style import LINES, PAGE_DPI, saved

SMALLEST_SHOWN, LARGEST_SHOWN = 1e-17, 1e1  # of the errors that are drawn; what is off is drawn at the edge
LEVELS = {"low": "#9ecae1", "mid": "#4292c6", "high": "#08519c", "tightest": "#08306b", "own": "#d95f02"}
VERDICTS = ("#7fbf7b", "#fee08b", "#d9d9d9", "#f0f0f0", "#d7191c")  # passed, degraded, honest, slow, silent
Panel = tuple[Mapping[str, Sequence[float]], list[str]]  # times and errors by solver, and the names of those on the front
MARKERS = "osD^v<>PX*"
COLUMNS = 5
ZERO = SMALLEST_SHOWN / 30.0  # where errors of exactly zero are drawn, below a line and with a tick of their own


def plot_errors(names, problems, errors, broken, path=None, title: str = "") -> Figure:
    """Map of errors, backend by problem.

    Parameters
    ----------
    names, problems : sequence of str
        Rows and columns.
    errors : ndarray, shape (rows, columns)
        Relative errors; NaN where there is no answer.
    broken : ndarray of bool, shape (rows, columns)
        Where the backend claims success with residuals above the tolerance asked for; framed.
    path : str or Path, optional
        Where to save it.
    """
    figure = Figure(figsize=(1.8 + 0.62 * len(problems), 1.9 + 0.3 * len(names)), layout="constrained")
    axes = figure.subplots()
    shown = np.clip(np.where(np.isfinite(errors), errors, np.nan), SMALLEST_SHOWN, LARGEST_SHOWN)
    image = axes.imshow(shown, norm=LogNorm(SMALLEST_SHOWN, LARGEST_SHOWN), cmap="RdYlBu_r", aspect="auto")
    for i, j in np.ndindex(errors.shape):
        text = f"{errors[i, j]:.0e}".replace("e-0", "e-").replace("e+0", "e+") if np.isfinite(errors[i, j]) else "–"
        axes.text(j, i, text, ha="center", va="center", fontsize=6.5, weight="bold" if broken[i, j] else "normal")
        if broken[i, j]:
            axes.add_patch(_frame(j, i))
    axes.set_xticks(range(len(problems)), problems, rotation=45, ha="right", fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    figure.colorbar(image, ax=axes, label="relative error of the accelerations [1]", fraction=0.03)
    axes.set_title(f"{title}\nframed: claimed success, residuals above the tolerance and rounding; –: no answer", fontsize=9)
    return saved(figure, path, PAGE_DPI)


def plot_time_error(rows, names, path=None, title: str = "") -> Figure:
    """Time against error, one panel for each backend; grey are the answers of all others."""
    columns = 6
    figure = Figure(figsize=(14, 2.3 * -(-len(names) // columns) + 0.6), layout="constrained")
    panels = figure.subplots(-(-len(names) // columns), columns, sharex=True, sharey=True, squeeze=False)
    everything = np.array([_point(row) for row in rows if np.isfinite(row["seconds"]) and np.isfinite(row["error"])])
    for axes, name in zip(panels.flat, names, strict=False):
        _answers(axes, everything, [row for row in rows if row["backend"] == name], name)
    for axes in panels.flat[len(names) :]:
        axes.set_visible(False)
    for axes in panels.flat[max(0, len(names) - columns) : len(names)]:
        axes.set_xlabel("relative error [1]", fontsize=8)
        axes.tick_params(labelbottom=True)
    for axes in panels[:, 0]:
        axes.set_ylabel("time of a solve [s]", fontsize=8)
    handles = [figure.axes[0].scatter([], [], s=14, color=colour) for colour in LEVELS.values()]
    figure.legend(handles, LEVELS, loc="outside lower center", ncols=len(LEVELS), fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=10)
    return saved(figure, path, PAGE_DPI)


def _answers(axes, everything: np.ndarray, mine: list[dict], name: str):
    """Panel of one backend before the answers of all."""
    if everything.size:
        axes.scatter(*everything.T, s=3, color="0.87", linewidths=0)
    for level, colour in LEVELS.items():
        own = [_point(row) for row in mine if row["level"] == level and np.isfinite(row["error"])]
        if own:
            axes.scatter(*np.array(own).T, s=11, color=colour, linewidths=0, label=level)
    missing = sum(not np.isfinite(row["error"]) for row in mine)
    axes.set_title(name + (f" ({missing} without an answer)" if missing else ""), fontsize=9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(color="0.93")
    axes.set_axisbelow(True)


def plot_profiles(profiles: dict[str, dict], ratios, path=None, title: str = "") -> Figure:
    """Performance profiles, one panel for each accuracy asked for; the best are named first."""
    rows = max(-(-len(profiles) // 2), 1)
    figure = Figure(figsize=(13, 5.2 * rows), layout="constrained")
    panels = figure.subplots(rows, 2, sharey=True, squeeze=False)
    for axes, (label, curves) in zip(panels.flat, profiles.items(), strict=False):
        order = sorted(curves, key=lambda name: (-curves[name][-1], -curves[name].mean()))
        for k, name in enumerate(order):
            axes.step(ratios, curves[name], where="post", color=f"C{k % 10}", linestyle=LINES[k // 10], label=name)
        axes.set_xscale("log")
        axes.set_xlabel("time over that of the fastest [1]")
        axes.set_title(label, fontsize=10)
        axes.grid(color="0.93")
        axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    for axes in panels.flat[len(profiles) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel("share of the problems [1]")
    figure.suptitle(title, fontsize=10)
    return saved(figure, path, PAGE_DPI)


def _point(row) -> tuple[float, float]:
    return float(np.clip(row["error"], SMALLEST_SHOWN, LARGEST_SHOWN)), row["seconds"]


def _frame(j: int, i: int):
    from matplotlib.patches import Rectangle

    return Rectangle((j - 0.47, i - 0.47), 0.94, 0.94, fill=False, edgecolor="black", linewidth=1.4)


def plot_atlas(methods, cases, verdicts, figures, order, path=None, title: str = "") -> Figure:
    """Methods by cases, coloured by verdict, with the figures behind them.

    Parameters
    ----------
    methods, cases : sequence of str
        Rows and columns.
    verdicts : sequence of sequence of str
        Verdict of each cell; "" where there is none.
    figures : ndarray, shape (rows, columns)
        Figure of each cell; NaN where there is none.
    order : sequence of str
        All verdicts, the best first.
    path : str or Path, optional
        Where to save it.
    """
    figure = Figure(figsize=(2.6 + 0.52 * len(cases), 2.6 + 0.27 * len(methods)), layout="constrained")
    axes = figure.subplots()
    codes = np.array([[order.index(v) if v else np.nan for v in row] for row in verdicts])
    axes.imshow(codes, cmap=ListedColormap(VERDICTS), vmin=-0.5, vmax=len(order) - 0.5, aspect="auto")
    for i, j in np.ndindex(codes.shape):
        if np.isfinite(figures[i, j]):
            text = f"{figures[i, j]:.0e}".replace("e-0", "e-").replace("e+0", "e")
            axes.text(j, i, text, ha="center", va="center", fontsize=5.8)
    axes.set_xticks(range(len(cases)), cases, rotation=45, ha="right", fontsize=7.5)
    axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
    axes.set_xticks(np.arange(len(cases)) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(methods)) - 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=1.0)
    axes.tick_params(which="minor", length=0)
    handles = [Patch(facecolor=colour, edgecolor="0.6", label=name) for name, colour in zip(order, VERDICTS, strict=True)]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(order), fontsize=8, frameon=False)
    axes.set_title(f"Figures: the criterion of each case [1]; {title}", fontsize=9, loc="left")
    return saved(figure, path, PAGE_DPI)


def plot_fronts(names, overall: Panel, panels: Mapping[str, Panel], path=None, title: str = "") -> Figure:
    """One large panel over all problems, and a small one for each.

    Parameters
    ----------
    names : sequence of str
        Solvers, in the order of their colours.
    overall : tuple of dict and list
        Time over the least mean time and median error, by solver, and the names of those on the front, the fastest first.
    panels : dict of str to tuple
        The same by problem: times over that of the fastest answer to it, and errors.
    path : str or Path, optional
        Where to save it.
    """
    rows = -(-len(panels) // COLUMNS)
    figure = Figure(figsize=(13, 5.0 + 2.3 * rows), layout="constrained")
    upper, lower = cast(np.ndarray, figure.subfigures(2, 1, height_ratios=(5.0, max(2.3 * rows, 0.1))))
    styles = {name: {"color": f"C{k % 10}", "marker": MARKERS[k // 10 + k % 3]} for k, name in enumerate(names)}
    axes = upper.subplots()
    _panel(axes, *overall, styles, size=60)
    axes.set_title("all problems: mean time over the least, median error", fontsize=10)
    axes.set_xlabel("time over the least [1]")
    axes.set_ylabel("relative error [1]")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    if panels:
        grid = lower.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
        for small, (problem, panel) in zip(grid.flat, panels.items(), strict=False):
            _panel(small, *panel, styles, size=14)
            small.set_title(problem, fontsize=7)
            small.tick_params(labelsize=7, labelbottom=True)
        for small in grid.flat[len(panels) :]:
            small.set_visible(False)
    figure.suptitle(f"{title}; lines: Pareto fronts", fontsize=10)
    return saved(figure, path, PAGE_DPI)


def _panel(axes, points: Mapping[str, Sequence[float]], best: list[str], styles: dict[str, dict], size: float):
    heights = {name: height(error) for name, (_, error) in points.items()}
    if best:
        x = [points[name][0] for name in best]
        axes.step(x, [heights[name] for name in best], where="post", color="0.6", linewidth=1.0, zorder=1)
    for name, (ratio, error) in points.items():
        inside = styles[name]["color"] if error > 0.0 else "none"  # zero is hollow
        style = styles[name] | {"facecolors": inside, "edgecolors": styles[name]["color"]}
        del style["color"]
        axes.scatter([ratio], [heights[name]], s=size, label=name, zorder=2, **style)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(ZERO / 5.0, 5.0 * LARGEST_SHOWN)
    axes.set_yticks([ZERO, *10.0 ** np.arange(-16.0, 1.0, 4.0)], ["0", *(f"1e{e:.0f}" for e in np.arange(-16, 1, 4))])
    axes.minorticks_off()
    axes.axhline(np.sqrt(ZERO * SMALLEST_SHOWN), color="0.85", linewidth=0.8)
    axes.grid(color="0.93")
    axes.set_axisbelow(True)


def height(error: float) -> float:
    """Ordinate of an error: zero below all others, errors off the scale at the edge."""
    return ZERO if error == 0.0 else float(np.clip(error, SMALLEST_SHOWN, LARGEST_SHOWN))
