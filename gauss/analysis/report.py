"""A report of found parameters as one HTML file, with its figures in it."""

from collections.abc import Sequence
from html import escape
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gauss.errors import ArgumentError, extra, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = (
    "body { font-family: sans-serif; max-width: 60em; margin: 2em auto } svg { max-width: 100%; height: auto } "
    "pre { white-space: pre-wrap }"
)


def write_report(path, title: str, text: str, figures: Sequence[tuple[str, "Figure"]]) -> Path:
    """Write a report.

    ArgumentError if the path does not end with .html, or its folder does not exist.
    FileError if the file cannot be written.

    Parameters
    ----------
    path : str or Path
        Where to: .html.
    title, text : str
        Heading, and a table of fixed width.
    figures : sequence of (str, Figure)
        Figures with what they show.
    """
    if not isinstance(path, str | Path) or Path(path).suffix != ".html":
        raise ArgumentError(f"report: expected a path that ends with .html, got {path!r}.")
    if not Path(path).parent.is_dir():
        raise ArgumentError(f"report: no folder {str(Path(path).parent)!r} for {Path(path).name!r}.")
    parts = [f"<h1>{escape(title)}</h1>", f"<pre>{escape(text)}</pre>"]
    for caption, figure in figures:
        drawn = StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        parts += [f"<h2>{escape(caption)}</h2>", "<svg" + drawn.getvalue().partition("<svg")[2]]
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    found = Path(path)
    with writing(path):
        found.write_text(f"<!doctype html><html><head>{head}</head><body>{''.join(parts)}</body></html>\n", encoding="utf-8")
    return found


def widths_figure(names: Sequence[str], values, half_widths) -> "Figure":
    """Half widths of confidence intervals as shares of the values, on a logarithmic scale.

    MissingPackageError if matplotlib is not installed.
    """
    with extra("view"):
        from matplotlib.figure import Figure

    shares = np.abs(half_widths) / np.maximum(np.abs(values), np.finfo(float).tiny)
    figure = Figure(figsize=(7.0, 0.9 + 0.28 * len(names)), layout="constrained")
    axes = figure.subplots()
    axes.barh(range(len(names)), shares)
    axes.set(xscale="log", xlabel="half width of the interval / value", yticks=range(len(names)), yticklabels=names)
    axes.axvline(1.0, color="grey", linewidth=0.5)
    axes.invert_yaxis()
    return figure
