"""Markdown of measurements: head of a page, tables, and numbers in words."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

BAR = "\\|"  # within a cell


def head(title: str, conditions: Iterable[str]) -> list[str]:
    """Title of a page, and the conditions of the measurement as a list."""
    return [f"# {title}", "", *(f"- {line}" for line in conditions), ""]


def when_and_where(conditions: Sequence[str]) -> str:
    """Date and machine of a measurement, for titles of figures."""
    return f"{conditions[0].removeprefix('date: ')}, {conditions[1].removeprefix('machine: ')}"


def row(cells: Iterable) -> str:
    """Line of a table; a stroke within a cell is escaped."""
    return f"| {' | '.join(str(cell).replace('|', BAR) for cell in cells)} |"


def table(titles: Sequence[str], rows: Iterable[Iterable]) -> list[str]:
    """Lines of a table."""
    return [row(titles), "|---" * len(titles) + "|", *map(row, rows)]


def formatted_table(columns: Mapping[str, str], rows: Iterable[Mapping]) -> list[str]:
    """Lines of a table whose columns are templates, such as ``"{seconds:.2f} s"``, by title."""
    return table(list(columns), ([cell.format(**one) for cell in columns.values()] for one in rows))


def in_time(seconds: float) -> str:
    """Time in the unit that fits."""
    if not np.isfinite(seconds):
        return "–"
    factor, unit = (1e6, "µs") if seconds < 1e-3 else (1e3, "ms") if seconds < 1.0 else (1.0, "s")
    return f"{factor * seconds:.3g} {unit}"


def number(value: float) -> str:
    """Error by its decade."""
    if value == 0.0:
        return "0"
    return f"{value:.0e}" if np.isfinite(value) else "–"


def count_of(number: int, noun: str) -> str:
    """Number of things: "1 problem", "2 problems"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def share(value: float) -> str:
    """Share in percent."""
    return f"{value:.0%}" if np.isfinite(value) else ""
