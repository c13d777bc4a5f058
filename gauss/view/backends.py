"""Figures of the comparison of backends: errors, time against error, performance profiles."""

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from gauss.view.style import LINES, PAGE_DPI, saved

SMALLEST_SHOWN, LARGEST_SHOWN = 1e-17, 1e1  # of the errors that are drawn; what is off is drawn at the edge
COLOURS = {"low": "#9ecae1", "mid": "#4292c6", "high": "#08519c", "tightest": "#08306b", "own": "#d95f02"}


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
    handles = [figure.axes[0].scatter([], [], s=14, color=colour) for colour in COLOURS.values()]
    figure.legend(handles, COLOURS, loc="outside lower center", ncols=len(COLOURS), fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=10)
    return saved(figure, path, PAGE_DPI)


def _answers(axes, everything: np.ndarray, mine: list[dict], name: str):
    """Panel of one backend before the answers of all."""
    if everything.size:
        axes.scatter(*everything.T, s=3, color="0.87", linewidths=0)
    for level, colour in COLOURS.items():
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
