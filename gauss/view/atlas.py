"""Heat map of the stability atlas."""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gauss.view.style import PAGE_DPI, saved

COLOURS = ("#7fbf7b", "#fee08b", "#d9d9d9", "#f0f0f0", "#d7191c")  # passed, degraded, honest, slow, silent


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
    axes.imshow(codes, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=len(order) - 0.5, aspect="auto")
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
    handles = [Patch(facecolor=colour, edgecolor="0.6", label=name) for name, colour in zip(order, COLOURS, strict=True)]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(order), fontsize=8, frameon=False)
    axes.set_title(f"Figures: the criterion of each case [1]; {title}", fontsize=9, loc="left")
    return saved(figure, path, PAGE_DPI)
