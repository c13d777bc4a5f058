"""A trajectory as a table of HTML for notebooks: start, end and extremes of each coordinate, with a sparkline."""

from html import escape

import numpy as np

from gauss.system import System, coordinate_units

WIDTH, HEIGHT, MARGIN = 160, 26, 2  # of a sparkline [pixels]
POINTS = 120  # of a sparkline
MOST_ROWS = 24  # of the table
NOISE = 1e-9  # of the size of a coordinate: changes within it are drawn as none
HEAD = ("coordinate", "start", "end", "least", "greatest", "")


def html_table(system: System, t: np.ndarray, q: np.ndarray, title: str) -> str:
    """Table of a motion, of times (k,) [s] and coordinates (k, n_q), below a title."""
    units = list(coordinate_units(system).items()) if len(t) else []
    least = {"m": NOISE * system.scale.length}
    rows = [
        _row(f"{name} [{unit}]", t, column, least.get(unit, NOISE))
        for (name, unit), column in zip(units[:MOST_ROWS], q.T, strict=False)
    ]
    rest = f"<p>{len(units) - MOST_ROWS} more</p>" if len(units) > MOST_ROWS else ""
    head = "".join(f"<th>{text}</th>" for text in HEAD)
    return f"<p>{escape(title)}</p><table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>{rest}"


def _row(name: str, t: np.ndarray, column: np.ndarray, least: float) -> str:
    numbers = (column[0], column[-1], column.min(), column.max())
    cells = [escape(name), *(f"{number:.6g}" for number in numbers), _sparkline(t, column, least)]
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _sparkline(t: np.ndarray, column: np.ndarray, least: float) -> str:
    """Curve of a coordinate over time, as SVG; a level one where it changes by less than ``least``."""
    samples = np.unique(np.linspace(0, len(t) - 1, POINTS).astype(int))
    across = _scaled(t[samples], WIDTH)
    up = HEIGHT - _scaled(column[samples], HEIGHT, least)
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, up, strict=True))
    line = f"<polyline points='{points}' fill='none' stroke='currentColor' stroke-width='1.2'/>"
    return f"<svg width='{WIDTH}' height='{HEIGHT}'>{line}</svg>"


def _scaled(values: np.ndarray, size: int, least: float = 0.0) -> np.ndarray:
    """Values between the margins; constants in the middle."""
    span = np.ptp(values)
    share = (values - values.min()) / span if span > least else np.full(len(values), 0.5)
    return MARGIN + share * (size - 2 * MARGIN)
