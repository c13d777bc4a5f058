"""Pareto fronts of a comparison: error against time over all problems, and problem by problem."""

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from matplotlib.figure import Figure

from gauss.view.backends import LARGEST_SHOWN, SMALLEST_SHOWN
from gauss.view.style import PAGE_DPI, saved

Panel = tuple[Mapping[str, Sequence[float]], list[str]]  # times and errors by solver, and the names of those on the front
MARKERS = "osD^v<>PX*"
COLUMNS = 5
ZERO = SMALLEST_SHOWN / 30.0  # where errors of exactly zero are drawn, below a line and with a tick of their own


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
